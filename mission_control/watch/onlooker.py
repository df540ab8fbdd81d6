"""Whoever looks on: listens to everything of a mission and hands it on, a sighting each.

It first asks for what there is already: last values, and what the world remembers of decisions and events. What has come
meanwhile follows after. What its reader does not fetch in time waits in a bounded queue; when that is full the oldest
message is dropped and counted, but never a presence, as one that was lost would stay wrong for ever. However much waits,
others in the event loop have their turn, above all who is to end it.
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from lalliance_agents.bus.base import LEASE, Bus, Registration, Sample
from lalliance_agents.bus.inbox import QueuedBus
from lalliance_agents.bus.patterns import intersects, matches
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.wire.keys import ROOT, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, DecisionMade, Event, decode_at
from mission_control.watch.sighting import PRESENCES, Sighting
from mission_control.watch.story import Story

#: Sightings that may wait to be fetched.
CAPACITY = 20_000
#: What they may hold altogether, in bytes.
HEAVIEST = 2**26
#: How long sightings are handed on before others have their turn, in real seconds.
TURN = 0.02
#: How long to wait at the start for answers about what there is already, in real seconds.
GREETING_TIMEOUT = 1.0
#: How long to wait for what is said again and again, in real seconds.
PATIENCE = LEASE
#: How long to wait for a mission that is being started, in real seconds.
STARTING = 15.0

#: What its owner, or the world, answers with when it is asked.
_LAST_VALUES = (Kind.CHAOS_RULES, Kind.HELLO, Kind.SENSE_ROBOT, Kind.SENSE_TASK)
_RETAINED = (*_LAST_VALUES, Kind.EVENT, Kind.DECISION)
#: Not matched by wildcards.
_HIDDEN = (Kind.CHAOS_RULES, Kind.CHAOS_DEED)
#: Nobody publishes these: commands are queries, and presences are watched.
_UNHEARD = {Kind.CHAOS_COMMAND, *PRESENCES}


class Onlooker:
    """Looks on, within its context; iterating over it gives sightings until it is closed.

    Args:
        bus: an open bus; the onlooker does not close it.
        mission: the mission's name.
        clock: gives the instants of what is seen.
        motivations: whether to listen to motivations too; robots publish them only while somebody does.
        capacity: sightings that may wait to be fetched.
        only: a pattern of keys: nothing else is looked at, and of what there was before only last values are asked for.
        asks: whether to ask for what there was before.

    Attributes:
        overflowed: messages dropped because too many waited to be fetched.
        misplaced: messages dropped because somebody published them on the key of a presence.
    """

    def __init__(
        self,
        bus: Bus,
        mission: str,
        clock: MissionClock,
        *,
        motivations: bool,
        capacity: int = CAPACITY,
        only: str | None = None,
        asks: bool = True,
    ) -> None:
        self.overflowed = self.misplaced = 0
        self._bus = bus
        self._mission = mission
        self._keys = Keys(mission)
        self._alive = self._keys.build(Kind.ALIVE, robot="")
        self._launcher = self._keys.build(Kind.LAUNCHER)
        self._clock = clock
        self._motivations = motivations
        self._only = only
        self._asks = asks
        self._capacity = capacity
        self._waiting: deque[Sighting] = deque()
        self._size = 0
        self._loop = asyncio.get_running_loop()
        self._turn_ends = self._loop.time()
        # Presences that reached the old end of a full queue: older than all that waits.
        self._rescued: deque[Sighting] = deque()
        self._news = asyncio.Event()
        self._registrations: list[Registration] = []
        self._closed = False

    def __repr__(self) -> str:
        return f"<Onlooker of {self._mission}: {len(self._waiting)} waiting, {self.dropped} dropped>"

    @property
    def dropped(self) -> int:
        """Messages that were dropped on their way here: too many at once, too large, or misplaced."""
        here = self.overflowed + self.misplaced
        if isinstance(self._bus, QueuedBus):
            return here + self._bus.dropped_overflow + self._bus.dropped_oversize
        return here

    @property
    def now(self) -> float:
        """The present instant on the onlooker's own clock, in seconds."""
        return self._clock.now()

    async def __aenter__(self) -> Self:
        """Listen, and ask for what there is already."""
        for pattern in self._patterns():
            self._registrations.append(await self._bus.subscribe(pattern, self._see))
        for kind in filter(self._is_wanted, sorted(PRESENCES)):
            self._registrations.append(await self._bus.watch_presence(self._keys.build(kind), self._meet))
        retained = () if not self._asks else _RETAINED if self._only is None else _LAST_VALUES
        asked = [
            self._bus.query(self._keys.build(kind), timeout=GREETING_TIMEOUT)
            for kind in filter(self._is_wanted, retained)
        ]
        answers = [sample for found in await asyncio.gather(*asked) for sample in found]
        early = list(self._waiting)
        self._waiting.clear()
        self._size = 0
        known = {(one.key, one.payload) for one in early}
        for sample in self._in_order(answers):
            if (sample.key, sample.payload) not in known and self._holds(sample.key):
                self._see(sample)
        for one in early:
            self._push(one)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Listen no more; who iterates gets what still waits, and then the end."""
        self._closed = True
        self._news.set()
        while self._registrations:
            await self._registrations.pop().close()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Sighting:
        if self._loop.time() >= self._turn_ends:
            await asyncio.sleep(0)
            self._turn_ends = self._loop.time() + TURN
        while True:
            if self._rescued:
                return self._rescued.popleft()
            if self._waiting:
                return self._fetch()
            if self._closed:
                raise StopAsyncIteration
            self._news.clear()
            await self._news.wait()
            self._turn_ends = self._loop.time() + TURN

    async def listen_to_motivations(self, robot: str = "*") -> Registration:
        """Have the motivations of `robot` among the sightings until the registration is closed, if they are not already."""
        return await self._bus.subscribe(self._keys.build(Kind.MOTIVATION, robot=robot), self._see)

    def _is_wanted(self, kind: Kind) -> bool:
        return self._only is None or intersects(self._only, self._keys.build(kind))

    def _holds(self, key: str) -> bool:
        return self._only is None or matches(self._only, key)

    def _patterns(self) -> list[str]:
        if self._only is not None:
            return [self._only]
        if self._motivations:
            return [f"{ROOT}/{self._mission}/**", *map(self._keys.build, _HIDDEN)]
        return [self._keys.build(kind) for kind in BODY_OF if kind not in _UNHEARD | {Kind.MOTIVATION}]

    def _in_order(self, answers: list[Sample]) -> list[Sample]:
        """Answers as they happened; those on one key as they were given, whatever clock stood still meanwhile."""
        latest: dict[str, tuple[int, float]] = {}
        placed = []
        for sample in answers:
            latest[sample.key] = max(self._when(sample), latest.get(sample.key, (0, 0.0)))
            placed.append((latest[sample.key], sample))
        return [sample for _, sample in sorted(placed, key=lambda one: one[0])]

    def _when(self, sample: Sample) -> tuple[int, float]:
        """What an answer is sorted by: last values first, then what happened, in its order."""
        try:
            message = decode_at(self._keys.parse(sample.key), sample.payload)
        except MessageError:
            return 0, 0.0
        return (message.trial, message.elapsed or 0.0) if isinstance(message, Event | DecisionMade) else (0, 0.0)

    def _see(self, sample: Sample) -> None:
        if self._is_presence(sample.key):
            self.misplaced += 1
        else:
            self._push(Sighting(time.time_ns(), self._clock.now(), sample.key, sample.payload))

    def _meet(self, key: str, present: bool) -> None:
        if self._holds(key):
            self._push(Sighting(time.time_ns(), self._clock.now(), key, b"", not present))

    def _push(self, sighting: Sighting) -> None:
        self._size += len(sighting.payload)
        while self._waiting and (len(self._waiting) >= self._capacity or self._size > HEAVIEST):
            oldest = self._fetch()
            if self._is_presence(oldest.key):
                self._rescued.append(oldest)
            else:
                self.overflowed += 1
        self._waiting.append(sighting)
        self._news.set()

    def _fetch(self) -> Sighting:
        oldest = self._waiting.popleft()
        self._size -= len(oldest.payload)
        return oldest

    def _is_presence(self, key: str) -> bool:
        return key.startswith(self._alive) or key == self._launcher


async def meet(onlooker: Onlooker, story: Story) -> None:
    """Have the story go on until the world has said how the mission stands, or nothing more is to be waited for.

    Raises:
        UserError: nobody is there.
    """
    await look(onlooker, story, lambda: story.status is not None)
    if story.status is None and story.has_launcher:  # who starts all others just now
        await look(onlooker, story, lambda: story.status is not None, patience=STARTING)
    if not story.robots:
        raise UserError(f"nobody of mission {story.mission} is on the bus; expected it to run there just now")


async def look(onlooker: Onlooker, story: Story, enough: Callable[[], bool], *, patience: float = PATIENCE) -> None:
    """Have the story go on until that is `enough`, or for as long as `patience` lasts, in real seconds."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(patience):
            while not enough():
                story.take(await anext(onlooker))
