"""A toy world for the model's tests: minds on a common clock, messages without delay, work that just takes its time.

It has no bus and no environment, so that what a test sees here is the model's doing alone. All minds tick together, in
order; what one announces the others hear before the next step. Beside the minds there may be ghosts: teammates that only
say what a test has them say, just before the minds tick.
"""

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from lalliance_agents.model.equations import is_heard
from lalliance_agents.model.events import (
    Activate,
    Announce,
    Deactivate,
    Decision,
    Heard,
    RosterKnown,
    Sensed,
    TrialStarted,
)
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.monitor import Record
from lalliance_agents.model.parameters import Erratum, Learning, Parameters

Ghost = Callable[[float], Announce | None]


def ghost(*attempts: tuple[str, float, float], idle: bool = True, expected: float = 99.0) -> Ghost:
    """A teammate that says to be on each task from one instant to another, and is idle, or silent, in between."""

    def speak(now: float) -> Announce | None:
        for task, since, until in attempts:
            if since - 1e-9 <= now < until - 1e-9:
                return Announce(task, max(now - since, 0.0), expected)
        return Announce(None) if idle else None

    return speak


@dataclass
class Arena:
    """Runs minds.

    Args:
        abilities: robot -> task -> own time in seconds.
        parameters: of every robot.
        period: the control period, in seconds.
        given: whether robots know all the times they share from the start.
        known: task -> robot -> the time that all robots know from the start, in seconds.
        ghosts: teammates that are no minds, each with what it says at an instant.
        dead_after: robot -> instant from which it neither works nor sends nor hears.
        stuck: (robot, task) pairs that never progress.
        restarts: whether each attempt begins its task anew; otherwise the work left belongs to the task.
    """

    abilities: Mapping[str, Mapping[str, float]]
    parameters: Parameters = field(default_factory=Parameters)
    period: float = 0.1
    given: bool = False
    known: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    ghosts: Mapping[str, Ghost] = field(default_factory=dict)
    learning: Learning = Learning.ADAPTIVE
    dead_after: Mapping[str, float] = field(default_factory=dict)
    stuck: frozenset[tuple[str, str]] = frozenset()
    restarts: bool = False
    seed: int = 0
    deliver: Callable[[str, str, float], bool] = lambda sender, receiver, now: True

    def __post_init__(self) -> None:
        self.tasks = list(dict.fromkeys(task for tasks in self.abilities.values() for task in tasks))
        self.minds = {
            robot: Mind(
                robot,
                [task for task in self.tasks if task in tasks],
                self.parameters,
                now=0.0,
                draw=random.Random(f"{self.seed}/{robot}").random,
            )
            for robot, tasks in self.abilities.items()
        }
        for robot, mind in self.minds.items():
            mates = {
                k for k, tasks in self.abilities.items() if k != robot and tasks.keys() & self.abilities[robot].keys()
            }
            mind.handle(RosterKnown(frozenset(mates | self.ghosts.keys())), 0.0)
            mind.knowledge.restore(self._learned())
        self.now = 0.0
        self.log: list[tuple[float, str, Decision]] = []
        self.completed: dict[str, tuple[float, str]] = {}
        self.begin(self.learning)

    def _learned(self) -> dict[str, dict[str, Record]]:
        if not self.given:
            return {task: {k: Record((time,)) for k, time in times.items()} for task, times in self.known.items()}
        return {
            task: {k: Record((own[task],)) for k, own in self.abilities.items() if task in own} for task in self.tasks
        }

    def begin(self, learning: Learning) -> None:
        """Start a trial: all work is to be done, at once."""
        self.left: dict[tuple[str, str], float] = {}
        self.completed = {}
        self.started = self.now
        for mind in self.minds.values():
            mind.handle(TrialStarted(learning), self.now)
            for task in self.tasks:
                mind.handle(Sensed(task, applicable=True, complete=False), self.now)

    def alive(self, robot: str) -> bool:
        return self.now < self.dead_after.get(robot, float("inf"))

    def step(self) -> None:
        """Let one control period pass: work, sensing, then every living mind ticks and is heard."""
        self.now = round(self.now + self.period, 9)
        for robot, mind in self.minds.items():
            self._work(robot, mind.active if self.alive(robot) else [])
        for mind in self.minds.values():
            for task in self.completed:
                mind.handle(Sensed(task, applicable=False, complete=True), self.now)
        for robot, speak in self.ghosts.items():
            if said := speak(self.now):
                self._broadcast(robot, said)
        heard = []
        for robot, mind in self.minds.items():
            if self.alive(robot):
                for command in mind.tick(self.now):
                    if isinstance(command, Activate | Deactivate):
                        self.log.append((self.now, robot, command.decision))
                    else:
                        heard.append((robot, command))
        for sender, command in heard:
            self._broadcast(sender, command)

    def _work(self, robot: str, active: list[str]) -> None:
        for task in self.tasks:
            work = (robot if self.restarts else "team", task)
            if task in active and (robot, task) not in self.stuck:
                self.left[work] = self.left.get(work, 1.0) - self.period / self.abilities[robot][task]
                if self.left[work] <= 1e-9:
                    self.completed.setdefault(task, (self.now, robot))
            elif task not in active and self.restarts:
                self.left.pop(work, None)

    def _broadcast(self, sender: str, command: Announce) -> None:
        elsewhere = not self.parameters.is_literal(Erratum.HEARD_ELSEWHERE)
        for receiver, mind in self.minds.items():
            heard = is_heard(command.task is None, command.task in self.abilities[receiver], elsewhere)
            if receiver != sender and self.alive(receiver) and heard and self.deliver(sender, receiver, self.now):
                mind.handle(Heard(sender, command.task, command.active_for, command.expected), self.now)

    def go(self, until: float) -> list[str]:
        """Step until `until`; the log of all that was decided."""
        while self.now < until - 1e-9:
            self.step()
        return self.told()

    def run(self, until: float) -> float:
        """Steps until all tasks are complete or `until`; the makespan, or infinity."""
        while len(self.completed) < len(self.tasks) and self.now < until:
            self.step()
        done = len(self.completed) == len(self.tasks)
        return self.now - self.started if done else float("inf")

    def told(self) -> list[str]:
        """The log as short lines: instant, robot, verb, task, cause."""
        return [
            f"{at:.1f} {robot} {d.verb} {d.task} {d.cause}" + (f" {d.other}" if d.other else "")
            for at, robot, d in self.log
        ]
