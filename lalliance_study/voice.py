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
        #: Announcements of all lives; and those of them for which no whole control step was made.
        self.sent = self.beats = 0
        self._delay = delay
        self._rescheduled = rescheduled
        self._settled = False
        self._audience: list[AirLink] = []
        self._content: object = None
        self._beat_step = NEVER

    def __repr__(self) -> str:
        return f"<Voice of {self.name}: {self.sent} sent, {'settled' if self._settled else 'heard'}>"

    def begin(self, mind: Mind, grid: Grid, incarnation: int, now: float) -> None:
        """Speak for a robot that begins a new life."""
        self._mind, self._grid = mind, grid
        self._incarnation, self.trial = incarnation, 0
        self._content = None
        self._seq = 0
        self._beat_step = 0
        self._due = now

    @property
    def due_step(self) -> int:
        """The control step at which the next announcement is to be made; `NEVER` while nobody waits for it."""
        return NEVER if self._settled else self._beat_step

    def wait_until(self, step: int) -> None:
        """Say nothing before a step."""
        self._beat_step = max(self._beat_step, step)

    def prepare(self, step: int, now: float) -> None:
        """A control step is about to be made: all that was due before it is said."""
        self.catch_up(now)
        if step >= self._beat_step:
            self.unsettle(now)

    def made(self, step: int) -> None:
        """A control step was made, and what it announced was said."""
        if self._mind.cadence.due != self._due or self._beat_step <= step:
            self._plan(step + 1)
        self._settle()

    def turn(self, now: float, trial: int | None = None) -> None:
        """What is said from now on is news; in a new trial, if one is named."""
        self.unsettle(now)
        self._content = None
        self.trial = self.trial if trial is None else trial

    def announce(self, said: Announce, now: float) -> None:
        """Send an announcement."""
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
        self.beats += 1
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
        under_way = self._beat_step
        if self._grid.instant(under_way) < now:
            self._mind.rest(self._grid.instant(under_way - 1))
            self.beat(self._grid.instant(under_way))
            self._plan(under_way + 1)
        self._rescheduled()

    def catch_up(self, now: float) -> None:
        """See `air.Speaker`."""
        if now < self.unmade:
            return
        mind, grid, before, at = self._mind, self._grid, self._seq, 0.0
        while self.unmade <= now:
            at = grid.instant(self._beat_step)
            mind.cadence.keep(at)
            self._seq += 1
            self._plan(self._beat_step + 1)
            self.unmade = grid.instant(self._beat_step) + self._delay
        self.beats += self._seq - before
        self.sent += self._seq - before
        mind.rest(at)
        for said in mind.announcement(at):
            self.latest = self._spoken(said, at, self._row)

    def _plan(self, step: int) -> None:
        """Find the first step from `step` on at which an announcement is due, if all steps are made."""
        (first, period), is_due = self._grid, self._mind.cadence.is_due
        before = first + (step - 1) * period
        while not is_due(now := first + step * period, before):
            before = now
            step += 1
        self._beat_step = step
        self._due = self._mind.cadence.due

    def _spoken(self, said: Announce, now: float, first: int | None = None) -> Spoken:
        heard = Heard(self.name, said.task, said.active_for, said.expected)
        return Spoken(now + self._delay, self._incarnation, self._seq, self.trial, self._content, heard, first)
