"""Brings uv, which installs everything else, into the clone: one release, checked by its hash.

Written with Python's own library alone, since a machine may have neither pip nor venv. The package index is the one
that uv or pip is configured with by a variable, with a login where its address has one.

    python3 setup/uv.py lock        runs the clone's uv with these arguments, and fetches it first where it is not there
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import ssl
import sys
import zipfile
from base64 import b64encode
from http.client import HTTPException
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit
from urllib.request import Request, urlopen

from commands import InstallationFailed, say

FOLDER = Path(__file__).resolve().parents[1] / "build" / "uv"
VERSION = "0.13.9"
WHEELS = {
    "x86_64": (
        "manylinux_2_17_x86_64.manylinux2014_x86_64",
        "d7f459fe4fd247d830351c75686d3996ace3c6f3f728eb0e85a30b7ada0cef19",
    ),
    "aarch64": (
        "manylinux_2_28_aarch64",
        "ecb6028d79dc96fbeafffe5c8af62a7099487ebc05a701e76714eebcffd06375",
    ),
}
"""By processor: the tag in the wheel's name, and the wheel's SHA-256."""

INDEXES = ("UV_DEFAULT_INDEX", "UV_INDEX_URL", "PIP_INDEX_URL")
PYPI = "https://pypi.org/simple"
TIMEOUT = 60.0  # [s] without a byte


def bring(folder: Path = FOLDER) -> Path:
    """The program, fetched where ``folder`` has not got it yet; raises InstallationFailed."""
    program = folder / f"uv-{VERSION}"
    if program.exists():
        return program
    if platform.machine() not in WHEELS:
        raise InstallationFailed(f"uv is pinned for {' and '.join(WHEELS)}, and this processor is {platform.machine()}")
    tag, digest = WHEELS[platform.machine()]
    say(f"fetching uv {VERSION}")
    wheel = _fetch(f"uv-{VERSION}-py3-none-{tag}.whl")
    if hashlib.sha256(wheel).hexdigest() != digest:
        raise InstallationFailed(f"the index's uv {VERSION} is not the one that setup/uv.py has the hash of")
    folder.mkdir(parents=True, exist_ok=True)
    own = folder / f"{program.name}.{os.getpid()}"
    own.write_bytes(zipfile.ZipFile(BytesIO(wheel)).read(f"uv-{VERSION}.data/scripts/uv"))
    own.chmod(0o755)
    own.replace(program)
    return program


def _fetch(name: str) -> bytes:
    named = next(filter(None, map(os.environ.get, INDEXES)), PYPI).rstrip("/") + "/uv/"
    index = re.sub("(?<=//).*@", "", named)  # what is printed has no password
    try:
        login, _, host = urlsplit(named).netloc.rpartition("@")
        link = re.search(rf'href="([^"]*/{re.escape(name)}[^"]*)"', _read(index, host, login).decode())
        if link is None:
            raise InstallationFailed(f"the package index {index} has no {name}")
        return _read(urljoin(index, link[1]), host, login)
    except (OSError, HTTPException, ValueError) as error:  # ValueError: what the variable names is no address
        reason = getattr(error, "reason", error)
        raise InstallationFailed(
            f"{index} cannot be reached ({reason}); check the network, the proxy and UV_DEFAULT_INDEX"
        ) from error


def _read(address: str, host: str, login: str) -> bytes:
    """What is at an address; ``login``, user:password, is shown to ``host`` alone."""
    request = Request(address)
    if login and urlsplit(address).netloc == host:
        request.add_header("Authorization", f"Basic {b64encode(unquote(login).encode()).decode()}")
    context = ssl.create_default_context(cafile=os.environ.get("SSL_CERT_FILE") or os.environ.get("PIP_CERT"))
    with urlopen(request, timeout=TIMEOUT, context=context) as file:
        return bytes(file.read())


def main() -> None:
    """Become the clone's uv; one sentence where it cannot be fetched."""
    try:
        program = bring()
    except InstallationFailed as failure:
        sys.exit(f"setup: {failure}")
    os.environ.update(UV_PYTHON=sys.executable, UV_PYTHON_DOWNLOADS="never")
    os.execv(program, [str(program), *sys.argv[1:]])


if __name__ == "__main__":
    main()
