"""How uv comes into a clone, from a package index on this machine."""

from __future__ import annotations

import hashlib
import os
import platform
import threading
import zipfile
from base64 import b64encode
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar

import pytest
import uv
from commands import InstallationFailed

TAG = "manylinux_2_17_x86_64"
WHEEL = f"uv-{uv.VERSION}-py3-none-{TAG}.whl"


@pytest.fixture
def index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of uv in a package index, which has one release for this processor."""
    folder = tmp_path / "index" / "uv"
    folder.mkdir(parents=True)
    with zipfile.ZipFile(folder / WHEEL, "w") as archive:
        archive.writestr(f"uv-{uv.VERSION}.data/scripts/uv", "#!/bin/sh\necho this is uv\n")
    digest = hashlib.sha256((folder / WHEEL).read_bytes()).hexdigest()
    monkeypatch.setattr(uv, "WHEELS", {platform.machine(): (TAG, digest)})
    # A page has links to other releases, too, and names hashes after a file.
    names = ("uv-0.0.1-py3-none-any.whl", WHEEL)
    (folder / "index.html").write_text("".join(f'<a href="../uv/{name}#sha256=0">{name}</a>\n' for name in names))
    handler = partial(QuietHandler, directory=str(folder.parent))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        monkeypatch.setenv("UV_DEFAULT_INDEX", f"http://127.0.0.1:{server.server_port}")
        yield folder
        server.shutdown()
        thread.join()


class QuietHandler(SimpleHTTPRequestHandler):
    logins: ClassVar[list[str | None]] = []

    def do_GET(self) -> None:
        self.logins.append(self.headers["Authorization"])
        super().do_GET()

    def log_message(self, *_: object) -> None:
        pass


def test_program_is_taken_out_of_the_wheel_and_can_be_run(index: Path, tmp_path: Path) -> None:
    program = uv.bring(tmp_path / "here")
    assert program.read_text().endswith("this is uv\n")
    assert program.stat().st_mode & 0o111


def test_program_that_is_there_is_not_fetched_again(index: Path, tmp_path: Path) -> None:
    program = uv.bring(tmp_path / "here")
    (index / WHEEL).unlink()
    assert uv.bring(tmp_path / "here") == program


def test_other_file_of_the_name_is_refused(index: Path, tmp_path: Path) -> None:
    (index / WHEEL).write_bytes(b"something else")
    with pytest.raises(InstallationFailed, match=r"not the one that setup/uv\.py has the hash of"):
        uv.bring(tmp_path / "here")
    assert not (tmp_path / "here").exists()


def test_login_in_the_address_is_shown_to_the_index(
    index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UV_DEFAULT_INDEX", os.environ["UV_DEFAULT_INDEX"].replace("//", "//someone:a%2Fword@"))
    QuietHandler.logins.clear()
    uv.bring(tmp_path / "here")
    assert QuietHandler.logins == ["Basic " + b64encode(b"someone:a/word").decode()] * 2


@pytest.mark.parametrize("address", ["pypi", "http://[", "http://127.0.0.1:port/simple"])
def test_address_that_is_none_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str) -> None:
    monkeypatch.setenv("UV_DEFAULT_INDEX", address)
    with pytest.raises(InstallationFailed, match=r"cannot be reached \(.*\); check the network, the proxy and UV_DEF"):
        uv.bring(tmp_path / "here")


def test_index_without_the_release_is_named(index: Path, tmp_path: Path) -> None:
    (index / "index.html").write_text("<a href='x'>x</a>")
    with pytest.raises(InstallationFailed, match=rf"^the package index http://.*/uv/ has no {WHEEL}$"):
        uv.bring(tmp_path / "here")


def test_index_that_cannot_be_reached_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("UV_DEFAULT_INDEX", "http://127.0.0.1:9/simple")
    monkeypatch.setattr(uv, "WHEELS", {platform.machine(): (TAG, "")})
    with pytest.raises(
        InstallationFailed, match=r"^http://127\.0\.0\.1:9/simple/uv/ cannot be reached .*; check the network"
    ):
        uv.bring(tmp_path / "here")


def test_processor_without_a_pinned_release_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    with pytest.raises(InstallationFailed, match=r"^uv is pinned for x86_64 and aarch64, and .* is riscv64$"):
        uv.bring(tmp_path / "here")
