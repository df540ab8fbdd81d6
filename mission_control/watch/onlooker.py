"""Whoever looks on: listens to everything of a mission and hands it on, a sighting each.

It first asks for what there is already: last values, and what the world remembers of decisions and events. What has come
meanwhile follows after. What its reader does not fetch in time waits in a bounded queue; when that is full the oldest
message is dropped and counted, but never a presence, as one that was lost would stay wrong for ever. However much waits,
others in the event loop have their turn, above all who is to end it.

When the bus was down and is back, or everybody was away, it asks again, until whoever remembers is back too and answers.
What it has handed on already it does not hand on again. What comes meanwhile waits, if that does not take long: then what
happened in the gap is still told in its order.
"""

import asyncio
import contextlib
import math
import time
from collections.abc import Callable, Collection
from types import TracebackType
from typing import Self

from lalliance_agents.bus.base import LEASE, Bus, Registration, Sample
from lalliance_agents.bus.inbox import QueuedBus
from lalliance_agents.bus.patterns import intersects, matches
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.wire.keys import ROOT, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, DecisionMade, Event, decode_at
from mission_control.watch.gaps import Gap, Gaps, Moment
from mission_control.watch.known import HISTORY, LAST_VALUES, Known
from mission_control.watch.sighting import PRESENCES, Sighting
from mission_control.watch.story import Story
from mission_control.watch.waiting import CAPACITY, Waiting

