"""One robot of a simulated team: its mind on its own grid of control steps, its ears, and its process as faults make it.

The mind is the very one that runs on the bus. Of its control steps only those are made in which something may happen: the
mind says when that is (`Mind.wake`, `Mind.next_lapse`), events make it sooner, and where nothing but an announcement is due it
only beats; where nobody waits for that either (see `air`), it beats when somebody looks. The result is the same as if all steps
had been made; `every_step` makes them all, to show it.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from enum import Enum

from lalliance_agents.agent import translate
from lalliance_agents.agent.behavior import TaskSense
from lalliance_agents.agent.briefing import new_mind, roster, tasks_of
from lalliance_agents.config import Mission
from lalliance_agents.model.events import Activate, Announce, Command, Deactivate, Decision, Heard, TrialStarted
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.outlook import AT_ONCE
from lalliance_agents.model.parameters import SLACK
from lalliance_agents.wire.messages import Effect
from lalliance_study.air import AirLink, Spoken
from lalliance_study.circumstances import Circumstances


class Process(Enum):
    """How a robot's process is."""

    GONE = "gone"
    RUNNING = "running"
    STOPPED = "stopped"


#: What a member tells the simulator: a decision, and that its next step has changed.
Decided = Callable[["Member", Decision], None]
Rescheduled = Callable[["Member"], None]
#: Told when, which robot senses of which task whether it is applicable, and complete.
SensedHook = Callable[[float, str, str, bool, bool], None]


