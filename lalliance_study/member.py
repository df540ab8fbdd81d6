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
from lalliance_agents.model.events import Activate, Announce, Command, Deactivate, Decision, TrialStarted
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.outlook import AT_ONCE
from lalliance_agents.model.parameters import SLACK
from lalliance_agents.wire.messages import Effect
from lalliance_study.air import AirLink
from lalliance_study.circumstances import Circumstances
from lalliance_study.voice import NEVER, Grid, Voice


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
        self._become(Process.GONE)
        self.incarnation = 0
        self.trial = 0
        self.steps = 0
        #: Links from those whom it hears.
        self.hears: list[AirLink] = []
        self.heeded: set[str] = set()
        own = mission.parameters_of(name)
        self.tau = own.silence_timeout
        self.voice = Voice(
            name,
            longest_gap=own.broadcast_period + 2 * mission.control_period,
            delay=message_delay,
            rescheduled=self._schedule,
        )
        self.voice.on = {task: [] for task in self.tasks}
        #: The instant of its next control step, in seconds; infinite while there is none.
        self.due = math.inf
        self.task: str | None = None
        self.abilities = {mate: frozenset(mission.robots[mate].tasks) for mate in mission.teammates(name)}
        self.effects: Counter[tuple[str, str]] = Counter()
        self._mission = mission
        self._circumstances = circumstances
        self._every_step = every_step
        self._decided = decided
        self._rescheduled = rescheduled
        self._sensed = sensed
        self._mind: Mind | None = None
        self.stopped_at = 0.0
        self._lived = self._missed = 0
        #: Whether the bus has given it up since it was stopped.
        self.given_up = False
        self._told: dict[str, tuple[bool, bool]] = {}

    def __repr__(self) -> str:
        return f"<Member {self.name}: {self.process.value}, {self.task or 'idle'}, trial {self.trial}>"

    @property
    def mind(self) -> Mind:
        """Its mind, in its present life."""
        assert self._mind is not None  # noqa: S101 - asked only of a robot that was started
        return self._mind

    def _become(self, process: Process) -> None:
        self.process = process
        #: Whether its process runs; and whether there is one at all.
        self.runs = process is Process.RUNNING
        self.there = process is not Process.GONE

    def start(self, now: float) -> None:
        """Begin a new life."""
        for link in self.hears:
            self._keep(link)
            link.reset(now)
        self.heeded.clear()
        self._become(Process.RUNNING)
        self.incarnation += 1
        chance = self._circumstances.chance_of(self._mission, self.name, self.incarnation)
        learned = self._circumstances.learned.get(self.name)
        self._mind = new_mind(self._mission, self.name, chance, now=now, learned=learned)
        self._mind.handle(roster(self._mission, self.name), now)
        self.trial = 0
        self.task = None
        self._told.clear()
        self._step = 0  # the control steps made or left out so far
        period = self._mission.control_period
        self._grid = Grid(now + chance.random() * period, period)
        self.voice.begin(self._mind, self._grid, self.incarnation, now)
        self._after_pause = True
        self._missed = 0
        self._wake_step = self._lapse_step = 0
        self._wanted = AT_ONCE
        self._schedule()

    def periods(self, now: float) -> int:
        """The control periods of all its lives so far, but for those in which it was stopped."""
        return self._lived + (self._periods_here(now) if self.runs else 0)

    def _periods_here(self, now: float) -> int:
        return max(int((now - self._grid.first) / self._grid.period) + 1 - self._missed, 0)

    def kill(self, now: float) -> None:
        """End as by SIGKILL."""
        if self.runs:
            self.take_stock(now)
            self._lived += self._periods_here(now)
        self._become(Process.GONE)
        self.task = None
        self._mind = None
        self._schedule()

    def stop(self, now: float) -> None:
        """Stop as by SIGSTOP."""
        if self.runs:
            self._listen(now)  # what has come until now is heard, also if it was to be looked at later
            self.voice.unsettle(now)
            for link in self.hears:
                link.speaker.unsettle(now)
            self._become(Process.STOPPED)
            self.stopped_at = now
            self.given_up = False
            # The steps before were made, if only in effect.
            self.mind.rest(self._grid.instant(self._step_from(now) - 1))
            self._schedule()

    def resume(self, now: float) -> bool:
        """Go on as by SIGCONT; whether the bus had given the robot up meanwhile, and with it all that came."""
        if self.process is not Process.STOPPED:
            return False
        self._become(Process.RUNNING)
        lost = self.given_up
        for link in self.hears:
            if lost:
                link.waiting.clear()
                link.forget(now)
        self._step = max(math.ceil((now - self._grid.first) / self._grid.period - SLACK), self._step)
        self._missed += int((now - self.stopped_at) / self._grid.period)
        self._after_pause = True
        self._wake_step = self._step
        self._lapse_step = max(self._lapse_step, self._step)
        self.voice.wait_until(self._step)
        if not lost:
            self._listen(now, each=True)  # no news was looked at meanwhile: any of them may be some
        self._schedule()
        return lost

    def _keep(self, link: AirLink) -> None:
        for fault, count in link.effects.items():
            self.effects[fault, link.sender] += count

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
            self.trial = trial
            self.task = None
            self.voice.turn(now, trial)
            self._told.clear()
            self.mind.handle(TrialStarted(translate.learning(learning)), now)
            for link in self.hears:
                link.forget(now)
            self._heed(now)
        for task, applicable, complete in views:
            if task in self.voice.on:
                self._feel(task, TaskSense(applicable, complete, 0.0), now)
        self._expect_lapse(self.mind.next_lapse(self.heeded), now)

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
            self._take([link], now)
            self._heed(now)
            self._expect_lapse(self.mind.next_lapse(self.heeded), now)

    def doubt(self, instant: float, now: float) -> None:
        """See `air.Hearer`."""
        if self.runs:
            self._expect_lapse(instant, now)

    def _expect_lapse(self, instant: float, now: float) -> None:
        if self._every_step or instant > self._grid.instant(self._lapse_step - 1):
            return
        step = self._step_from(max(instant, now))
        if step < self._lapse_step:
            self._lapse_step = step
            self._schedule()

    def _listen(self, now: float, *, each: bool = False, settled: bool = True) -> None:
        """Take in what has come until `now`: of rows of refreshes the last, or `each`; on `settled` links too, or not."""
        self._take([link for link in self.hears if link.waiting or (settled and link.settled)], now, each=each)
        self._heed(now)

    def _take(self, links: Iterable[AirLink], now: float, *, each: bool = False) -> None:
        each = each or self._every_step
        handle = self.mind.handle
        for link in links:
            for spoken in link.take(now, each=each):
                handle(spoken.heard, spoken.arrives)

    def _step_from(self, instant: float) -> int:
        """The first control step that is not before `instant` and still to come."""
        return self._grid.step_from(instant, self._step)

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
        self._next = min(self._wake_step, self._lapse_step, self.voice.due_step)
        due = self._grid.instant(self._next) if self.runs else math.inf
        if due != self.due:
            self.due = due
            self._rescheduled(self)

    def step(self) -> None:
        """Make the control step that is due."""
        step, now, mind = self._next, self.due, self.mind
        whole = step >= self._wake_step
        if not whole and step >= self._lapse_step:
            self._step = step
            self._listen(now, settled=False)
            self._lapse_step = self._step_from(mind.next_lapse(self.heeded))
            whole = step >= self._lapse_step or step >= self._wake_step
        if whole or step >= self.voice.due_step:
            self.voice.catch_up(now)
            if not self._after_pause:
                mind.rest(self._grid.instant(step - 1))
            self._after_pause = False
            self._step = step + 1
            if whole:
                self._listen(now)
                self._think(now)
            else:
                self.voice.beat(now)
            self.voice.made(step)
        self._schedule()

    def take_stock(self, now: float) -> None:
        """Make and take in all that has come until `now`, so that it is counted."""
        if self.runs:
            self.voice.unsettle(now)
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

    def _perform(self, commands: list[Command], now: float) -> None:
        for command in commands:
            match command:
                case Announce():
                    self.voice.announce(command, now)
                case Activate() | Deactivate():
                    self.task = command.decision.task if isinstance(command, Activate) else None
                    self.voice.turn(now)
                    self._decided(self, command.decision)
