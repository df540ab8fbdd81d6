"""Who a participant of an encrypted bus is: the files it shows, and where they are in a folder of keys.

    ca/          certificate.pem  key.pem                the authority, needed only to make keys
    router/      ca.pem  certificate.pem  key.pem  access.json
    world/       ca.pem  certificate.pem  key.pem
    operator/    ca.pem  certificate.pem  key.pem
    robots/NAME/ ca.pem  certificate.pem  key.pem

A participant needs its own folder and no other: a robot's machine holds `robots/NAME` alone. A certificate's common name is
the name under which its owner sends, so that the router's access control and the checks of messages speak of the same names.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lalliance_agents.errors import UserError
from lalliance_agents.wire.keys import OPERATOR, WORLD

#: The router's name in its certificate; it sends nothing.
ROUTER = "@router"
#: The folder of the authority.
AUTHORITY = "ca"
#: Which protocol of an endpoint shows certificates.
SECURE = "tls/"

#: What is expected where keys cannot be used.
MADE = "expected keys made by `lalliance keys init`"

_FOLDERS = {ROUTER: "router", WORLD: "world", OPERATOR: "operator"}


class KeysError(UserError):
    """Keys that cannot be used, or that somebody else could use too."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """The files with which a participant proves who it is.

    Attributes:
        folder: where they are.
    """

    folder: Path

    @property
    def ca(self) -> Path:
        """The certificate of the authority that vouches for all others."""
        return self.folder / "ca.pem"

    @property
    def certificate(self) -> Path:
        """The participant's own certificate."""
        return self.folder / "certificate.pem"

    @property
    def key(self) -> Path:
        """Its private key."""
        return self.folder / "key.pem"

    @property
    def access(self) -> Path:
        """Who may say what, if they are a router's."""
        return self.folder / "access.json"

    def access_rules(self) -> dict[str, Any]:
        """Who may say what, in a router's own words.

        Raises:
            KeysError: there are no such rules here.
        """
        try:
            rules = json.loads(read(self.access))
        except ValueError as error:
            raise KeysError(f"{self.access}: not readable as JSON ({error}); {MADE}") from None
        if not isinstance(rules, dict) or rules.get("enabled") is not True or rules.get("default_permission") != "deny":
            raise KeysError(f"{self.access}: these rules do not deny what they do not allow; {MADE}")
        return rules


def credentials_in(keys: Path, name: str) -> Credentials:
    """Where the credentials of `name`, a robot or one of the names that begin with `@`, are in a folder of keys."""
    return Credentials(keys / _FOLDERS[name] if name in _FOLDERS else keys / "robots" / name)


def check_fits(endpoint: str, credentials: Credentials | None) -> None:
    """Accept an endpoint where the credentials, or none, will do; one that names certificates itself will do without.

    Raises:
        KeysError: they will not.
    """
    if credentials is not None and not endpoint.startswith(SECURE):
        raise KeysError(
            f"{endpoint!r} is not encrypted and asks for no keys; with --keys expected an endpoint {SECURE}<host>:<port>"
        )
    if credentials is None and endpoint.startswith(SECURE) and "#" not in endpoint:
        raise KeysError(f"{endpoint!r} is encrypted; expected --keys with a folder made by `lalliance keys init`")


def read(path: Path) -> bytes:
    """What is in one of the files.

    Raises:
        KeysError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise KeysError(f"{path}: no such file; {MADE}, and copied whole") from None
    except OSError as error:
        raise KeysError(
            f"{path}: cannot be read ({error.strerror or error}); expected a file that this user may read"
        ) from None