class Member:
    """One robot.

    Args:
        mission: its mission.
        name: which robot.
        circumstances: what it has learned before, and where its chance comes from.
        message_delay: how long each of its messages is under way, in seconds.
        every_step: whether to make all control steps and to take in all messages.
        decided: called with each decision.
        rescheduled: called when `due` has changed.
        sensed: called when a task is sensed to stand otherwise than before.
    """

    def __init__(
        self,
        mission: Mission,
        name: str,
        *,
        circumstances: Circumstances,
        message_delay: float,
        every_step: bool,
        decided: Decided,
        rescheduled: Rescheduled,
        sensed: SensedHook | None = None,
    ) -> None:
        self.name = name
        self.tasks = tasks_of(mission, name)
        self.process = Process.GONE
        self.there = False
        self.incarnation = 0
        self.trial = 0
        self.sent = self.steps = self.beats = 0
        #: Links to those who hear it on a task, and idle.
        self.heard_on: dict[str, list[AirLink]] = {task: [] for task in self.tasks}
        self.heard_idle: list[AirLink] = []
        #: Links from those whom it hears.
        self.hears: list[AirLink] = []
        self.heeded: set[str] = set()
        own = mission.parameters_of(name)
        self.tau = own.silence_timeout
        #: Of its announcements, and of them as they come: see `air.Speaker`.
        self.longest_gap = own.broadcast_period + 2 * mission.control_period
        self.latest: Spoken | None = None
        self.unmade = math.inf
        #: The instant of its next control step, in seconds; infinite while there is none.
        self.due = math.inf
        self.task: str | None = None
        self.abilities = {mate: frozenset(mission.robots[mate].tasks) for mate in mission.teammates(name)}
        self.effects: Counter[tuple[str, str]] = Counter()
        self._mission = mission
        self._circumstances = circumstances
        self._delay = message_delay
        self._every_step = every_step
        self._decided = decided
        self._rescheduled = rescheduled
        self._sensed = sensed
        self._period = mission.control_period
        self._mind: Mind | None = None
        self.stopped_at = 0.0
        self._lived = self._missed = 0
        #: Whether the bus has given it up since it was stopped.
        self.given_up = False
        self._told: dict[str, tuple[bool, bool]] = {}
        self._settled = False
        #: The links to those who hear what it says now.
        self._audience: list[AirLink] = []

    def __repr__(self) -> str:
        return f"<Member {self.name}: {self.process.value}, {self.task or 'idle'}, trial {self.trial}>"

    @property
    def mind(self) -> Mind:
        """Its mind, in its present life."""
        assert self._mind is not None  # noqa: S101 - asked only of a robot that was started
        return self._mind

    @property
    def runs(self) -> bool:
        """Whether its process runs."""
        return self.process is Process.RUNNING

    def start(self, now: float) -> None:
        """Begin a new life."""
        for link in self.hears:
            self._keep(link)
            link.reset(now)
        self.process = Process.RUNNING
        self.there = True
        self.incarnation += 1
        chance = self._circumstances.chance_of(self._mission, self.name, self.incarnation)
        learned = self._circumstances.learned.get(self.name)
        self._mind = new_mind(self._mission, self.name, chance, now=now, learned=learned)
        self._mind.handle(roster(self._mission, self.name), now)
        self.trial = 0
        self.task = None
        self._told.clear()
        self._seq = 0
        self._content: object = None
        self._step = 0  # the control steps made or left out so far
        self._first = now + chance.random() * self._period
        self._after_pause = True
        self._missed = 0
        self._wake_step = self._lapse_step = self._beat_step = 0
        self._wanted = AT_ONCE
        self._broadcast_due = now
        self._schedule()

    def periods(self, now: float) -> int:
        """The control periods of all its lives so far, but for those in which it was stopped."""
        return self._lived + (self._periods_here(now) if self.runs else 0)

    def _periods_here(self, now: float) -> int:
        return max(int((now - self._first) / self._period) + 1 - self._missed, 0)

    def kill(self, now: float) -> None:
        """End as by SIGKILL."""
        self.unsettle(now)
        if self.runs:
            self._lived += self._periods_here(now)
        self.process = Process.GONE
        self.there = False
        self.task = None
        self._mind = None
        self._schedule()

    def stop(self, now: float) -> None:
        """Stop as by SIGSTOP."""
        if self.runs:
            self._listen(now)  # what has come until now is heard, also if it was to be looked at later
            self.unsettle(now)
            for link in self.hears:
                link.speaker.unsettle(now)
            self.process = Process.STOPPED
            self.stopped_at = now
            self.given_up = False
            # The steps before were made, if only in effect.
            self.mind.rest(self._instant(self._step_from(now) - 1))
            self._schedule()

    def resume(self, now: float) -> bool:
        """Go on as by SIGCONT; whether the bus had given the robot up meanwhile, and with it all that came."""
        if self.process is not Process.STOPPED:
            return False
        self.process = Process.RUNNING
        lost = self.given_up
        for link in self.hears:
            if lost:
                link.waiting.clear()
                link.forget(now)
        self._step = max(math.ceil((now - self._first) / self._period - SLACK), self._step)
        self._missed += int((now - self.stopped_at) / self._period)
        self._after_pause = True
        self._wake_step = self._step
        self._lapse_step = max(self._lapse_step, self._step)
        self._beat_step = max(self._beat_step, self._step)
        if not lost:
            self._listen(now, each=True)  # no news was looked at meanwhile: any of them may be some
        self._schedule()
        return lost

    def _keep(self, link: AirLink) -> None:
        for fault, count in link.effects.items():
            self.effects[fault, link.sender] += count

    def was_touched(self) -> bool:
        """Whether a fault did anything to what came here."""
        return bool(self.effects) or any(link.effects for link in self.hears)

    def total_effects(self) -> list[Effect]:
        """What faults did to what came here, over all lives."""
        total = self.effects.copy()
        for link in self.hears:
            for fault, count in link.effects.items():
                total[fault, link.sender] += count
        return [Effect(fault=fault, sender=sender, count=count) for (fault, sender), count in total.items()]

    def sense(self, trial: int, learning: str, views: Iterable[tuple[str, bool, bool]], now: float) -> None:
        """The world says how tasks stand: (task, applicable, complete)."""
        if not self.runs or trial < self.trial:
            return
        self._listen(now)
        if trial > self.trial:
            self._turn_to(None, now)
            self.trial = trial
            self._told.clear()
            self.mind.handle(TrialStarted(translate.learning(learning)), now)
            for link in self.hears:
                link.forget(now)
            self._heed(now)
        for task, applicable, complete in views:
            if task in self.heard_on:
                self._feel(task, TaskSense(applicable, complete, 0.0), now)
        self._expect_lapse(self.mind.next_lapse(self.heeded))

    def _feel(self, task: str, sense: TaskSense, now: float) -> None:
        felt = sense.applicable, sense.complete
        if self._told.get(task) != felt:
            self._told[task] = felt
            if self._sensed is not None:
                self._sensed(now, self.name, task, *felt)
            self.mind.handle(translate.sensed(task, *felt), now)
            for link in self.hears:
                link.forget(now, task)
            self._heed(now)

    def news(self, link: AirLink, now: float) -> None:
        """A message has come that may be news."""
        if self.runs:
            self._take(link, now, each=False)
            self._heed(now)
            self._expect_lapse(self.mind.next_lapse(self.heeded))

    def doubt(self, instant: float) -> None:
        """See `air.Hearer`."""
        if self.runs:
            self._expect_lapse(instant)

    def _expect_lapse(self, instant: float) -> None:
        if not self._every_step and (step := self._step_from(instant)) < self._lapse_step:
            self._lapse_step = step
            self._schedule()

    def _listen(self, now: float, *, each: bool = False, to_all: bool = True) -> None:
        """Take in what has come until `now`: of rows of refreshes the last, or `each`; `to_all`, or to whom nobody heeds."""
        for link in self.hears:
            if (link.settled and to_all) or link.waiting:
                self._take(link, now, each=each)
        self._heed(now)

    def _take(self, link: AirLink, now: float, *, each: bool) -> None:
        for spoken in link.take(now, each=each or self._every_step):
            self.mind.handle(spoken.heard, spoken.arrives)

    def _instant(self, step: int) -> float:
        return self._first + step * self._period

    def _step_from(self, instant: float) -> int:
        """The first control step that is not before `instant` and still to come."""
        if instant == math.inf:
            return NEVER
        if instant <= self._instant(self._step):
            return self._step
        step = max(math.ceil((instant - self._first) / self._period - SLACK), self._step)
        while self._instant(step) < instant:
            step += 1
        return step if self._instant(step - 1) < instant else step - 1

    def _heed(self, now: float) -> None:
        """Make a whole step when the mind wants one, after it has perceived something."""
        wanted = self.mind.wake()
        if wanted != self._wanted:
            self._wanted = wanted
            step = self._step_from(max(wanted, now))
            if step < self._wake_step or self._wake_step < self._step:
                self._wake_step = step
                self._schedule()

    def _schedule(self) -> None:
        self._next = min(self._wake_step, self._lapse_step, NEVER if self._settled else self._beat_step)
        due = self._first + self._next * self._period if self.runs else math.inf
        if due != self.due:
            self.due = due
            self._rescheduled(self)

    def step(self) -> None:
        """Make the control step that is due."""
        step, now, mind = self._next, self.due, self.mind
        whole = step >= self._wake_step
        if not whole and step >= self._lapse_step:
            self._step = step
            self._listen(now, to_all=False)
            self._lapse_step = self._step_from(mind.next_lapse(self.heeded))
            whole = step >= self._lapse_step or step >= self._wake_step
        if whole or (step >= self._beat_step and not self._settled):
            self.catch_up(now)
            if step >= self._beat_step:
                self.unsettle(now)
            if not self._after_pause:
                mind.rest(self._instant(step - 1))
            self._after_pause = False
            self._step = step + 1
            if whole:
                self._listen(now)
                self._think(now)
            else:
                self._beat(now)
            if mind.broadcast_due != self._broadcast_due or self._beat_step <= step:
                self._broadcast_due = mind.broadcast_due
                self._beat_step = self._next_beat(step + 1)
            self._settle()
        self._schedule()

    def _beat(self, now: float) -> None:
        self.beats += 1
        self._perform(self.mind.beat(now), now)

    def _settle(self) -> None:
        """See whether anybody waits for the next announcement."""
        content = self._content
        if self._settled or content is None or self._delay > self._period / 2:
            return
        if all(link.can_settle(content) for link in self._audience):
            self._settled = True
            self._row = self._seq + 1
            self.unmade = self._instant(self._beat_step) + self._delay
            for link in self._audience:
                link.settle()

    def unsettle(self, now: float) -> None:
        """See `air.Speaker`."""
        if not self._settled:
            return
        self.catch_up(now)
        for link in self._audience:
            link.unsettle()
        self._settled = False
        self.latest, self.unmade = None, math.inf
        under_way = self._beat_step
        if self._instant(under_way) < now:
            self.mind.rest(self._instant(under_way - 1))
            self._beat(self._instant(under_way))
            self._step = max(self._step, under_way + 1)
            self._beat_step = self._next_beat(under_way + 1)
            self._broadcast_due = self.mind.broadcast_due
        self._schedule()

    def catch_up(self, now: float) -> None:
        """See `air.Speaker`."""
        if now < self.unmade:
            return
        mind, before, made = self.mind, self._seq, self._beat_step
        while self.unmade <= now:
            made = self._beat_step
            mind.keep_beat(self._instant(made))
            self._seq += 1
            self._beat_step = self._next_beat(made + 1)
            self.unmade = self._instant(self._beat_step) + self._delay
        self._broadcast_due = mind.broadcast_due
        self._step = max(self._step, made + 1)
        self.beats += self._seq - before
        self.sent += self._seq - before
        at = self._instant(made)
        mind.rest(at)
        for said in mind.announcement(at):
            self.latest = self._spoken(said, at, self._row)

    def take_stock(self, now: float) -> None:
        """Make and take in all that has come until `now`, so that it is counted."""
        if self.runs:
            self.unsettle(now)
            self._listen(now)

    def _think(self, now: float) -> None:
        self.steps += 1
        self._perform(self.mind.tick(now), now)
        if self._every_step:
            self._wake_step = self._step
            self._lapse_step = NEVER
        else:
            self._wanted = self.mind.wake()
            self._wake_step = self._step_from(self._wanted)
            self._lapse_step = self._step_from(self.mind.next_lapse(self.heeded))

    def _next_beat(self, step: int) -> int:
        """The first step from `step` on at which an announcement is due, if all steps are made."""
        before, is_due = self._instant(step - 1), self.mind.is_broadcast_due
        while not is_due(now := self._instant(step), before):
            before = now
            step += 1
        return step

    def _perform(self, commands: list[Command], now: float) -> None:
        for command in commands:
            match command:
                case Announce():
                    self._announce(command, now)
                case Activate():
                    self._turn_to(command.decision.task, now)
                    self._decided(self, command.decision)
                case Deactivate():
                    self._turn_to(None, now)
                    self._decided(self, command.decision)

    def _turn_to(self, task: str | None, now: float) -> None:
        """Be on another task, or on none: what is said from now on is news."""
        self.unsettle(now)
        self.task = task
        self._content = None

    def _announce(self, said: Announce, now: float) -> None:
        self.sent += 1
        self._seq += 1
        if self._content is None:
            self._content = object()
            self._audience = self.heard_idle if said.task is None else self.heard_on[said.task]
        spoken = self._spoken(said, now)
        for link in self._audience:
            link.send(spoken)

    def _spoken(self, said: Announce, now: float, first: int | None = None) -> Spoken:
        heard = Heard(self.name, said.task, said.active_for, said.expected)
        return Spoken(now + self._delay, self.incarnation, self._seq, self.trial, self._content, heard, first)


#: The number of a control step that is never made.
NEVER = 2**62
