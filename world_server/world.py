"""The world's core: tasks, bodies, trials and faults, moved by whoever hands in the time.

The world waits until its team is there, runs the trials of the mission one after the other, and ends complete or failed.
Nothing here waits, sends or reads a clock: the server and the simulator both drive it, and tell others what it returns.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from lalliance_agents.config import Mission, Phase
from lalliance_agents.errors import UserError
from lalliance_agents.faults import Crash, Fault, Hang, describe, robot_of
from lalliance_agents.wire.messages import Action, Blindness, DecisionMade, LinkReport, LinkRule
from world_server import environments
from world_server.bodies import Bodies
from world_server.environments.base import Environment, TaskView, Work
from world_server.failures import Change, Failures, Order
from world_server.ledger import Ledger

#: Time between two looks of a world server at its world, and between two refreshes of what it publishes, in seconds.
STEP = 0.05
REFRESH_PERIOD = 1.0
#: Time between two trials, in seconds: everybody can sense the end of the one before the next begins.
TRIAL_PAUSE = 1.0


class Stage(StrEnum):
    """How the mission stands; the words of the messages."""

    WAITING = "waiting"
    RUNNING = "running"
    COMPLETE = "complete"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Happening:
    """Something worth telling."""

    kind: str
    text: str
    elapsed: float
    robot: str | None = None
    task: str | None = None
    details: Mapping[str, str | int | bool] = field(default_factory=dict)
    """What the text says, for programs: of a takeover `from` and `cause`; of a fault its `name` and whether it `begins`; of
    a trial whether it `begins`; of an order its `deed` and `number`."""


class World:
    """One mission's world.

    Args:
        mission: a mission that passed `environments.check_options`.
        now: the present instant, in seconds.
        tell: called with everything that happens, as it happens.
    """

    def __init__(self, mission: Mission, now: float, tell: Callable[[Happening], None]) -> None:
        self.mission = mission
        self.stage = Stage.WAITING
        self.trial = 0
        self.bodies = Bodies(mission)
        self.ledger = Ledger(list(mission.tasks))
        self.failures = Failures(mission)
        #: Whether somebody is there who can kill, start, stop and continue the robots' processes.
        self.has_launcher = False
        self.trials_planned = sum(phase.trials for phase in mission.phases)
        self._tell = tell
        self._now = now
        self._began = now
        self._pause_until: float | None = None
        self._undisturbed = {task: Work(task) for task in mission.tasks}
        self._phases = [phase for phase in mission.phases for _ in range(phase.trials)]
        self._phase: Phase = self._phases[0]
        self._environment = self._fresh_environment()
        self.makespan: float | None = None

    def __repr__(self) -> str:
        return f"<World {self.mission.name}: {self.stage}, trial {self.trial}, {self.elapsed:.1f} s>"

    @property
    def elapsed(self) -> float:
        """Time since the trial began, in seconds."""
        return self._now - self._began if self.trial else 0.0

    @property
    def began(self) -> float:
        """When the trial began, as an instant of whoever hands in the time."""
        return self._began

    @property
    def learning(self) -> str:
        """The control phase of the trial."""
        return self._phase.learning.value

    @property
    def live(self) -> bool:
        """Whether this is the last trial, in which faults happen."""
        return self.trial > 0 and not self._phases

    @property
    def over(self) -> bool:
        """Whether the mission has ended."""
        return self.stage in {Stage.COMPLETE, Stage.FAILED}

    def missing(self) -> list[str]:
        """The robots that should be there from the beginning, and are not."""
        return self.bodies.missing()

    def some_there(self) -> bool:
        """Whether there is any robot to begin with."""
        return bool(self.bodies.there())

    def _fresh_environment(self) -> Environment:
        seed = np.random.SeedSequence([self.mission.seed, self.trial]).generate_state(1, np.uint64)[0]
        return environments.create(self.mission, seed=int(seed))

    def _report(
        self, kind: str, text: str, *, robot: str | None = None, task: str | None = None, **details: str | bool
    ) -> None:
        self._tell(Happening(kind, text, self.elapsed, robot, task, details))

    def begin(self, now: float) -> None:
        """Start the first trial, with whoever is there."""
        self.advance(now)
        if self.stage is Stage.WAITING:
            if self.missing():
                self._report("warning", f"beginning without {', '.join(self.missing())}")
            self.stage = Stage.RUNNING
            self._next_trial()

    def _next_trial(self) -> None:
        self._phase = self._phases.pop(0)
        self.trial += 1
        self._began = self._now
        self._pause_until = None
        self._environment = self._fresh_environment()
        self.ledger.new_trial()
        for robot, body in self.bodies.items():
            body.task = None
            if self.live and body.present:
                self.failures.presence(robot, True, 0.0)
        self._report("trial", f"trial {self.trial} begins ({self.learning} learning)", begins=True)
        self._let_faults_happen()

    def presence(self, robot: str, present: bool, now: float) -> None:
        """A robot's process came or went."""
        self.advance(now)
        body = self.bodies.get(robot)
        if body is None or body.present == present:
            return
        body.present = present
        if self.over:
            return
        if self.live:
            self.failures.presence(robot, present, self.elapsed)
            self._let_faults_happen()
        if present:
            self.ledger.returned(robot)
            self._report("present", f"{robot} is there", robot=robot)
        else:
            body.task = None
            self.ledger.failed(robot, self.elapsed)
            hangs = self.live and self.failures.is_hung(robot)
            self._report("gone", f"{robot} {'does not answer' if hangs else 'is gone'}", robot=robot)
            self._rest()

    def act(self, action: Action, now: float) -> None:
        """A robot's body is to work on a task, or on none: also if this mission has no such task."""
        body = self.bodies.get(action.sender)
        if body is None:
            return
        if self.is_refresh(action, now):
            body.fewest = action.fewest
            self.bodies.refresh(action.sender, now)
            return
        self.advance(now)
        body.fewest = action.fewest
        if action.trial != self.trial:
            return
        body.refreshed = self._now
        task = action.task if action.task in self.mission.tasks else None
        if task != body.task:
            body.task = task
            if task is not None:
                self.ledger.began(action.sender, task, self.elapsed)
            self._rest()

    def is_refresh(self, action: Action, now: float) -> bool:
        """Whether an action at `now` only says once more what its robot's body works on."""
        return self.bodies.is_refresh(action, self.trial, now)

    def decided(self, made: DecisionMade, now: float) -> None:
        """A robot reports a decision."""
        self.advance(now)
        if made.trial != self.trial or made.sender not in self.bodies:
            return
        takeover = self.ledger.decided(made, self.elapsed)
        if takeover is not None:
            self._report(
                "takeover",
                f"{takeover['to']} takes {takeover['task']} from {takeover['from']} ({takeover['cause']})",
                robot=made.sender,
                task=made.task,
                **{"from": takeover["from"], "cause": takeover["cause"]},
            )

    def reported(self, report: LinkReport, now: float) -> None:
        """A robot reports what it sent and received, and what faults did to what it received; no time passes by that."""
        if report.sender in self.bodies:
            elapsed = max(self._now, now) - self._began if self.trial else 0.0
            self.failures.touched(self.ledger.reported(report), elapsed)

    def launcher(self, present: bool, now: float) -> None:
        """Whoever holds the robots' processes came or went."""
        self.advance(now)
        self.has_launcher = present

    def done(self, number: int, now: float) -> None:
        """Whoever holds the robots' processes has carried out an order."""
        self.advance(now)
        self.failures.done(number, self.elapsed)

    def inject(self, fault: Fault, lasts: float | None, now: float) -> str:
        """Put a fault in force now; what was done, in a sentence.

        Args:
            fault: the fault; when it begins is not looked at.
            lasts: how long, in seconds; None: as long as it says itself.
            now: the present instant, in seconds.

        Raises:
            UserError: it cannot be made now, or here.
        """
        self.advance(now)
        if not self._runs_live:
            where = f"{self.stage} (trial {self.trial} of {self.trials_planned})"
            raise UserError(f"faults belong to the live trial of a running mission; this one is {where}")
        if isinstance(fault, Crash | Hang) and not self.has_launcher:
            raise UserError(
                f"{describe(fault)}: nobody here can reach the robots' processes; expected a mission started by "
                "`lalliance run` with one process per robot, or a fault of another kind"
            )
        if isinstance(fault, Crash | Hang) and fault.robot in self.bodies and not self.bodies[fault.robot].present:
            raise UserError(f"{describe(fault)}: {fault.robot} is not there; expected a robot whose process runs")
        entry, changes = self.failures.inject(fault, self.elapsed, lasts)
        self._changed(changes)
        until = "until it is healed" if entry.ends == math.inf else f"until {entry.ends:.1f} s"
        return f"{entry.name}: {describe(fault)}, {until}"

    def heal(self, name: str, now: float) -> str:
        """End the fault `name`, or all if that is empty; what was done, in a sentence.

        Raises:
            UserError: there is no such fault in force.
        """
        self.advance(now)
        healed, changes = self.failures.heal(name, self.elapsed, killing=self.has_launcher)
        self._changed(changes)
        return f"healed {', '.join(healed)}" if healed else "no fault is in force"

    def _let_faults_happen(self) -> None:
        if self._runs_live:
            self._changed(self.failures.advance(self.elapsed))

    def _changed(self, changes: list[Change]) -> None:
        for change in changes:
            text = describe(change.entry.fault)
            words = f"fault: {text}" if change.on else f"fault is over: {text}"
            self._report("fault", words, robot=robot_of(change.entry.fault), name=change.entry.name, begins=change.on)
            if change.on and isinstance(change.entry.fault, Crash | Hang) and not self.has_launcher:
                self._report("warning", f"nobody here can reach the robots' processes: {text} has to be made by hand")
        if changes:
            self._rest()

    def advance(self, now: float) -> None:
        """Let time pass until `now`; an instant that has passed already changes nothing."""
        while self.stage is Stage.RUNNING and self._now < now:
            until = min(now, self._next_instant())
            if self._pause_until is None:
                self._work(until)
                if self.bodies.stop_dead(self._now):
                    self._rest()
                self._let_faults_happen()
            else:
                self._now = until
                if until >= self._pause_until:
                    self._next_trial()
        self._now = max(self._now, now)

    def _next_instant(self) -> float:
        """The next instant at which something other than work changes."""
        if self._pause_until is not None:
            return self._pause_until
        due = min(self._began + self.mission.deadline, self.bodies.next_stop())
        return min(due, self._began + self.failures.next_instant(self.elapsed)) if self.live else due

    def next_change(self) -> float:
        """When a task will be completed or become (not) applicable, a fault begin or end, or the trial, at the latest.

        That is if all bodies go on as they do; whoever drives the world in virtual time need not look before.
        """
        if self.stage is not Stage.RUNNING:
            return math.inf
        if self._pause_until is not None:
            return self._pause_until
        return min(self._next_instant(), self._now + self._environment.next_change(self._actions()))

    def _actions(self) -> dict[str, Work]:
        working = self.bodies.working()
        if not (self.live and self.failures.hold_up):
            return {robot: self._undisturbed[task] for robot, task in working.items()}
        return {
            robot: Work(task, self.failures.pace(robot, task))
            for robot, task in working.items()
            if not self.failures.is_hung(robot)
        }

    def _rest(self) -> None:
        """Let the environment know at once who works on what, so that no change is lost between two steps."""
        if self.stage is Stage.RUNNING and self._pause_until is None:
            self._work(self._now)

    def _work(self, until: float) -> None:
        actions, since = self._actions(), self._now
        if self.live and until > since and self.failures.hold_up:
            for robot, work in actions.items():
                self.failures.worked(robot, work.task, self.elapsed)
        completions = self._environment.step(until - self._now, actions)
        for done in completions:
            at = self._now + done.after - self._began
            self.ledger.completed(done.task, done.by, at)
            text = f"{done.task} completed by {' and '.join(done.by)}"
            self._tell(Happening("complete", text, at, done.by[0] if done.by else None, done.task))
        self._now = until
        if (completions or since == self._began) and self._environment.is_complete:
            # The trial ends with its last task, however far this step went beyond it.
            self._now = min(max(since, self._began + (self.ledger.last_completion or 0.0)), until)
            self._end_trial()
        elif self._now >= self._began + self.mission.deadline:
            self._end(Stage.FAILED, f"not complete by the deadline of {self.mission.deadline:g} s")

    def _end_trial(self) -> None:
        last = self.ledger.last_completion
        # An environment may have nothing to do from the start.
        self.makespan = self.elapsed if last is None else last
        self.ledger.trials.append(self.makespan)
        while self._phases and self._phase.until == "full" and self.bodies.full() and self._phases[0] is self._phase:
            self._phases.pop(0)
        if self._phases:
            self._pause_until = self._now + TRIAL_PAUSE
            self._report("trial", f"trial {self.trial} complete after {self.makespan:.1f} s", begins=False)
        else:
            self._end(Stage.COMPLETE, f"complete after {self.makespan:.1f} s")

    def _end(self, stage: Stage, text: str) -> None:
        self.stage = stage
        if stage is Stage.FAILED:
            self.makespan = None
        self._report(stage.value, text)

    @property
    def _runs_live(self) -> bool:
        return self.live and self.stage is Stage.RUNNING

    def rules(self) -> list[LinkRule]:
        """The link rules in force."""
        return self.failures.rules() if self._runs_live else []

    def blind(self) -> list[Blindness]:
        """The robots whose sensory feedback is held back."""
        return self.failures.blind() if self._runs_live else []

    def orders(self) -> list[Order]:
        """Deeds at processes that are due and not confirmed."""
        return self.failures.orders(self.elapsed) if self._runs_live else []

    def tasks(self) -> dict[str, TaskView]:
        """What every task looks like to the robots now: before the first trial and between trials, nothing is to do."""
        views = dict(self._environment.sense())
        if self.stage is Stage.RUNNING:
            return views
        return {task: TaskView(view.complete, applicable=False, progress=view.progress) for task, view in views.items()}

    def summary(self) -> dict[str, Any]:
        """How the mission went, as plain data."""
        return {
            "mission": self.mission.name,
            "complete": self.stage is Stage.COMPLETE,
            "makespan": self.makespan,
            "seed": self.mission.seed,
            "trials": self.ledger.trials,
            "knowledge": {robot: body.fewest for robot, body in self.bodies.items()},
            "faults": self.failures.report(),
            **self.ledger.summary(),
        }
