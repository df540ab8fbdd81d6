"""Keys for a team: an authority, and a certificate that it issues to the router, the world, the operator and each robot.

The authority's private key is used here and nowhere else. It stays in the folder so that somebody may put it away, or delete
it: without it no further certificate can be made, by anybody. All of the folder appears at once or not at all.
"""

import datetime
import ipaddress
import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from lalliance_agents.bus.access import access_control
from lalliance_agents.bus.credentials import AUTHORITY, ROUTER, KeysError, credentials_in
from lalliance_agents.wire.keys import OPERATOR, WORLD

#: Certificates are valid from so long before they are made: machines' calendars differ.
_LEEWAY = datetime.timedelta(days=1)


@dataclass(frozen=True, slots=True)
class Validity:
    """From when until when certificates are valid."""

    since: datetime.datetime
    until: datetime.datetime

    @classmethod
    def of_days(cls, days: float) -> "Validity":
        """From now on, for so many days."""
        now = datetime.datetime.now(datetime.UTC)
        return cls(now - _LEEWAY, now + datetime.timedelta(days=days))


def make_keys(folder: Path, robots: Iterable[str], hosts: Iterable[str], validity: Validity) -> None:
    """Make all keys of a team in a new folder.

    Args:
        folder: it must not exist yet.
        robots: the team.
        hosts: the host names and addresses under which routers are called.
        validity: of all certificates.

    Raises:
        KeysError: the folder is there already, or cannot be made, or a host is none.
    """
    robots, names = list(robots), [_host(host) for host in hosts]
    if folder.exists():
        raise KeysError(f"{folder}: exists already, and keys in use are not replaced; expected a new folder")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        new = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    except OSError as error:
        raise KeysError(f"{folder}: cannot be made ({error.strerror or error}); expected a place to write to") from None
    try:
        authority = Authority(validity)
        authority.store(new / AUTHORITY)
        for name in (ROUTER, WORLD, OPERATOR, *robots):
            authority.issue(new, name, names if name == ROUTER else [])
        access = json.dumps(access_control(robots), indent=1)
        credentials_in(new, ROUTER).access.write_text(access + "\n")
        new.chmod(0o755)
        new.rename(folder)
    except BaseException:
        shutil.rmtree(new, ignore_errors=True)
        raise


class Authority:
    """Issues certificates.

    Args:
        validity: of its own certificate and all that it issues.
    """

    def __init__(self, validity: Validity) -> None:
        self._validity = validity
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._name = _named("lalliance authority")
        usage = _usage(signs_certificates=True)
        self._certificate = (
            self._begin(self._name, self._key)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(usage, critical=True)
            .sign(self._key, hashes.SHA256())
        )

    def store(self, folder: Path) -> None:
        """Write the authority's own certificate and private key into a new folder."""
        _store(folder, self._certificate, self._key)

    def issue(self, keys: Path, name: str, hosts: Iterable[x509.GeneralName]) -> None:
        """Make the credentials of one participant.

        Args:
            keys: the folder of all keys.
            name: whose; it becomes the certificate's common name.
            hosts: under which names it is called, if it is.
        """
        key = ec.generate_private_key(ec.SECP256R1())
        purposes = [ExtendedKeyUsageOID.CLIENT_AUTH]
        builder = (
            self._begin(_named(name), key)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(signs_certificates=False), critical=True)
        )
        if called := list(hosts):
            builder = builder.add_extension(x509.SubjectAlternativeName(called), critical=False)
            purposes.append(ExtendedKeyUsageOID.SERVER_AUTH)
        certificate = builder.add_extension(x509.ExtendedKeyUsage(purposes), critical=False).sign(
            self._key, hashes.SHA256()
        )
        place = credentials_in(keys, name)
        _store(place.folder, certificate, key)
        place.ca.write_bytes(self._certificate.public_bytes(Encoding.PEM))

    def _begin(self, name: x509.Name, key: ec.EllipticCurvePrivateKey) -> x509.CertificateBuilder:
        return x509.CertificateBuilder(
            issuer_name=self._name,
            subject_name=name,
            public_key=key.public_key(),
            serial_number=x509.random_serial_number(),
            not_valid_before=self._validity.since,
            not_valid_after=self._validity.until,
        )


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError:
        raise KeysError(f"{host!r} is not a host; expected a host name in ASCII, or an IP address") from None


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _store(folder: Path, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
    folder.mkdir(parents=True)
    (folder / "certificate.pem").write_bytes(certificate.public_bytes(Encoding.PEM))
    # Readable by nobody else from its first instant on.
    handle = os.open(folder / "key.pem", os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "wb") as file:
        file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
