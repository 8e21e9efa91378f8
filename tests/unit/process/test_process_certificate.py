"""The certificate that an installation makes itself."""

from __future__ import annotations

import ssl
import sys
from datetime import timedelta
from pathlib import Path

import pytest

from abb_protocols.errors import MissingPrerequisite, SettingsError
from abb_runtime.process import certificate
from abb_runtime.process.certificate import installation_certificate, self_signed_context
from refusals import refused

pytest.importorskip("cryptography", reason="the part robotware7 is not installed")


def test_certificate_is_made_once_and_kept_for_its_user_alone(tmp_path: Path) -> None:
    folder = tmp_path / "yumi"
    first = installation_certificate(["127.0.0.1", "robot-pc"], "yumi-ros2", folder)
    file = folder / "certificate.pem"
    assert file.stat().st_mode & 0o077 == folder.stat().st_mode & 0o077 == 0
    assert list(folder.iterdir()) == [file]
    assert len(first.fingerprint.split(":")) == 32
    kept = installation_certificate(["robot-pc"], "yumi-ros2", folder)
    assert (first.is_new, kept.is_new, kept.fingerprint) == (True, False, first.fingerprint)
    assert isinstance(first.context, ssl.SSLContext)


def test_certificate_is_kept_when_the_address_of_the_machine_changes(tmp_path: Path) -> None:
    first = installation_certificate(["robot-pc", "192.168.1.20"], "yumi-ros2", tmp_path)
    then = installation_certificate(["robot-pc", "192.168.1.31"], "yumi-ros2", tmp_path)
    assert (then.fingerprint, then.is_new) == (first.fingerprint, False)


def test_certificate_is_made_anew_before_it_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(certificate, "VALID", timedelta(days=29))
    first = installation_certificate(["127.0.0.1"], "yumi-ros2", tmp_path)
    monkeypatch.undo()
    second = installation_certificate(["127.0.0.1"], "yumi-ros2", tmp_path)
    assert second.is_new
    assert second.fingerprint != first.fingerprint
    assert installation_certificate(["127.0.0.1"], "yumi-ros2", tmp_path).fingerprint == second.fingerprint


def test_file_that_is_no_certificate_is_named(tmp_path: Path) -> None:
    file = tmp_path / "certificate.pem"
    file.write_text("nothing")
    with refused(SettingsError, "certificate_failed", file=str(file)):
        installation_certificate(["127.0.0.1"], "yumi-ros2", tmp_path)


def test_installation_without_cryptography_reads_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "cryptography", None)
    for product in ("yumi-ros2", "virtual-irc5"):
        with refused(MissingPrerequisite, "extra_missing", package=product, extra="robotware7"):
            installation_certificate(["127.0.0.1"], product, tmp_path)
    with refused(MissingPrerequisite, "extra_missing", package="virtual-irc5", extra="robotware7"):
        self_signed_context("127.0.0.1")
