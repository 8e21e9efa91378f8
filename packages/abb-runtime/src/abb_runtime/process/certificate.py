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
    """

    context: ssl.SSLContext
    fingerprint: str


def self_signed_context(host: str) -> ssl.SSLContext:
    """TLS for a virtual controller at ``host``, with a new key and certificate, as a controller's.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
    """
    _check_package("virtual-irc5")
    return _loaded(_made("Virtual controller", (host,))).context


def installation_certificate(hosts: Collection[str], folder: Path | None = None) -> Certificate:
    """The certificate of this installation for ``hosts``: a browser that trusts it need not be asked again.

    It is made where there is none, where it ends soon, or where a host is new, in a file that only its user can read.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
        SettingsError: the file cannot be read or written.
    """
    _check_package("yumi-ros2")
    state = folder or Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "yumi"
    file = state / _FILE
    try:
        kept = file.read_bytes() if file.is_file() else b""
        if not kept or not _is_good(kept, hosts):
            kept = _made("yumi view", hosts)
            state.mkdir(parents=True, exist_ok=True, mode=0o700)
            trial = file.with_suffix(f".{os.getpid()}")
            with open(trial, "wb", opener=lambda path, flags: os.open(path, flags | os.O_EXCL, 0o600)) as written:
                written.write(kept)
            trial.replace(file)
        return _loaded(kept)
    except (OSError, ValueError) as error:
        raise SettingsError(message("certificate_failed", file=str(file), why=said_by(error))) from error


def _is_good(pem: bytes, hosts: Collection[str]) -> bool:
    """Whether a kept certificate names these hosts and does not end soon."""
    x509 = _x509()
    certificate = x509.load_pem_x509_certificate(pem)
    names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    is_new = certificate.not_valid_after_utc - datetime.now(timezone.utc) > _RENEWED
    return is_new and set(_names(hosts)) <= set(names)


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


def _loaded(pem: bytes) -> Certificate:
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    # Python reads a key from a file alone; only its user can open this folder, and it is gone at once.
    with TemporaryDirectory() as folder:
        path = Path(folder) / _FILE
        path.write_bytes(pem)
        context.load_cert_chain(path)
    digest = _x509().load_pem_x509_certificate(pem).fingerprint(hashes.SHA256())
    return Certificate(context, digest.hex(":").upper())


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
