"""A bus without a network: all participants live in one event loop and share a `MemoryHub`.

It behaves as the real bus does, so far as its interface promises: handlers are called later, never inside `put`; a
participant hears itself; floods and oversize payloads are dropped and counted on the receiving side. What it does not
have is distance: no message is delayed, lost on the way or reordered, and the hub goes down only where a test wants it to.
"""

import asyncio
from dataclasses import dataclass
from typing import Generic, TypeVar

from lalliance_agents.bus.base import Answer, ConnectionHandler, Delivery, Handler, PresenceHandler, Sample
from lalliance_agents.bus.inbox import Inbox, Inlet, Inquiry, QueuedBus, answers, check_timeout
from lalliance_agents.bus.patterns import check_key, check_pattern, intersects, matches

Raw = TypeVar("Raw")


class MemoryHub:
    """Where the participants of one in-memory bus meet; the router's place. All it holds is the participants' business."""

    def __init__(self) -> None:
        self._subscriptions: list[_Declared[Sample]] = []
        self._answerers: list[_Declared[_Ask]] = []
        self._watchers: list[_Declared[tuple[str, bool]]] = []
        self._presences: list[_Presence] = []
        self._connections: list[_Declared[bool]] = []
        self._is_up = True

    def __repr__(self) -> str:
        return f"<memory hub, {len(self._subscriptions)} subscriptions, {len(self._presences)} present>"

    def go_down(self) -> None:
        """Be away as a killed router is: nobody hears anybody."""
        if self._is_up:
            for key in dict.fromkeys(each.key for each in self._presences):
                self._tell(key, False)
            self._turn(False)

    def come_back(self) -> None:
        """Be there again as a router is that was started again: all that was declared holds."""
        if not self._is_up:
            self._turn(True)
            for key in dict.fromkeys(each.key for each in self._presences):
                self._tell(key, True)

    def _turn(self, is_up: bool) -> None:
        self._is_up = is_up
        for each in self._connections:
            each.owner._inbox.push(each.inlet, is_up)

    def _heard(self, key: str) -> bool:
        return self._is_up and any(matches(each.pattern, key) for each in self._subscriptions)

    def _is_present(self, key: str) -> bool:
        return any(each.key == key for each in self._presences)

    def _tell(self, key: str, present: bool) -> None:
        for each in self._watchers:
            if self._is_up and matches(each.pattern, key):
                each.owner._inbox.push(each.inlet, (key, present))

    def _forget(self, bus: "MemoryBus") -> None:
        declared: list[
            _Declared[Sample] | _Declared[_Ask] | _Declared[tuple[str, bool]] | _Declared[bool] | _Presence
        ] = []
        declared += [*self._subscriptions, *self._answerers, *self._watchers, *self._connections, *self._presences]
        for each in declared:
            if each.owner is bus:
                each.end()


