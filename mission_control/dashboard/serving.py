"""A socket and a web server on it, for as long as a context lasts."""

import asyncio
import contextlib
import ipaddress
import socket
from collections.abc import AsyncIterator, Iterator

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from lalliance_agents.errors import UserError
from mission_control.dashboard.viewer import LONGEST_MESSAGE

#: How long connections may take to end when the server does, in seconds.
GRACE = 1
#: How long a connection may last that is no viewer's, in seconds: whoever says nothing, or very slowly, is not waited for.
LONGEST_CONNECTION = 30.0
#: Such connections at a time; the oldest makes room for the newest.
MOST_CONNECTIONS = 128


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the command."""
        yield


class _Brief(H11Protocol):
    """A connection until it is a viewer's, which has a protocol of its own."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override] # as in its base
        """Begin, as others end."""
        super().connection_made(transport)
        self.began = self.loop.time()
        others = [one for one in self.connections if isinstance(one, _Brief)]
        if len(others) > MOST_CONNECTIONS:
            min(others, key=lambda one: one.began).transport.abort()
        self.ending = self.loop.call_later(LONGEST_CONNECTION, self._end)

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self.ending.cancel()
        super().connection_lost(exc)

    def _end(self) -> None:
        if self in self.connections:
            self.transport.abort()


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens on `host` and `port`; 0: a free port.

    Raises:
        UserError: that cannot be done.
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, _, _, _, address = found[0]
        return socket.create_server(address[:2], family=family, backlog=128)
    except (OSError, UnicodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no such name"
        raise UserError(
            f"the page cannot listen on {host} port {port} ({reason}); expected an address of this machine and a free port, "
            "or --port 0 for any"
        ) from None


def address_of(listening: socket.socket) -> str:
    """The address of a page on this socket, as this machine's browser calls it."""
    host, port = listening.getsockname()[:2]
    if ipaddress.ip_address(host).is_unspecified:
        host = "localhost"
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"


@contextlib.asynccontextmanager
async def served(app: ASGIApp, listening: socket.socket) -> AsyncIterator[None]:
    """Serve `app` on the socket for as long as the context lasts."""
    config = uvicorn.Config(
        app,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        http=_Brief,
        ws="websockets-sansio",
        ws_max_size=4 * LONGEST_MESSAGE,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=GRACE,
    )
    server = _Server(config)
    work = asyncio.create_task(server.serve(sockets=[listening]))
    try:
        yield
    finally:
        server.should_exit = True
        await asyncio.wait([work], timeout=2 * GRACE)
        work.cancel()
        listening.close()
