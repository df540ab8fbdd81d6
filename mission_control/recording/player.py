"""Plays a recording onto a bus, as if the mission went on there: its messages, its presences, and answers to who comes late.

Everything is published in the recorded order at the recorded distances. A second participant listens on the same bus, and what
does not come back to it was lost on the way, which is counted; no more than a few hundred messages are on their way at a time,
so that no receiver as quick as that one is flooded. All is published with one urgency, since others would overtake.
"""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from lalliance_agents.bus.base import Answer, Bus, Delivery, Registration
from lalliance_agents.bus.patterns import check_key
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import UserError
from lalliance_agents.wire.keys import Keys, Kind
from lalliance_agents.wire.messages import MAX_PAYLOAD
from mission_control.recording.arrivals import Arrivals
from mission_control.recording.pace import Pace
from mission_control.recording.reader import Recording
from mission_control.recording.retained import LAST_VALUES, REMEMBERED, Retained
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import PRESENCES, Sighting

#: Messages that may be on their way at a time.
WINDOW = 256
#: What has not arrived after so long is lost, in real seconds.
PATIENCE = 5.0
#: How long to listen whether the mission is live on a bus that others use, in real seconds.
LISTENING = 1.0
_NANOSECONDS = 1_000_000_000


@dataclass(slots=True)
class Played:
    """What became of the messages in a recording; together they are all of it."""

    before: int = 0
    """Those before the start."""
    published: int = 0
    """Messages that were published."""
    presences: int = 0
    """Comings and goings that were shown."""
    refused: int = 0
    """Messages that cannot be published, because their key or size is none that is published."""
    arrived: int = 0
    """Published messages that were seen to arrive."""
    lost: int = 0
    """Published messages that were not."""

    @property
    def all(self) -> int:
        """Everything that was in the recording."""
        return self.before + self.published + self.presences + self.refused


async def check_quiet(bus: Bus, mission: str, where: str) -> None:
    """Make sure that nobody is in this mission on the bus.

    Raises:
        UserError: somebody is.
    """
    onlooker = Onlooker(bus, mission, MissionClock(), motivations=True)
    async with onlooker:
        try:
            async with asyncio.timeout(LISTENING):
                one = await anext(aiter(onlooker))
        except TimeoutError:
            return
    raise UserError(
        f"mission {mission} is live on the bus at {where}, where something was seen on {one.key[:100]!r}; expected a bus on "
        "which nobody is in this mission"
    )


class Player:
    """Plays a recording.

    Args:
        recording: the recording.
        bus: where to play it; not closed by the player.
        witness: another participant's connection to the same bus; not closed either.
        pace: when to publish what.
        start: where to begin, in seconds after the first message.

    Attributes:
        played: what has become of its messages so far.
    """

    def __init__(self, recording: Recording, bus: Bus, witness: Bus, pace: Pace, *, start: float = 0.0) -> None:
        self.played = Played()
        self._recording = recording
        self._bus = bus
        self._pace = pace
        self._start = start
        self._keys = Keys(recording.about.mission)
        self._retained = Retained(recording.about.mission)
        self._witness = Onlooker(witness, recording.about.mission, MissionClock(), motivations=True, asks=False)
        self._arrivals = Arrivals()
        self._arrival = asyncio.Event()
        self._announced: dict[str, Registration] = {}
        self._present_before: dict[str, None] = {}
        self._present_there: set[str] = set()
        self._presences = tuple(self._keys.build(kind, robot="") for kind in PRESENCES)
        self._answering: list[Registration] = []

    async def play(self) -> Played:
        """Play it to its end; what has become of all that is in it."""
        async with self._witness:
            watching = asyncio.create_task(self._watch())
            try:
                for kind in sorted(LAST_VALUES | REMEMBERED):
                    self._answering.append(await self._bus.answer(self._keys.build(kind), self._answer(kind)))
                await self._play()
                await self._settle()
            finally:
                watching.cancel()
                for registration in [*self._announced.values(), *self._answering]:
                    await registration.close()
                self.played.arrived, self.played.lost = self._arrivals.arrived, self._arrivals.lost
        return self.played

    async def _play(self) -> None:
        started = False
        for at, sighting in self._timed():
            if at < self._start:
                self._pass_over(sighting)
                continue
            if not started:
                started = True
                for key in self._present_before:
                    await self._come(key)
            await self._pace.wait_until(at - self._start)
            await self._show(sighting)

    def _timed(self) -> Iterator[tuple[float, Sighting]]:
        """Everything, each with its time since the first message, in seconds; a clock that was set back stands still."""
        first = last = 0
        for sighting in self._recording:
            first = first or sighting.seen_at
            last = max(sighting.seen_at, last)
            yield (last - first) / _NANOSECONDS, sighting

    def _pass_over(self, sighting: Sighting) -> None:
        """Something from before the start, of which only what still holds then is shown."""
        self.played.before += 1
        self._retained.take(sighting)
        if self._is_presence(sighting):
            self._present_before[sighting.key] = None
            if sighting.gone:
                del self._present_before[sighting.key]

    async def _show(self, sighting: Sighting) -> None:
        if self._is_presence(sighting):
            self.played.presences += 1
            self._retained.take(sighting)
            await self._settle()
            await (self._go if sighting.gone else self._come)(sighting.key)
        elif not self._is_publishable(sighting):
            self.played.refused += 1
        else:
            self.played.published += 1
            self._retained.take(sighting)
            self._arrivals.published(sighting.key, sighting.payload)
            self._bus.put(sighting.key, sighting.payload, Delivery.STATE)
            if len(self._arrivals) >= WINDOW:
                await self._until(lambda: len(self._arrivals) < WINDOW // 2)

    async def _come(self, key: str) -> None:
        if key not in self._announced:
            self._announced[key] = await self._bus.announce_presence(key)
            await self._until(lambda: key in self._present_there)

    async def _go(self, key: str) -> None:
        if key in self._announced:
            await self._announced.pop(key).close()
            await self._until(lambda: key not in self._present_there)

    async def _settle(self) -> None:
        """Wait until all has arrived, or will not."""
        await self._until(lambda: not len(self._arrivals))

    async def _until(self, condition: Callable[[], bool]) -> None:
        """Wait until it is so; what has not arrived when nothing has for a while is lost."""
        while not condition():
            self._arrival.clear()
            try:
                async with asyncio.timeout(PATIENCE):
                    await self._arrival.wait()
            except TimeoutError:
                self._arrivals.give_up()
                return

    async def _watch(self) -> None:
        async for sighting in self._witness:
            if not self._is_presence(sighting):
                self._arrivals.seen(sighting)
            elif sighting.gone:
                self._present_there.discard(sighting.key)
            else:
                self._present_there.add(sighting.key)
            self._arrival.set()

    def _answer(self, kind: Kind) -> Answer:
        return lambda ask: self._retained.answers(kind, ask.key)

    def _is_presence(self, sighting: Sighting) -> bool:
        return not sighting.payload and sighting.key.startswith(self._presences)

    def _is_publishable(self, sighting: Sighting) -> bool:
        try:
            check_key(sighting.key)
        except ValueError:
            return False
        is_message = sighting.key.startswith(self._keys.prefix) and not sighting.key.startswith(self._presences)
        return is_message and len(sighting.payload) <= MAX_PAYLOAD