class MemoryBus(QueuedBus):
    """One participant. Built inside the event loop in which its handlers shall run."""

    def __init__(self, hub: MemoryHub) -> None:
        self._hub = hub
        self._loop = asyncio.get_running_loop()
        self._inbox = Inbox(self._loop.call_soon)
        self._inquiries: list[Inquiry] = []
        self._closed = False

    def __repr__(self) -> str:
        return f"<memory bus, {'closed' if self._closed else 'open'}>"

    def put(self, key: str, payload: bytes, delivery: Delivery) -> None:  # noqa: ARG002 - all are equally urgent here
        """Publish without waiting; silently ignored once closed."""
        check_key(key)
        if self._closed or not self._hub._is_up:
            return
        now = self._loop.time()
        for each in self._hub._subscriptions:
            if matches(each.pattern, key) and each.owner._inbox.admits(len(payload)):
                each.owner._inbox.push(each.inlet, Sample(key, payload, now if each.inlet.lazy else 0.0))

    async def publication(self, key: str, delivery: Delivery) -> "MemoryPublication":
        """Declare a key that will be published on often."""
        check_key(key)
        self._check_open()
        return MemoryPublication(self, key, delivery)

    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> "_Declared[Sample]":
        """Have `handler` called with each sample whose key matches `pattern`, from now on."""
        self._check(pattern)
        inlet = Inlet(f"the subscription {pattern!r}", handler, lazy=lazy)
        return _Declared(self, pattern, inlet, self._hub._subscriptions)

    async def answer(self, pattern: str, handler: Answer) -> "_Declared[_Ask]":
        """Answer queries that match `pattern` with the samples that `handler` returns."""
        self._check(pattern)
        inlet: Inlet[_Ask] = Inlet(f"the answerer {pattern!r}", lambda ask: ask.reply(handler), discard=_Ask.end)
        return _Declared(self, pattern, inlet, self._hub._answerers)

    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - the bus's own limit, not a cancellation
        """Ask whoever answers `pattern`; all answers that came within `timeout` seconds, possibly none."""
        check_pattern(pattern)
        check_timeout(timeout)
        asked = [each for each in self._hub._answerers if intersects(each.pattern, pattern)]
        if self._closed or not self._hub._is_up or not asked:
            return []
        inquiry = Inquiry()
        question = _Question(self._inbox, inquiry, len(asked))
        for each in asked:
            ask = _Ask(Sample(pattern, payload), question)
            if each.owner._inbox.admits(len(payload)):
                each.owner._inbox.push(each.inlet, ask)
            else:
                ask.end()
        self._inquiries.append(inquiry)
        try:
            return await inquiry.result(timeout)
        finally:
            self._inquiries.remove(inquiry)

    async def announce_presence(self, key: str) -> "_Presence":
        """Be present as `key` until closed or gone, however abruptly."""
        check_key(key)
        self._check_open()
        return _Presence(self, key, self._hub)

    async def watch_presence(self, pattern: str, handler: PresenceHandler) -> "_Declared[tuple[str, bool]]":
        """Have `handler` called with (key, True) for each presence there is or comes, and (key, False) when it is gone."""
        self._check(pattern)
        inlet: Inlet[tuple[str, bool]] = Inlet(f"the watch on {pattern!r}", lambda news: handler(*news), keep=True)
        for key in dict.fromkeys(each.key for each in self._hub._presences):
            if self._hub._is_up and matches(pattern, key):
                self._inbox.push(inlet, (key, True))
        return _Declared(self, pattern, inlet, self._hub._watchers)

    async def watch_connection(self, handler: ConnectionHandler) -> "_Declared[bool]":
        """Have `handler` called with whether the hub is up: now if it is, and whenever that changes."""
        self._check_open()
        inlet: Inlet[bool] = Inlet("the watch on the connection", handler, keep=True)
        if self._hub._is_up:
            self._inbox.push(inlet, True)
        return _Declared(self, "**", inlet, self._hub._connections)

    async def close(self) -> None:
        """Leave the bus; a second call does nothing."""
        self.kill()
        for inquiry in self._inquiries:
            inquiry.finish()

    def kill(self) -> None:
        """End as a killed process does: gone for all others at once, while who waits here for replies is told nothing."""
        if not self._closed:
            self._closed = True
            self._inbox.close()
            self._hub._forget(self)

    def _check(self, pattern: str) -> None:
        check_pattern(pattern)
        self._check_open()

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the bus is closed: nothing can be declared on it any more")


class MemoryPublication:
    """The right to publish on one key of a `MemoryBus`."""

    def __init__(self, bus: MemoryBus, key: str, delivery: Delivery) -> None:
        self._bus = bus
        self._key = key
        self._delivery = delivery
        self._closed = False

    def put(self, payload: bytes) -> None:
        """Publish without waiting; silently ignored once closed."""
        if not self._closed:
            self._bus.put(self._key, payload, self._delivery)

    @property
    def has_listeners(self) -> bool:
        """Whether somebody subscribes to this key just now."""
        return not (self._closed or self._bus._closed) and self._bus._hub._heard(self._key)

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        self._closed = True


class _Declared(Generic[Raw]):
    """Something declared by `owner`, listed in its place of the hub until it ends."""

    def __init__(self, owner: MemoryBus, pattern: str, inlet: Inlet[Raw], place: "list[_Declared[Raw]]") -> None:
        self.owner = owner
        self.pattern = pattern
        self.inlet = inlet
        self._place = place
        place.append(self)

    def end(self) -> None:
        if self.inlet.is_open:
            self.inlet.is_open = False
            self._place.remove(self)

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        self.end()


class _Presence:
    """One announcement of `key`; the key is gone with the last of them."""

    def __init__(self, owner: MemoryBus, key: str, hub: MemoryHub) -> None:
        self.owner = owner
        self.key = key
        self._hub = hub
        known = hub._is_present(key)
        hub._presences.append(self)
        if not known:
            hub._tell(key, True)

    def end(self) -> None:
        if self in self._hub._presences:
            self._hub._presences.remove(self)
            if not self._hub._is_present(self.key):
                self._hub._tell(self.key, False)

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        self.end()


@dataclass(slots=True)
class _Question:
    """A query on its way: where the replies go and how many answerers have not finished."""

    asker: Inbox
    inquiry: Inquiry
    pending: int


@dataclass(slots=True)
class _Ask:
    """A query as one answerer receives it."""

    sample: Sample
    question: _Question

    def reply(self, handler: Answer) -> None:
        try:
            replies = answers(handler, self.sample)
            self.question.inquiry.replies += [each for each in replies if self.question.asker.admits(len(each.payload))]
        finally:
            self.end()

    def end(self) -> None:
        self.question.pending -= 1
        if self.question.pending == 0:
            self.question.inquiry.finish()
