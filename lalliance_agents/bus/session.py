"""Zenoh sessions: how they are configured, opened and closed, and what a person is told when that fails.

Opening and closing block, so they run in a thread of their own; the caller may be cancelled meanwhile, and what then
opens for nobody is closed again. The thread is a daemon: leaving the program never waits for a router that does not
answer, and a close that such a router holds up (10 s were seen) goes on without us after `CLOSE_LIMIT`. Zenoh's own
error texts name paths of the machine it was built on and are never shown. Nothing is known here of keys and messages.
"""

import asyncio
import atexit
import contextlib
import json
import os
import re
import threading
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, TypeVar

import zenoh

from lalliance_agents.bus.base import LEASE
from lalliance_agents.bus.credentials import Credentials
from lalliance_agents.errors import BusError

#: Larger messages are refused by the transport, in bytes.
MAX_MESSAGE = 1024 * 1024
#: A close that takes longer, in seconds, is left to itself.
CLOSE_LIMIT = 0.5

_IP_PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws")
_IP_ENDPOINT = re.compile(
    rf"(?:{'|'.join(_IP_PROTOCOLS)})/(?:\[[^\]/]+\]|[^:/\[\]?#\s]+):(?P<port>\d{{1,5}})(?:[?#].*)?"
)

T = TypeVar("T")


#: How often to try again, when a connection could not be made or was lost.
_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}


def client_settings(endpoint: str, timeout: float, credentials: Credentials | None = None) -> dict[str, Any]:
    """A client of the one router at `endpoint`, given up after `timeout` seconds, but only before it first connected."""
    connect = {"endpoints": [endpoint], "timeout_ms": max(1, round(timeout * 1000)), "retry": _RETRY}
    return {"mode": "client", "connect": connect, **_settings(credentials)}


def router_settings(listen: str, credentials: Credentials | None = None, others: Sequence[str] = ()) -> dict[str, Any]:
    """A router that listens on one endpoint; with credentials, it lets through only what the rules with them allow.

    It connects to `others`, other routers, as soon as they are there, and again whenever a connection was lost.
    """
    connect = {"endpoints": [*others], "timeout_ms": -1, "exit_on_failure": False, "retry": _RETRY}
    rules = {} if credentials is None else {"access_control": credentials.access_rules()}
    return {"mode": "router", "listen": {"endpoints": [listen]}, "connect": connect, **_settings(credentials), **rules}


def _settings(credentials: Credentials | None) -> dict[str, Any]:
    """No search for others, no shared memory (an upstream race), and the limits above."""
    link: dict[str, Any] = {"tx": {"lease": round(LEASE * 1000)}, "rx": {"max_message_size": MAX_MESSAGE}}
    if credentials is not None:
        link |= {"protocols": ["tls"], "tls": _tls(credentials)}
    return {
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}, "link": link},
    }


def _tls(credentials: Credentials) -> dict[str, Any]:
    """Each side shows its certificate and checks the other's; the connecting side also that it is the host it called."""
    certificate, key = str(credentials.certificate), str(credentials.key)
    return {
        "root_ca_certificate": str(credentials.ca),
        "enable_mtls": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }


def check_endpoint(endpoint: str) -> None:
    """Accept an endpoint over IP: `<protocol>/<host>:<port>`, with Zenoh's `?` and `#` suffixes.

    Raises:
        BusError: if it is anything else.
    """
    found = _IP_ENDPOINT.fullmatch(endpoint)
    if not found or not 0 < int(found["port"]) < 65536:
        raise BusError(
            f"{endpoint!r} is not an endpoint of the bus; expected <protocol>/<host>:<port> with one of the protocols "
            f"{', '.join(_IP_PROTOCOLS)} and a port from 1 to 65535, for example tcp/127.0.0.1:7447."
        )


#: Threads that are opening or closing a session, as far as they have not been forgotten.
_threads: weakref.WeakSet[threading.Thread] = weakref.WeakSet()


@atexit.register
def _let_threads_end() -> None:
    """Wait a little for what still goes on in Zenoh: a thread that returns into an ending interpreter aborts the process."""
    for thread in list(_threads):
        thread.join(CLOSE_LIMIT)


def receive_in_one_thread() -> None:
    """Have Zenoh receive in one thread in this process; without that each message wakes two. Before the first session.

    Who has said otherwise in the environment is heeded.
    """
    os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 1))")


async def open_session(settings: dict[str, Any]) -> zenoh.Session:
    """Open a session without blocking the loop; cancelled, it is closed again as soon as it is open.

    Raises:
        zenoh.ZError: if it cannot be opened; its text is not for people.
    """
    config = zenoh.Config.from_json5(json.dumps(settings))
    return await in_thread(lambda: zenoh.open(config), unwanted=zenoh.Session.close)


async def in_thread(work: Callable[[], T], *, unwanted: Callable[[T], object] | None = None) -> T:
    """Run `work` in a daemon thread and wait for it; if the waiting is cancelled, `unwanted` gets what comes of it."""
    done: Future[T] = Future()

    def run() -> None:
        try:
            outcome = work()
        except BaseException as error:  # raised again where it is awaited
            done.set_exception(error)
        else:
            done.set_result(outcome)

    def let_go(finished: Future[T]) -> None:
        if unwanted is not None and finished.exception() is None:
            unwanted(finished.result())

    thread = threading.Thread(target=run, name="zenoh-session", daemon=True)
    _threads.add(thread)
    thread.start()
    try:
        return await asyncio.shield(asyncio.wrap_future(done))
    except asyncio.CancelledError:
        done.add_done_callback(let_go)
        raise


async def close_session(session: zenoh.Session) -> None:
    """Close a session without blocking the loop, waiting for it at most `CLOSE_LIMIT`; cancelled, it closes all the same."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(CLOSE_LIMIT):
            await in_thread(session.close)


def close_when_forgotten(owner: object, session: zenoh.Session) -> None:
    """Have the session closed with its owner's end or the interpreter's, should nobody close it before."""
    weakref.finalize(owner, _close_at_once, session)


def _close_at_once(session: zenoh.Session) -> None:
    if session.is_closed():
        return
    closing = threading.Thread(target=session.close, name="zenoh-session", daemon=True)
    closing.start()
    closing.join(CLOSE_LIMIT)
