"""One connection for several participants of one process.

Each of them uses it as a bus of its own; what several of them want of it is asked of the inner bus once. Subscriptions to the
same pattern are one subscription there, whose samples go to every handler, in the order in which these came; queries of the
same pattern that are under way at the same time are one query. All else is handed on as it is. So a participant costs a
message no more than the call of its handler, however many there are beside it.

To find among thousands of subscriptions those that a message is for takes the inner bus long. Where nearly all that comes is
for somebody here, `widen` has many subscriptions served by one, whose messages are handed out here, by a table.

Who is told of a sample does not change by that, nor when. Whoever made it closes it; the participants do not.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from functools import partial
from itertools import product
from typing import NamedTuple

from lalliance_agents.bus.base import (
    Bus,
    Handler,
    LazyHandler,
    Registration,
    Sample,
)
from lalliance_agents.bus.inbox import Inlet
from lalliance_agents.bus.patterns import check_pattern
from lalliance_agents.bus.wrapped import WrappedBus

#: Keys of which it is remembered whom they are for; whoever makes up keys fills no more than this.
MOST_KEYS = 2**14


#: A sample, and when it came, in seconds of the event loop's clock; 0 if nobody asks for that.
_Arrival = tuple[Sample, float]
_Deliver = Callable[[_Arrival], None]
_Subscriber = Callable[[_Deliver], Awaitable[Registration]]


class _Want(NamedTuple):
    """What is subscribed to, and how."""

    pattern: str
    lazy: bool

    def subscriber(self, bus: Bus) -> "_Subscriber":
        """What subscribes to it on `bus`."""

        async def subscribe(deliver: _Deliver) -> Registration:
            if self.lazy:
                return await bus.subscribe_lazily(self.pattern, lambda sample, came: deliver((sample, came)))
            return await bus.subscribe(self.pattern, lambda sample: deliver((sample, 0.0)))

        return subscribe


class SharedBus(WrappedBus):
    """A bus for several participants; closing it closes the inner one.

    Args:
        inner: the bus that does the work.
    """

    def __init__(self, inner: Bus) -> None:
        super().__init__(inner)
        self._channels: dict[_Want, _Channel] = {}
        self._wide: list[_Wide] = []
        self._questions: dict[tuple[str, bytes, float], asyncio.Task[list[Sample]]] = {}

    def __repr__(self) -> str:
        return f"<shared bus: {len(self._channels)} patterns, over {self._inner!r}>"

    def widen(self, patterns: Iterable[str], *, lazy: bool = False) -> None:
        """From now on, have subscriptions, or lazy ones, to what `patterns` match served by one for each of these."""
        self._wide += [_Wide(_Want(pattern, lazy), self._inner) for pattern in patterns]

    async def subscribe(self, pattern: str, handler: Handler) -> Registration:
        """Have `handler` called with each sample whose key matches `pattern`, from about now on."""
        inlet: Inlet[_Arrival] = Inlet(f"the subscription {pattern!r}", lambda arrival: handler(arrival[0]))
        return await self._share(pattern, inlet)

    async def subscribe_lazily(self, pattern: str, handler: LazyHandler) -> Registration:
        """The same without waking the loop: `handler` is called at the next `collect` of anybody, or before that."""
        inlet: Inlet[_Arrival] = Inlet(
            f"the lazy subscription {pattern!r}", lambda arrival: handler(*arrival), lazy=True
        )
        return await self._share(pattern, inlet)

    async def _share(self, pattern: str, inlet: Inlet[_Arrival]) -> Registration:
        check_pattern(pattern)
        want = _Want(pattern, inlet.lazy)
        channel = self._channels.get(want)
        if channel is None:
            channel = self._channels[want] = _Channel(want, self._channels)
        channel.inlets.append(inlet)
        try:
            wide = next((wide for wide in self._wide if wide.covers(want)), None)
            await channel.open(want.subscriber(self._inner) if wide is None else wide.subscriber(want))
        except BaseException:
            await channel.leave(inlet)
            raise
        return _Share(inlet, channel)

    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - see Bus.query
        """Ask whoever answers `pattern`; all answers that came within `timeout` seconds, possibly none."""
        question = pattern, payload, timeout
        asking = self._questions.get(question)
        if asking is None:
            asking = asyncio.create_task(self._inner.query(pattern, payload, timeout=timeout), name=f"query {pattern}")
            self._questions[question] = asking
            asking.add_done_callback(lambda _: self._questions.pop(question))
        return list(await asyncio.shield(asking))

    async def close(self) -> None:
        """Close the inner bus; a second call does nothing."""
        for channel in self._channels.values():
            channel.silence()
        self._channels.clear()
        self._wide.clear()
        await self._inner.close()
        await asyncio.gather(*self._questions.values(), return_exceptions=True)


class _Channel:
    """One subscription of the inner bus, and those who share it; it is in `place` while there are any."""

    def __init__(self, want: _Want, place: "dict[_Want, _Channel]") -> None:
        self.inlets: list[Inlet[_Arrival]] = []
        self._want = want
        self._place = place
        self._opening = asyncio.Lock()
        self._registration: Registration | None = None

    async def open(self, subscribe: _Subscriber) -> None:
        """Subscribe, unless that was done before."""
        async with self._opening:
            if self._registration is None:
                self._registration = await subscribe(self._deliver)

    def _deliver(self, arrival: _Arrival) -> None:
        for inlet in tuple(self.inlets):
            inlet.deliver(arrival)

    async def leave(self, inlet: Inlet[_Arrival]) -> None:
        """Deliver nothing more to `inlet`; the subscription ends with the last of them."""
        inlet.is_open = False
        self.inlets.remove(inlet)
        if not self.inlets and self._place.get(self._want) is self:
            del self._place[self._want]
            async with self._opening:
                if self._registration is not None:
                    await self._registration.close()

    def silence(self) -> None:
        """Deliver nothing more to anybody."""
        for inlet in self.inlets:
            inlet.is_open = False


class _Share:
    """One participant's part in a channel."""

    def __init__(self, inlet: Inlet[_Arrival], channel: _Channel) -> None:
        self._inlet = inlet
        self._channel = channel

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        if self._inlet.is_open:
            await self._channel.leave(self._inlet)


