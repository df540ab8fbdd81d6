"""Whether a participant's keys can be used, told before the bus refuses them without a word.

The files are read with the `cryptography` library (the extra `deploy`), so this is imported only where keys are given.
Certificates hold calendar time, so this is checked against the calendar and not against mission time.
"""

import datetime
import os
import stat
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.types import PrivateKeyTypes
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID

from lalliance_agents.bus.credentials import MADE, Credentials, KeysError, credentials_in, read


def checked_credentials(keys: Path, name: str) -> Credentials:
    """The credentials of `name` in a folder of keys, when they can be used just now.

    Args:
        keys: the folder, or as much of it as belongs to `name`.
        name: a robot, or one of the names that begin with `@`.

    Raises:
        KeysError: they cannot.
    """
    found = credentials_in(keys, name)
    if not os.path.isdir(found.folder):  # noqa: PTH112 - Path.is_dir raises where a name is too long
        whose = f"robot {name}" if not name.startswith("@") else f"the {found.folder.name}"
        raise KeysError(
            f"{found.folder}: no such folder; expected the keys of {whose}, made by `lalliance keys init` for a mission with it"
        )
    authority, own = _certificate(found.ca), _certificate(found.certificate)
    key = _private_key(found.key)
    _check_issued(found, own, authority)
    _check_name(found, own, name)
    for path, certificate in ((found.ca, authority), (found.certificate, own)):
        _check_date(path, certificate)
    if key.public_key() != own.public_key():
        raise KeysError(f"{found.key}: does not belong to {found.certificate}; {MADE} at one time")
    return found


def _certificate(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(read(path))
    except ValueError:
        raise KeysError(f"{path}: not a certificate in PEM form; {MADE}") from None


def _private_key(path: Path) -> PrivateKeyTypes:
    text = read(path)
    if _others_can_use(path.stat()):
        mode = stat.S_IMODE(path.stat().st_mode)
        raise KeysError(f"{path}: others can use this private key (mode {mode:04o}); expected chmod 600 {path}")
    try:
        return load_pem_private_key(text, password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise KeysError(f"{path}: not a private key in PEM form without a password; {MADE}") from None


def _others_can_use(file: os.stat_result) -> bool:
    """Whether more than its owner, or root and the group that root has let read it, can use a private key.

    The second is how Kubernetes gives a secret to a process without root.
    """
    lent = file.st_uid == 0 and os.geteuid() != 0
    return bool(stat.S_IMODE(file.st_mode) & (0o037 if lent else 0o077))


def _check_issued(found: Credentials, own: x509.Certificate, authority: x509.Certificate) -> None:
    try:
        own.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature):
        raise KeysError(
            f"{found.certificate}: was not issued by the authority in {found.ca}; expected both from one `lalliance keys init`"
        ) from None


def _check_name(found: Credentials, own: x509.Certificate, name: str) -> None:
    names = [attribute.value for attribute in own.subject.get_attributes_for_oid(NameOID.COMMON_NAME)]
    if names != [name]:
        raise KeysError(
            f"{found.certificate}: is the certificate of {', '.join(map(str, names)) or 'nobody'}; expected that of {name}"
        )


def _check_date(path: Path, certificate: x509.Certificate) -> None:
    now = datetime.datetime.now(datetime.UTC)
    if now > certificate.not_valid_after_utc:
        raise KeysError(
            f"{path}: expired on {certificate.not_valid_after_utc:%Y-%m-%d}; expected new keys, in another "
            "folder, from `lalliance keys init`"
        )
    if now < certificate.not_valid_before_utc:
        raise KeysError(
            f"{path}: valid only from {certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC; "
            "expected this machine's calendar to be right"
        )
