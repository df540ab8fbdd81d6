"""A toy world for the model's tests: minds on a common clock, messages without delay, work that just takes its time.

It has no bus and no environment, so that what a test sees here is the model's doing alone. All minds tick together, in
order; what one announces the others hear before the next step.
"""

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

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
from lalliance_agents.model.parameters import Learning, Parameters


@dataclass
class Arena:
    """Runs minds.

    Args:
        abilities: robot -> task -> own time in seconds.
        parameters: of every robot.
        period: the control period, in seconds.
        given: whether robots know all the times they share from the start.
        dead_after: robot -> instant from which it neither works nor sends nor hears.
        stuck: (robot, task) pairs that never progress.
    """

    abilities: Mapping[str, Mapping[str, float]]
    parameters: Parameters = field(default_factory=Parameters)
    period: float = 0.1
    given: bool = False
    learning: Learning = Learning.ADAPTIVE
    dead_after: Mapping[str, float] = field(default_factory=dict)
    stuck: frozenset[tuple[str, str]] = frozenset()
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
            mind.handle(RosterKnown(frozenset(mates)), 0.0)
            if self.given:
                known = {
                    task: {k: Record((own[task],)) for k, own in self.abilities.items() if task in own}
                    for task in self.tasks
                }
                mind.knowledge.restore(known)
        self.now = 0.0
        self.log: list[tuple[float, str, Decision]] = []
        self.completed: dict[str, tuple[float, str]] = {}
        self.begin(self.learning)

    def begin(self, learning: Learning) -> None:
        """Start a trial: all work is to be done, at once."""
        self.left = dict.fromkeys(self.tasks, 1.0)
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
            for task in mind.active if self.alive(robot) else []:
                if (robot, task) not in self.stuck:
                    self.left[task] -= self.period / self.abilities[robot][task]
                    if self.left[task] <= 1e-9 and task not in self.completed:
                        self.completed[task] = (self.now, robot)
        for mind in self.minds.values():
            for task in self.completed:
                mind.handle(Sensed(task, applicable=False, complete=True), self.now)
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

    def _broadcast(self, sender: str, command: Announce) -> None:
        for receiver, mind in self.minds.items():
            shares = command.task is None or command.task in self.abilities[receiver]
            if receiver != sender and self.alive(receiver) and shares and self.deliver(sender, receiver, self.now):
                mind.handle(Heard(sender, command.task, command.active_for, command.expected), self.now)

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
