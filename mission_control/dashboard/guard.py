"""Who may look at the page, and who may disturb the mission. Pure.

A browser that has the page of somebody else open sends that page's requests here too. So a request has to name this server
as its host, which one through a name that was pointed here (DNS rebinding) does not, and where it tells from which page it
comes, that has to be one of this server. Whoever disturbs the mission has to know the token as well. It travels in a header,
which no other page can make a browser send here, and never in an address that a log could hold.
"""

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Iterable, Mapping
from pathlib import Path
from urllib.parse import urlsplit

from lalliance_agents.errors import UserError

#: Letters of a token in a file, at least and at most.
TOKEN_LENGTH = (16, 200)

#: Nothing but what this server serves: no script, style or connection of anybody else, and no text ever taken for HTML.
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; font-src 'self'; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'; trusted-types 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}


def new_token() -> str:
    """A token that nobody can guess."""
    return secrets.token_urlsafe(24)


def read_token(path: Path) -> str:
    """The token in a file.

    Raises:
        UserError: there is none that can be used.
    """
    least, most = TOKEN_LENGTH
    expected = f"expected {least} to {most} letters, digits or signs without a space"
    try:
        with path.open(encoding="ascii") as file:
            token = file.read(2 * most).strip()  # a device can be without end
    except OSError as error:
        raise UserError(f"{path}: the token cannot be read ({error.strerror}); {expected}") from None
    except UnicodeDecodeError:
        raise UserError(f"{path}: this is no token; {expected}") from None
    if not least <= len(token) <= most or not token.isprintable() or " " in token:
        raise UserError(f"{path}: this is no token; {expected}")
    return token


class Guard:
    """Judges requests by their headers.

    Args:
        token: what a viewer must know to disturb the mission.
        names: host names under which this server is called, besides its addresses and the name of this machine.
    """

    def __init__(self, token: str, names: Iterable[str] = ()) -> None:
        self._token = token.encode()
        self._names = {"localhost", socket.gethostname().lower(), *map(str.lower, names)}

    def is_own(self, headers: Mapping[str, str]) -> bool:
        """Whether a request calls this server by a name of its own, and comes from no page of another."""
        host = headers.get("host", "")
        if not self._is_own_host(host):
            return False
        origin = headers.get("origin")
        return origin is None or origin.lower() in {f"http://{host.lower()}", f"https://{host.lower()}"}

    def may_disturb(self, headers: Mapping[str, str]) -> bool:
        """Whether a request shows the token."""
        scheme, _, shown = headers.get("authorization", "").partition(" ")
        # In constant time, so that nobody can find the token letter by letter.
        return scheme.lower() == "bearer" and hmac.compare_digest(shown.strip().encode(), self._token)

    def _is_own_host(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname
        except ValueError:
            return False
        if name is None or host != host.strip() or any(sign in host for sign in "/@?#"):
            return False
        if name in self._names:
            return True
        try:
            # An address cannot be pointed somewhere else.
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True
