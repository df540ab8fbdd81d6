"""The real bus: one Zenoh session, as a client of one router.

Zenoh calls back in its own threads; those calls do nothing but check a size and push into the bus's one inbox, and the
application's handlers run from there in the event loop. The callbacks are "direct" (`indirect=False`): they need no
thread per declaration, which would lose the order between subscriptions and keep a forgotten session from letting the
interpreter exit. They come from few threads, which stay known to Python (`threads`). When the router is gone the session
reconnects and declares everything again by itself; watchers of presence see everybody leave and come back. A router that
has been silent for two seconds counts as gone.

A bus that is never closed is closed by the interpreter's exit, or when it is garbage collected.
"""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import zenoh

from lalliance_agents.bus.base import Answer, ConnectionHandler, Delivery, Handler, PresenceHandler, Sample
from lalliance_agents.bus.credentials import Credentials, check_fits
from lalliance_agents.bus.inbox import Inbox, Inlet, Inquiry, QueuedBus, answers, check_timeout
from lalliance_agents.bus.patterns import check_key, check_pattern
from lalliance_agents.bus.session import (
    check_endpoint,
    client_settings,
    close_session,
    close_when_forgotten,
    open_session,
)
from lalliance_agents.bus.threads import stay_known, this_thread
from lalliance_agents.errors import BusError

Raw = TypeVar("Raw")

#: Keys that are declared when they are published on; beyond it each message finds its own way.
MOST_PUBLISHERS = 2**13


@dataclass(frozen=True, slots=True)
class _Quality:
    priority: zenoh.Priority
    reliability: zenoh.Reliability


#: DROP is the only congestion control: BLOCK stalls a publisher for seconds and still loses everything in an outage.
_QUALITY = {
    Delivery.PRESENCE: _Quality(zenoh.Priority.INTERACTIVE_HIGH, zenoh.Reliability.BEST_EFFORT),
    Delivery.STATE: _Quality(zenoh.Priority.DATA, zenoh.Reliability.RELIABLE),
    Delivery.TELEMETRY: _Quality(zenoh.Priority.BACKGROUND, zenoh.Reliability.BEST_EFFORT),
}


class _Entity(Protocol):
    """Whatever Zenoh lets be undeclared."""

    def undeclare(self) -> None: ...


async def open_bus(
    endpoint: str,
    *,
    timeout: float = 5.0,  # noqa: ASYNC109 - the bus's own limit, not a cancellation
    credentials: Credentials | None = None,
) -> "ZenohBus":
    """Connect to the router at `endpoint`, for example `tcp/127.0.0.1:7447`, within `timeout` seconds.

    Args:
        endpoint: where the router listens.
        timeout: how long to try, in seconds.
        credentials: what to show a router that asks who is there; None: there is nothing to show.

    Raises:
        BusError: if `endpoint` is not an endpoint, or no router answers there in time.
        KeysError: if it asks for credentials and there are none, or the other way round.
    """
    check_endpoint(endpoint)
    check_fits(endpoint, credentials)
    check_timeout(timeout)
    try:
        async with asyncio.timeout(timeout + 0.5):  # Zenoh keeps the limit itself, but for what it does not foresee
            session = await open_session(client_settings(endpoint, timeout, credentials))
    except (zenoh.ZError, TimeoutError) as error:
        raise BusError(
            f"No router could be reached at {endpoint} within {timeout:g} s: check that a router is running there, that "
            f"host, port and protocol are right, that no firewall is in between, and {_of_keys(credentials)}."
        ) from error
    return ZenohBus(session, endpoint)


def _of_keys(credentials: Credentials | None) -> str:
    if credentials is None:
        return "that it asks for no keys"
    return (
        f"that the keys in {credentials.folder} come from the same `lalliance keys init` as the router's, which must have "
        "been told the router's host name"
    )


