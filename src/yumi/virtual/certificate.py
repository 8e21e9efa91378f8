"""The TLS certificate of a virtual controller with RobotWare 7, made and signed by itself."""

from __future__ import annotations

import ssl
from datetime import datetime, timedelta, timezone
from ipaddress import ip_address
from pathlib import Path
from tempfile import TemporaryDirectory

from yumi.catalogue import message
from yumi.errors import missing_extra


def self_signed_context(host: str) -> ssl.SSLContext:
    """TLS for a server at ``host``, with a new key and a certificate that it has signed itself, as a controller's.

    Raises:
        MissingPrerequisite: the package ``cryptography`` is not installed.
    """
    try:
        from cryptography import x509  # noqa: PLC0415 - of an extra, for this one use
        from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415
        from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise missing_extra(message("https_needs_cryptography"), "robotware7") from error
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "Virtual controller")])
    hosts: list[x509.GeneralName] = [x509.DNSName("localhost")]
    try:
        hosts.append(x509.IPAddress(ip_address(host)))
    except ValueError:
        hosts.append(x509.DNSName(host))
    now = datetime.now(timezone.utc)
    builder = x509.CertificateBuilder(
        name, name, key.public_key(), x509.random_serial_number(), now, now + timedelta(days=365)
    )
    certificate = builder.add_extension(x509.SubjectAlternativeName(hosts), critical=False).sign(key, hashes.SHA256())
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    # Python reads a key from a file alone; only its user can open this folder, and it is gone at once.
    with TemporaryDirectory() as folder:
        path = Path(folder) / "controller.pem"
        path.write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
            )
            + certificate.public_bytes(serialization.Encoding.PEM)
        )
        context.load_cert_chain(path)
    return context