class _Wide:
    """One subscription of the inner bus that serves all those to narrower patterns, for as long as there are any."""

    def __init__(self, want: _Want, bus: Bus) -> None:
        self._want = want
        self._subscribe = want.subscriber(bus)
        self._handlers: dict[str, _Deliver] = {}
        self._routes: dict[str, list[_Deliver]] = {}
        self._opening = asyncio.Lock()
        self._registration: Registration | None = None

    def covers(self, want: _Want) -> bool:
        """Whether all that is wanted comes here, and in the same way."""
        own, asked = self._want.pattern.split("/"), want.pattern.split("/")
        return (
            self._want.lazy == want.lazy
            and len(own) == len(asked)
            and all(
                wide == narrow or (wide == "*" and narrow != "**" and not narrow.startswith("@"))
                for wide, narrow in zip(own, asked, strict=True)
            )
        )

    def subscriber(self, want: _Want) -> _Subscriber:
        """What subscribes here to `want`, which is covered, and to which nobody else here subscribes."""
        return partial(self._enter, want.pattern)

    async def _enter(self, pattern: str, deliver: _Deliver) -> Registration:
        self._handlers[pattern] = deliver
        self._routes.clear()
        async with self._opening:
            if self._registration is None:
                self._registration = await self._subscribe(self._deliver)
        return _Narrow(self, pattern)

    async def leave(self, pattern: str) -> None:
        """Let go of the handler of `pattern`."""
        if self._handlers.pop(pattern, None) is None:
            return
        self._routes.clear()
        async with self._opening:
            if not self._handlers and self._registration is not None:
                registration, self._registration = self._registration, None
                await registration.close()

    def _deliver(self, arrival: _Arrival) -> None:
        key = arrival[0].key
        route = self._routes.get(key)
        if route is None:
            if len(self._routes) >= MOST_KEYS:
                self._routes.clear()
            route = self._routes[key] = self._find(key)
        for deliver in route:
            deliver(arrival)

    def _find(self, key: str) -> list[_Deliver]:
        """Those whose pattern matches `key`: each chunk of it is named there, or is a `*`."""
        chunks = [(chunk,) if chunk.startswith("@") else (chunk, "*") for chunk in key.split("/")]
        patterns = map("/".join, product(*chunks))
        return [self._handlers[pattern] for pattern in patterns if pattern in self._handlers]


class _Narrow:
    """One subscription that a wide one serves."""

    def __init__(self, wide: _Wide, pattern: str) -> None:
        self._wide = wide
        self._pattern = pattern

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        await self._wide.leave(self._pattern)
