"""A router inside a Python process: where all clients of one bus meet. No other program is needed.

The router only forwards. It has no handlers and knows neither keys nor messages; closing it, or killing its process,
leaves the clients without a bus until one listens on the same endpoint again.
"""

import socket
from collections.abc import Sequence

import zenoh

from lalliance_agents.bus.base import Closing
from lalliance_agents.bus.credentials import Credentials, check_fits
from lalliance_agents.bus.session import (
    check_endpoint,
    close_session,
    close_when_forgotten,
    open_session,
    router_settings,
)
from lalliance_agents.errors import BusError


class Router(Closing):
    """A router that runs until it is closed. Leaving the context closes it.

    Attributes:
        endpoint: where it listens.
    """

    def __init__(self, session: zenoh.Session, endpoint: str) -> None:
        self.endpoint = endpoint
        self._session = session
        close_when_forgotten(self, session)

    def __repr__(self) -> str:
        return f"<router at {self.endpoint}, {'closed' if self._session.is_closed() else 'open'}>"

    async def close(self) -> None:
        """Stop routing; a second call does nothing. Cancelled, the router still stops."""
        await close_session(self._session)


async def open_router(listen: str, *, credentials: Credentials | None = None, others: Sequence[str] = ()) -> Router:
    """Start a router that listens on `listen`, for example `tcp/127.0.0.1:7447`.

    Args:
        listen: the endpoint.
        credentials: what to show its clients, who then must show theirs and may say only what its rules allow; None: it
            asks for nothing, and lets everything through.
        others: where other routers listen, which need not be there yet: what is said at one is heard at all of them.

    Raises:
        BusError: if `listen` is not an endpoint, or cannot be listened on.
        KeysError: if it asks for credentials and there are none, or the other way round, or no rules with them.
    """
    for endpoint in (listen, *others):
        check_endpoint(endpoint)
        check_fits(endpoint, credentials)
    try:
        session = await open_session(router_settings(listen, credentials, others))
    except zenoh.ZError as error:
        if "in use" in str(error):
            raise BusError(
                f"The router cannot listen on {listen}: the port is in use; another router may be running there."
            ) from error
        raise BusError(
            f"The router cannot listen on {listen}: check that the host is an address of this machine and that "
            "this user may open the port."
        ) from error
    return Router(session, listen)


def free_endpoint(protocol: str = "tcp") -> str:
    """An endpoint on this machine alone, with a TCP port that is free just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"{protocol}/127.0.0.1:{probe.getsockname()[1]}"