class ZenohBus(QueuedBus):
    """One participant's connection; made by `open_bus`.

    Attributes:
        endpoint: the router's.
    """

    def __init__(self, session: zenoh.Session, endpoint: str) -> None:
        self.endpoint = endpoint
        self._session = session
        self._loop = asyncio.get_running_loop()
        self._inbox = Inbox(self._loop.call_soon_threadsafe, self._loop)
        # Zenoh forgets most declarations with their last reference.
        self._declared: set[_Declared] = set()
        self._inquiries: set[Inquiry] = set()
        # A publisher knows where its messages go, and whether anywhere at all; a bare `put` looks that up each time.
        self._publishers: dict[tuple[str, Delivery], zenoh.Publisher] = {}
        self._closed = False
        close_when_forgotten(self, session)

    def __repr__(self) -> str:
        return f"<zenoh bus at {self.endpoint}, {'closed' if self._closed else 'open'}>"

    def put(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Publish without waiting; lost silently while the bus is down, silently ignored once closed."""
        if self._closed:
            check_key(key)
            return
        publisher = self._publishers.get((key, delivery))
        if publisher is None:
            check_key(key)
            priority = _QUALITY[delivery].priority
            if len(self._publishers) >= MOST_PUBLISHERS:
                self._session.put(key, payload, congestion_control=zenoh.CongestionControl.DROP, priority=priority)
                return
            publisher = self._session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.DROP, priority=priority
            )
            self._publishers[key, delivery] = publisher
        publisher.put(payload)

    async def publication(self, key: str, delivery: Delivery) -> "ZenohPublication":
        """Declare a key that will be published on often."""
        check_key(key)
        self._check_open()
        quality = _QUALITY[delivery]
        publisher = self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=quality.priority,
            reliability=quality.reliability,
        )
        return ZenohPublication(publisher, self._declared)

    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> "_Declared":
        """Have `handler` called with each sample whose key matches `pattern`, from about now on."""
        expression = self._expression(pattern)

        def hear(raw: zenoh.Sample, came: float = 0.0) -> None:
            handler(Sample(str(raw.key_expr), raw.payload.to_bytes(), came))

        accept: Callable[[Any], None] = (lambda stamped: hear(*stamped)) if lazy else hear
        inlet: Inlet[Any] = Inlet(f"the subscription {pattern!r}", accept, lazy=lazy)
        return self._declare(inlet, self._session.declare_subscriber(expression, self._listener(inlet)))

    async def answer(self, pattern: str, handler: Answer) -> "_Declared":
        """Answer queries that match `pattern` with the samples that `handler` returns."""
        expression = self._expression(pattern)
        inlet: Inlet[zenoh.Query] = Inlet(
            f"the answerer {pattern!r}", lambda query: _reply(query, handler), discard=zenoh.Query.drop
        )
        return self._declare(inlet, self._session.declare_queryable(expression, self._listener(inlet)))

    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - the bus's own limit, not a cancellation
        """Ask whoever answers `pattern`; all answers that came within `timeout` seconds, possibly none."""
        check_pattern(pattern)
        check_timeout(timeout)
        if self._closed:
            return []
        inquiry = Inquiry()
        self._inquiries.add(inquiry)
        try:
            self._session.get(
                zenoh.KeyExpr.autocanonize(pattern),
                zenoh.handlers.Callback(self._gather(inquiry), self._finish(inquiry), indirect=False),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=timeout,
                congestion_control=zenoh.CongestionControl.DROP,
                payload=payload,
            )
            return await inquiry.result(timeout)
        finally:
            self._inquiries.discard(inquiry)

    async def announce_presence(self, key: str) -> "_Declared":
        """Be present as `key` until closed or gone, however abruptly."""
        check_key(key)
        self._check_open()
        return self._declare(None, self._session.liveliness().declare_token(key))

    async def watch_presence(self, pattern: str, handler: PresenceHandler) -> "_Declared":
        """Have `handler` called with (key, True) for each presence there is or comes, and (key, False) when it is gone."""
        expression = self._expression(pattern)
        present: set[str] = set()

        def note(raw: zenoh.Sample) -> None:
            key, comes = str(raw.key_expr), raw.kind == zenoh.SampleKind.PUT
            if comes != (key in present):  # two announcements of one key are one presence
                (present.add if comes else present.discard)(key)
                handler(key, comes)

        inlet = Inlet(f"the watch on {pattern!r}", note, keep=True)
        watch = self._session.liveliness().declare_subscriber(expression, self._listener(inlet), history=True)
        return self._declare(inlet, watch)

    async def watch_connection(self, handler: ConnectionHandler) -> "_Declared":
        """Have `handler` called with whether the router is reached: now if it is, and whenever that changes."""
        self._check_open()
        inlet: Inlet[zenoh.TransportEvent] = Inlet(
            "the watch on the connection", lambda raw: handler(raw.kind == zenoh.SampleKind.PUT), keep=True
        )
        inbox = self._inbox

        def listen(raw: zenoh.TransportEvent) -> None:
            if not this_thread.known:
                stay_known()
            inbox.push(inlet, raw)

        listener = zenoh.handlers.Callback(listen, indirect=False)
        return self._declare(inlet, self._session.info.declare_transport_events_listener(listener, history=True))

    async def close(self) -> None:
        """Leave the bus; a second call does nothing. Cancelled, the bus still closes."""
        if self._closed:
            return
        self._closed = True
        for declared in list(self._declared):
            declared.let_go()
        self._inbox.close()
        for inquiry in self._inquiries:
            inquiry.finish()
        await close_session(self._session)
        self._publishers.clear()

    def _expression(self, pattern: str) -> zenoh.KeyExpr:
        check_pattern(pattern)
        self._check_open()
        return zenoh.KeyExpr.autocanonize(pattern)

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the bus is closed: nothing can be declared on it any more")

    def _declare(self, inlet: Inlet[Any] | None, entity: _Entity) -> "_Declared":
        return _Declared(entity, inlet, self._declared)

    def _listener(self, inlet: Inlet[Any]) -> "zenoh.handlers.Callback[Any]":
        """What Zenoh calls, in its own threads, with each message for `inlet`; a lazy one gets it with when it came."""
        inbox, lazy, time = self._inbox, inlet.lazy, self._loop.time

        def listen(raw: zenoh.Sample | zenoh.Query) -> None:
            if not this_thread.known:
                stay_known()
            payload = raw.payload
            if payload is None or inbox.admits(len(payload)):
                inbox.push(inlet, (raw, time()) if lazy else raw)
            else:
                inlet.discard(raw)

        return zenoh.handlers.Callback(listen, indirect=False)

    def _gather(self, inquiry: Inquiry) -> Callable[[zenoh.Reply], None]:
        """What Zenoh calls, in its own threads, with each reply."""
        inbox = self._inbox

        def gather(reply: zenoh.Reply) -> None:
            if not this_thread.known:
                stay_known()
            raw = reply.ok
            if raw is not None and inbox.admits(len(raw.payload)):
                inquiry.replies.append(Sample(str(raw.key_expr), raw.payload.to_bytes()))

        return gather

    def _finish(self, inquiry: Inquiry) -> Callable[[], None]:
        """What Zenoh calls, in one of its own threads, after the last reply."""
        loop = self._loop

        def finish() -> None:
            with contextlib.suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(inquiry.finish)

        return finish


class _Declared:
    """Something declared on a session, kept in `place` until it is taken back."""

    def __init__(self, entity: _Entity, inlet: Inlet[Any] | None, place: "set[_Declared]") -> None:
        self._entity = entity
        self._inlet = inlet
        self._place = place
        place.add(self)

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        if self in self._place:
            self.let_go()
            with contextlib.suppress(zenoh.ZError):  # the session has closed meanwhile
                self._entity.undeclare()

    def let_go(self) -> None:
        """Deliver nothing more."""
        self._place.discard(self)
        if self._inlet is not None:
            self._inlet.is_open = False


class ZenohPublication(_Declared):
    """The right to publish on one key of a `ZenohBus`."""

    def __init__(self, publisher: zenoh.Publisher, place: "set[_Declared]") -> None:
        super().__init__(publisher, None, place)
        self._publisher = publisher
        # To ask Zenoh each time would have it go through all subscriptions there are; it tells when that changes.
        self._matching = False
        self._listener = publisher.declare_matching_listener(zenoh.handlers.Callback(self._note, indirect=False))
        # Typed as a bool, but in fact a MatchingStatus, which is always true.
        status: Any = publisher.matching_status
        self._note(status)

    def _note(self, status: zenoh.MatchingStatus) -> None:
        """Called by Zenoh, in its own threads, when the first listener comes or the last one goes."""
        self._matching = status.matching

    def put(self, payload: bytes) -> None:
        """Publish without waiting; lost silently while the bus is down, silently ignored once closed."""
        if self in self._place:
            self._publisher.put(payload)

    @property
    def has_listeners(self) -> bool:
        """Whether somebody subscribes to this key just now, as far as is known; nobody does while the bus is down."""
        return self._matching and self in self._place


def _reply(query: zenoh.Query, handler: Answer) -> None:
    with query:  # leaving it tells the asker that no more will come
        payload = query.payload
        ask = Sample(str(query.key_expr), b"" if payload is None else payload.to_bytes())
        for sample in answers(handler, ask):
            query.reply(sample.key, sample.payload)