#: How long sightings are handed on before others have their turn, in real seconds.
TURN = 0.02
#: How long to wait for answers about what there is already, in real seconds.
GREETING_TIMEOUT = 1.0
#: Time between two questions while nobody answers, and how long what comes after a gap waits for answers, in real seconds.
AGAIN = 0.5
HOLD = LEASE
#: How long to wait for what is said again and again, in real seconds.
PATIENCE = LEASE
#: How long to wait for a mission that is being started, in real seconds.
STARTING = 15.0

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
        kinds: nothing else is looked at, whatever `motivations` says; the rules in force have to be among them, as the world is
            known by its answer.
        asks: whether to ask for what there was before, or was said in a gap.
        notice: called with each gap, once it is over and what could be recovered is among the sightings.

    Attributes:
        misplaced: messages dropped because somebody published them on the key of a presence.
    """

    def __init__(
        self,
        bus: Bus,
        mission: str,
        clock: MissionClock,
        *,
        motivations: bool = False,
        capacity: int = CAPACITY,
        only: str | None = None,
        kinds: Collection[Kind] | None = None,
        asks: bool = True,
        notice: Callable[[Gap], None] = lambda _: None,
    ) -> None:
        self.misplaced = 0
        self._bus = bus
        self._mission = mission
        self._keys = Keys(mission)
        self._alive = self._keys.build(Kind.ALIVE, robot="")
        self._launcher = self._keys.build(Kind.LAUNCHER)
        self._clock = clock
        self._motivations = motivations
        self._only = only
        self._kinds = kinds
        self._retained = () if not asks else LAST_VALUES if only is not None else (*LAST_VALUES, *HISTORY)
        self._notice = notice
        self._waiting = Waiting(capacity, self._is_presence)
        #: What has come while answers about the time before are awaited.
        self._held: Waiting | None = None
        self._hold_until = 0.0
        self._known = Known(self._keys)
        self._gaps = Gaps()
        self._unsettled: list[Gap] = []
        self._recovered = 0
        #: Whether anybody was ever there who answers, and whether the next answer is owed.
        self._is_answered = self._is_owed = False
        self._asking: asyncio.Task[None] | None = None
        self._loop = asyncio.get_running_loop()
        self._turn_ends = self._loop.time()
        self._news = asyncio.Event()
        self._registrations: list[Registration] = []
        self._closed = False

    def __repr__(self) -> str:
        return f"<Onlooker of {self._mission}: {len(self._waiting)} waiting, {self.dropped} dropped>"

    @property
    def overflowed(self) -> int:
        """Messages dropped because too many waited to be fetched."""
        return self._waiting.overflowed + (self._held.overflowed if self._held is not None else 0)

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

    @property
    def away_for(self) -> float | None:
        """How long the bus has been down, in real seconds; None if it is up."""
        lost = self._gaps.lost
        return None if lost is None else self._loop.time() - lost.real

    @property
    def quiet_for(self) -> float:
        """How long nothing was heard, whether it waits or was fetched, in real seconds; for ever if nothing ever was."""
        heard = self._gaps.heard
        return math.inf if heard is None else self._loop.time() - heard.real

    async def __aenter__(self) -> Self:
        """Listen, and ask for what there is already."""
        self._hold()
        for pattern in self._patterns():
            self._registrations.append(await self._bus.subscribe(pattern, self._see))
        for kind in filter(self._is_wanted, sorted(PRESENCES)):
            self._registrations.append(await self._bus.watch_presence(self._keys.build(kind), self._meet))
        self._registrations.append(await self._bus.watch_connection(self._connect))
        await self._ask()
        if self._asking is None:
            self._release()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Listen no more; who iterates gets what still waits, and then the end."""
        if self._asking is not None:
            self._asking.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._asking
        if (gap := self._gaps.comes_back(self._moment())) is not None:
            self._unsettled.append(gap)
        self._settle(answered=False)
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
            if (oldest := self._waiting.fetch()) is not None:
                return oldest
            if self._closed:
                raise StopAsyncIteration
            self._news.clear()
            await self._news.wait()
            self._turn_ends = self._loop.time() + TURN

    async def listen_to_motivations(self, robot: str = "*") -> Registration:
        """Have the motivations of `robot` among the sightings until the registration is closed, if they are not already."""
        return await self._bus.subscribe(self._keys.build(Kind.MOTIVATION, robot=robot), self._see)

    def _is_wanted(self, kind: Kind) -> bool:
        if self._kinds is not None and kind not in self._kinds:
            return False
        return self._only is None or intersects(self._only, self._keys.build(kind))

    def _holds(self, key: str) -> bool:
        return self._only is None or matches(self._only, key)

    def _patterns(self) -> list[str]:
        if self._only is not None:
            return [self._only]
        if self._kinds is not None:
            return [self._keys.build(kind) for kind in self._kinds]
        if self._motivations:
            return [f"{ROOT}/{self._mission}/**", *map(self._keys.build, _HIDDEN)]
        return [self._keys.build(kind) for kind in BODY_OF if kind not in _UNHEARD | {Kind.MOTIVATION}]

    async def _ask(self) -> bool:
        """Ask for what there is, and hand on what is not known; whether whoever remembers has answered."""
        asked = [
            self._bus.query(self._keys.build(kind), timeout=GREETING_TIMEOUT)
            for kind in filter(self._is_wanted, self._retained)
        ]
        found = [sample for some in await asyncio.gather(*asked) for sample in some if self._holds(sample.key)]
        moment = self._moment()
        for sample in self._known.news(self._in_order(found)):
            self._recovered += self._known.kind(sample.key) in HISTORY
            if not self._is_presence(sample.key):
                self._hand_on(Sighting(moment.wall, moment.mission, sample.key, sample.payload), self._waiting)
        # The world always has rules to answer with, be they none, and maybe neither events nor decisions.
        expected = found if self._only is not None else [one for one in found if one.key == self._rules]
        self._is_answered |= bool(expected)
        return bool(expected)

    @property
    def _rules(self) -> str:
        return self._keys.build(Kind.CHAOS_RULES)

    async def _make_up(self) -> None:
        """Ask until whoever remembers has answered, if there is anybody."""
        times = 0
        while True:
            self._is_owed = False
            answered = await self._ask()
            times += 1
            is_enough = answered or (not self._is_answered and times > 1)
            if is_enough or self._loop.time() >= self._hold_until:
                self._settle(answered=answered)
            if is_enough and not self._is_owed:
                return
            await asyncio.sleep(AGAIN)

    def _recover(self, gap: Gap | None) -> None:
        """Have what was not heard asked for."""
        if gap is not None:
            self._unsettled.append(gap)
        if not self._retained:
            self._settle(answered=False)
            return
        if gap is not None:
            self._hold()
        self._is_owed = True
        if self._asking is None or self._asking.done():
            self._asking = asyncio.create_task(self._make_up())

    def _hold(self) -> None:
        """Have what comes wait for what was before."""
        if self._held is None:
            self._held = Waiting(CAPACITY, self._is_presence)
            self._hold_until = self._loop.time() + HOLD

    def _release(self) -> None:
        held, self._held, self._recovered = self._held, None, 0
        if held is not None:
            for one in held.all():
                self._hand_on(one, self._waiting)
            self._waiting.overflowed += held.overflowed

    def _settle(self, *, answered: bool) -> None:
        """Nothing more of the gaps is waited for."""
        gaps, self._unsettled = self._unsettled, []
        recovered = self._recovered
        self._release()
        for gap in gaps:
            self._notice(gap._replace(answered=answered, recovered=recovered))

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

    def _moment(self) -> Moment:
        return Moment(self._loop.time(), time.time_ns(), self._clock.now())

    def _see(self, sample: Sample) -> None:
        if self._is_presence(sample.key):
            self.misplaced += 1
            return
        moment = self._moment()
        if (gap := self._gaps.hears(moment)) is not None:
            self._recover(gap)
        if self._only is None and self._known.kind(sample.key) is Kind.STATUS:
            self._is_answered = bool(self._retained)
            if self._gaps.hears_world(moment):
                self._recover(None)
        self._known.note(sample)
        self._come(Sighting(moment.wall, moment.mission, sample.key, sample.payload))

    def _meet(self, key: str, present: bool) -> None:
        moment = self._moment()
        if (gap := self._gaps.meets(key, present, moment)) is not None:
            self._recover(gap)
        if self._holds(key):
            self._come(Sighting(moment.wall, moment.mission, key, b"", not present))

    def _connect(self, is_up: bool) -> None:
        moment = self._moment()
        if not is_up:
            self._gaps.goes_down(moment)
        elif (gap := self._gaps.comes_back(moment)) is not None:
            self._recover(gap)

    def _come(self, sighting: Sighting) -> None:
        self._hand_on(sighting, self._waiting if self._held is None else self._held)

    def _hand_on(self, sighting: Sighting, place: Waiting) -> None:
        place.push(sighting)
        self._news.set()

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
