"""TLS certificates that sign themselves: a virtual controller's of one start, or one kept for this installation."""

from __future__ import annotations

import os
import ssl
from collections.abc import Collection
from datetime import datetime, timedelta, timezone
from ipaddress import ip_address
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import SettingsError, missing_extra

VALID = timedelta(days=365)
_RENEWED = timedelta(days=30)  # before its end
_FILE = "certificate.pem"


class Certificate(NamedTuple):
    """A certificate with its key.

    Attributes:
        context: TLS for a server.
        fingerprint: SHA-256 of the certificate, as browsers show it, such as ``3F:A0:…``.
        is_new: whether it was made just now.
    """

    context: ssl.SSLContext
    fingerprint: str
    is_new: bool


def self_signed_context(host: str) -> ssl.SSLContext:
    """TLS for a virtual controller at ``host``, with a new key and certificate, as a controller's.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
    """
    _check_package("virtual-irc5")
    return _loaded(_made("Virtual controller", (host,)), is_new=True).context


def installation_certificate(hosts: Collection[str], product: str, folder: Path | None = None) -> Certificate:
    """The certificate of this installation: a browser that has accepted it need not be asked again.

    It is made for ``hosts`` where there is none or it ends soon, in a file that only its user can read. A host that is
    new, such as another address of this machine, makes no other one: a browser asks about an address that the
    certificate does not name as it asks about any certificate that signs itself, and the other devices are not asked.

    Args:
        hosts: names and addresses of this machine.
        product: the package that serves with it, in whose name it is made.
        folder: of the file; that of the user's state without one.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
        SettingsError: the file cannot be read or written.
    """
    _check_package(product)
    state = folder or Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "yumi"
    file = state / _FILE
    try:
        kept = file.read_bytes() if file.is_file() else b""
        is_new = not kept or _ends_soon(kept)
        if is_new:
            kept = _made(product, hosts)
            state.mkdir(parents=True, exist_ok=True, mode=0o700)
            trial = file.with_suffix(f".{os.getpid()}")
            with open(trial, "wb", opener=lambda path, flags: os.open(path, flags | os.O_EXCL, 0o600)) as written:
                written.write(kept)
            trial.replace(file)
        return _loaded(kept, is_new=is_new)
    except (OSError, ValueError) as error:
        raise SettingsError(message("certificate_failed", file=str(file), why=said_by(error))) from error


def _ends_soon(pem: bytes) -> bool:
    end: datetime = _x509().load_pem_x509_certificate(pem).not_valid_after_utc
    return end - datetime.now(timezone.utc) <= _RENEWED


def _names(hosts: Collection[str]) -> list[Any]:
    x509 = _x509()
    names: list[Any] = []
    for host in ("localhost", *hosts):
        try:
            names.append(x509.IPAddress(ip_address(host)))
        except ValueError:
            names.append(x509.DNSName(host))
    return list(dict.fromkeys(names))


def _made(owner: str, hosts: Collection[str]) -> bytes:
    """A new key and its certificate, as PEM."""
    x509 = _x509()
    from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415 - of an extra, for this one use
    from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, owner)])
    now = datetime.now(timezone.utc)
    builder = x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), now, now + VALID)
    certificate = (
        builder.add_extension(x509.SubjectAlternativeName(_names(hosts)), critical=False)
        .add_extension(x509.ExtendedKeyUsage([x509.ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256())
    )
    private: bytes = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    public: bytes = certificate.public_bytes(serialization.Encoding.PEM)
    return private + public


def _loaded(pem: bytes, *, is_new: bool) -> Certificate:
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    # Python reads a key from a file alone; only its user can open this folder, and it is gone at once.
    with TemporaryDirectory() as folder:
        path = Path(folder) / _FILE
        path.write_bytes(pem)
        context.load_cert_chain(path)
    digest = _x509().load_pem_x509_certificate(pem).fingerprint(hashes.SHA256())
    return Certificate(context, digest.hex(":").upper(), is_new)


def _check_package(product: str) -> None:
    """That what makes certificates is there; raises MissingPrerequisite, which names an extra of ``product``."""
    try:
        _x509()
    except ModuleNotFoundError as error:
        raise missing_extra(message("https_needs_cryptography"), product, "robotware7") from error


def _x509() -> Any:
    """The part of the package that makes and reads certificates."""
    from cryptography import x509  # noqa: PLC0415 - of an extra

    return x509
