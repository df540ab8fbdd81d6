"""What one simulated robot announces: one by one where somebody waits for it, and else as seen by who looks (see `air`)."""

import math
from collections.abc import Callable
from typing import NamedTuple

from lalliance_agents.model.events import Announce, Heard
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.parameters import SLACK
from lalliance_study.air import AirLink, Spoken

#: The number of a control step that is never made.
NEVER = 2**62


class Grid(NamedTuple):
    """The instants of a robot's control steps."""

    first: float
    """That of step 0, in seconds."""
    period: float
    """From one to the next, in seconds."""

    def instant(self, step: int) -> float:
        """When a step is."""
        return self.first + step * self.period

    def step_from(self, instant: float, earliest: int) -> int:
        """The first step that is not before `instant`, nor before the step `earliest`."""
        if instant == math.inf:
            return NEVER
        if instant <= self.instant(earliest):
            return earliest
        step = max(math.ceil((instant - self.first) / self.period - SLACK), earliest)
        while self.instant(step) < instant:
            step += 1
        return step if self.instant(step - 1) < instant else step - 1


class Voice:
    """One robot's voice.

    Args:
        name: the robot's name.
        longest_gap: the longest time between two announcements, in seconds.
        delay: how long each is under way, in seconds.
        rescheduled: called when `due_step` has changed at somebody else's wish.
    """

    def __init__(self, name: str, *, longest_gap: float, delay: float, rescheduled: Callable[[], None]) -> None:
        self.name = name
        self.longest_gap = longest_gap
        #: Links to those who hear it on a task, and idle.
        self.on: dict[str, list[AirLink]] = {}
        self.idle: list[AirLink] = []
        self.trial = 0
        self.latest: Spoken | None = None
        self.unmade = math.inf
        #: Announcements of all lives.
        self.sent = 0
        self._delay = delay
        self._rescheduled = rescheduled
        self._settled = False
        self._audience: list[AirLink] = []
        self._content: object = None
        self._beat_step = NEVER
        #: Whether the control step `_beat_step` was made, and what it announced was not.
        self._under_way = False

    def __repr__(self) -> str:
        return f"<Voice of {self.name}: {self.sent} sent, {'settled' if self._settled else 'heard'}>"

    def begin(self, mind: Mind, grid: Grid, incarnation: int, now: float) -> None:
        """Speak for a robot that begins a new life."""
        self._mind, self._grid = mind, grid
        self._incarnation, self.trial = incarnation, 0
        self._content = None
        self._seq = 0
        self._beat_step = 0
        self._under_way = False
        self._due = now

    @property
    def due_step(self) -> int:
        """The control step at which the next announcement is to be made; `NEVER` while nobody waits for it."""
        return NEVER if self._settled else self._beat_step

    def wait_until(self, step: int) -> None:
        """Say nothing before a step."""
        self._beat_step = max(self._beat_step, step)

    def made(self, step: int) -> None:
        """A control step was made, and what it announced was said."""
        if self._settled:
            return
        if self._mind.cadence.due != self._due or self._beat_step <= step:
            self._plan(step + 1)
        self._settle()

    def turn(self, now: float, trial: int | None = None) -> None:
        """What is said from now on is news; in a new trial, if one is named."""
        self.unsettle(now)
        self._content = None
        self.trial = self.trial if trial is None else trial

    def announce(self, said: Announce, now: float) -> None:
        """Send an announcement, unless its links are settled: then it is one that is made when somebody looks."""
        if self._settled:
            self._mind.cadence.due = self._due
            self._under_way = True
            return
        self.sent += 1
        self._seq += 1
        if self._content is None:
            self._content = object()
            self._audience = self.idle if said.task is None else self.on[said.task]
        spoken = self._spoken(said, now)
        for link in self._audience:
            link.send(spoken)

    def beat(self, now: float) -> None:
        """Make a control step in which nothing happens but, perhaps, an announcement."""
        for said in self._mind.beat(now):
            self.announce(said, now)

    def _settle(self) -> None:
        """See whether anybody waits for the next announcement."""
        content = self._content
        if self._settled or content is None or self._delay > self._grid.period / 2:
            return
        comes = self._grid.instant(self._beat_step) + self._delay
        if all(link.can_settle(content, comes) for link in self._audience):
            self._settled = True
            self._row = self._seq + 1
            self.unmade = comes
            for link in self._audience:
                link.settle()

    def unsettle(self, now: float) -> None:
        """See `air.Speaker`."""
        if not self._settled:
            return
        self.catch_up(now)
        for link in self._audience:
            link.unsettle(now)
        self._settled = False
        self.latest, self.unmade = None, math.inf
        instant = self._grid.instant(self._beat_step)
        if self._under_way or instant < now:
            self._mind.rest(instant)
            self._mind.cadence.keep(instant)
            for said in self._mind.announcement(instant):
                self.announce(said, instant)
            self._plan(self._beat_step + 1)
        self._under_way = False
        self._rescheduled()

    def catch_up(self, now: float) -> None:
        """See `air.Speaker`."""
        if now < self.unmade:
            return
        (first, period), cadence, step, made, instant = self._grid, self._mind.cadence, self._beat_step, 0, 0.0
        comes = first + step * period
        while comes + self._delay <= now:
            instant = comes
            cadence.keep(instant)
            made += 1
            step = cadence.next_step(first, period, step + 1)
            comes = first + step * period
        self._under_way = False
        self._beat_step, self._due, self.unmade = step, cadence.due, comes + self._delay
        self._seq += made
        self.sent += made
        self._mind.rest(instant)
        for said in self._mind.announcement(instant):
            self.latest = self._spoken(said, instant, self._row)

    def _plan(self, step: int) -> None:
        """Find the first step from `step` on at which an announcement is due, if all steps are made."""
        cadence = self._mind.cadence
        self._beat_step = cadence.next_step(*self._grid, step)
        self._due = cadence.due

    def _spoken(self, said: Announce, now: float, first: int | None = None) -> Spoken:
        heard = Heard(self.name, said.task, said.active_for, said.expected)
        return Spoken(now + self._delay, self._incarnation, self._seq, self.trial, self._content, heard, first)
