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

from lalliance_agents.bus.base import (
    Bus,
    Handler,
    Registration,
    Sample,
)
from lalliance_agents.bus.inbox import Inlet
from lalliance_agents.bus.patterns import check_pattern
from lalliance_agents.bus.wrapped import WrappedBus

#: The pattern of a subscription, and whether it is lazy.
_Want = tuple[str, bool]

#: Keys of which it is remembered whom they are for; whoever makes up keys fills no more than this.
MOST_KEYS = 2**14


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
        self._wide += [_Wide(pattern, self._inner, lazy=lazy) for pattern in patterns]

    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> Registration:
        """Have `handler` called with each sample whose key matches `pattern`, from about now on."""
        check_pattern(pattern)
        inlet: Inlet[Sample] = Inlet(f"the subscription {pattern!r}", handler, lazy=lazy)
        channel = self._channels.get((pattern, lazy))
        if channel is None:
            channel = self._channels[pattern, lazy] = _Channel((pattern, lazy), self._channels)
        channel.inlets.append(inlet)
        try:
            wide = next((wide for wide in self._wide if wide.covers(pattern, lazy=lazy)), None)
            await channel.open(partial(self._inner.subscribe, lazy=lazy) if wide is None else wide.subscribe)
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
        self.inlets: list[Inlet[Sample]] = []
        self._want = want
        self._place = place
        self._opening = asyncio.Lock()
        self._registration: Registration | None = None

    async def open(self, subscribe: Callable[[str, Handler], Awaitable[Registration]]) -> None:
        """Subscribe, unless that was done before."""
        async with self._opening:
            if self._registration is None:
                self._registration = await subscribe(self._want[0], self._deliver)

    def _deliver(self, sample: Sample) -> None:
        for inlet in tuple(self.inlets):
            inlet.deliver(sample)

    async def leave(self, inlet: Inlet[Sample]) -> None:
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

    def __init__(self, inlet: Inlet[Sample], channel: _Channel) -> None:
        self._inlet = inlet
        self._channel = channel

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        if self._inlet.is_open:
            await self._channel.leave(self._inlet)


class _Wide:
    """One subscription of the inner bus that serves all those to narrower patterns, for as long as there are any."""

    def __init__(self, pattern: str, bus: Bus, *, lazy: bool) -> None:
        self._pattern = pattern
        self._bus = bus
        self._lazy = lazy
        self._handlers: dict[str, Handler] = {}
        self._routes: dict[str, list[Handler]] = {}
        self._opening = asyncio.Lock()
        self._registration: Registration | None = None

    def covers(self, pattern: str, *, lazy: bool) -> bool:
        """Whether all that `pattern` matches comes here, and in the same way."""
        own, asked = self._pattern.split("/"), pattern.split("/")
        return (
            lazy == self._lazy
            and len(own) == len(asked)
            and all(
                wide == narrow or (wide == "*" and narrow != "**" and not narrow.startswith("@"))
                for wide, narrow in zip(own, asked, strict=True)
            )
        )

    async def subscribe(self, pattern: str, handler: Handler) -> Registration:
        """Have `handler` called with each sample whose key matches `pattern`, to which nobody else here subscribes."""
        self._handlers[pattern] = handler
        self._routes.clear()
        async with self._opening:
            if self._registration is None:
                self._registration = await self._bus.subscribe(self._pattern, self._deliver, lazy=self._lazy)
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

    def _deliver(self, sample: Sample) -> None:
        route = self._routes.get(sample.key)
        if route is None:
            if len(self._routes) >= MOST_KEYS:
                self._routes.clear()
            route = self._routes[sample.key] = self._find(sample.key)
        for handler in route:
            handler(sample)

    def _find(self, key: str) -> list[Handler]:
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
