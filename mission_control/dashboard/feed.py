"""Where the sightings come from: a running mission's bus, or a recording."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterable, Sequence

from lalliance_agents.bus.base import Bus
from lalliance_agents.clock import MissionClock
from mission_control.dashboard.chronicle import Chronicle
from mission_control.watch.gaps import Gap
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import Sighting

#: How often the chronicle is brought up to date, in real seconds; of a recording, in mission seconds.
SETTLE_PERIOD = 0.2
#: Sightings of a recording that are taken before others have their turn.
AT_ONCE = 100
#: A mission that runs is heard more often than this, in real seconds.
SILENCE = 5.0


class LiveFeed:
    """Hands what happens on a bus to a chronicle.

    Args:
        bus: an open bus.
        mission: the mission's name.
        chronicle: takes the sightings.
        speed: mission seconds per real second.
    """

    def __init__(self, bus: Bus, mission: str, chronicle: Chronicle, *, speed: float) -> None:
        self._chronicle = chronicle
        self._speed = speed
        self._clock = MissionClock(speed)
        self._onlooker = Onlooker(bus, mission, self._clock, motivations=True, notice=chronicle.miss)

    @property
    def now(self) -> float:
        """The present instant on the clock of the sightings, in seconds."""
        return self._clock.now()

    @property
    def missed(self) -> int:
        """Messages that could not be taken."""
        return self._onlooker.dropped

    def trouble(self) -> str:
        """What is wrong, in a sentence; empty if the mission is heard or is over."""
        heard, status = self._chronicle.heard_at, self._chronicle.story.status
        if status is not None and status.mission in {"complete", "failed"}:
            return ""
        if heard is None:
            return "nothing has been heard of the mission"
        silence = (self.now - heard) / self._speed
        return "" if silence < SILENCE else f"nothing has been heard of the mission for {silence:.0f} s"

    @contextlib.asynccontextmanager
    async def followed(self) -> AsyncIterator[None]:
        """Follow the mission for as long as the context lasts."""
        async with self._onlooker:
            work = [asyncio.create_task(self._take()), asyncio.create_task(self._settle())]
            try:
                yield
            finally:
                for part in work:
                    part.cancel()
                await asyncio.gather(*work, return_exceptions=True)

    async def _take(self) -> None:
        async for sighting in self._onlooker:
            self._chronicle.take(sighting)

    async def _settle(self) -> None:
        while True:
            await asyncio.sleep(SETTLE_PERIOD)
            self._chronicle.settle()


async def retell(sightings: Iterable[Sighting], chronicle: Chronicle, gaps: Sequence[Gap] = ()) -> None:
    """Hand a whole recording to a chronicle; others have their turn meanwhile.

    Args:
        sightings: what was seen.
        chronicle: takes it.
        gaps: times in which nothing could be heard; grows while the sightings are read, each once its end was.
    """
    due = None
    missed = 0
    for count, sighting in enumerate(sightings, 1):
        if due is None or sighting.now >= due:
            chronicle.settle()
            due = sighting.now + SETTLE_PERIOD
        chronicle.take(sighting)
        missed = _miss(gaps, missed, chronicle)
        if count % AT_ONCE == 0:
            await asyncio.sleep(0)
    _miss(gaps, missed, chronicle)
    chronicle.settle()


def _miss(gaps: Sequence[Gap], missed: int, chronicle: Chronicle) -> int:
    """Tell of the gaps that are not told of yet; how many there are."""
    for gap in gaps[missed:]:
        chronicle.miss(gap)
    return len(gaps)
