"""Two drivers of the same team: one that ticks at every instant of its grid, and one that skips what it may.

The world around them is a heap of events: messages with losses and delays, tasks that complete, scripted changes of sensing,
failures of bodies, new trials. What chance decides hangs on what it is about, never on the order in which it is asked, so
that two runs of a scene differ in nothing but the driver. Events of an instant come before the steps of that instant.
"""

import heapq
import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field

from lalliance_agents.model.events import (
    Activate,
    Announce,
    BodyFailed,
    Command,
    Deactivate,
    Event,
    Heard,
    RosterKnown,
    Sensed,
    TrialStarted,
)
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.monitor import Record
from lalliance_agents.model.parameters import Learning, Parameters

SENSING, HEARING, STEPPING = range(3)


@dataclass(frozen=True)
class Scene:
    """Everything that shapes one run. Instants and lengths in seconds."""

    abilities: Mapping[str, Mapping[str, float]]
    parameters: Parameters = field(default_factory=Parameters)
    period: float = 0.1
    phases: Mapping[str, float] = field(default_factory=dict)
    known: Mapping[str, Mapping[str, Record]] = field(default_factory=dict)
    trials: tuple[tuple[float, Learning], ...] = ((0.0, Learning.ADAPTIVE),)
    applicable: tuple[tuple[float, str, bool], ...] = ()
    failures: tuple[tuple[float, str], ...] = ()
    """Instants at which the bodies of robots fail at what they do."""
    stuck: frozenset[tuple[str, str]] = frozenset()
    silent: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    dead_after: Mapping[str, float] = field(default_factory=dict)
    loss: float = 0.0
    delay: float = 0.01
    """The longest delay of a message."""
    seed: int = 0

    def chance(self, *about: object) -> float:
        return random.Random(f"{self.seed}/{about}").random()


@dataclass(frozen=True)
class Message:
    said: Announce
    sent: float
    sender: str
    attempt: float
    """When the sender's attempt began; what it is on, and this, make messages one run."""

    @property
    def heard(self) -> Heard:
        return Heard(self.sender, self.said.task, self.said.active_for, self.said.expected)

    def goes_on_with(self, earlier: "Message", now: float, tau: float) -> bool:
        """Whether the sender knows that this belongs to one run with `earlier`."""
        same = (self.said.task, self.said.expected, self.attempt) == (
            earlier.said.task,
            earlier.said.expected,
            earlier.attempt,
        )
        return same and self.said.active_for >= earlier.said.active_for and now - self.sent < tau


class Driver:
    """Ticks at every step, and hands in every message at once."""

    def __init__(self, world: "World", robot: str) -> None:
        scene = world.scene
        self.world, self.robot = world, robot
        self.period, self.phase = scene.period, scene.phases.get(robot, 0.0)
        self.mind = Mind(
            robot,
            list(scene.abilities[robot]),
            scene.parameters,
            now=0.0,
            draw=random.Random(f"{scene.seed}/{robot}").random,
        )
        mates = {k for k, able in scene.abilities.items() if k != robot and able.keys() & scene.abilities[robot].keys()}
        self.mind.handle(RosterKnown(frozenset(mates)), 0.0)
        self.mind.knowledge.restore(scene.known)
        self.index = -1
        self.planned = 0
        self.ticks = 0
        world.push(self.grid(0), STEPPING, robot, "", 0)

    def grid(self, index: int) -> float:
        return self.phase + index * self.period

    def before(self, index: int) -> float:
        return self.grid(index - 1) if index > 0 else 0.0

    def feed(self, event: Event, now: float) -> None:
        self.mind.handle(event, now)

    def hear(self, message: Message, now: float) -> None:
        self.mind.handle(message.heard, now)

    def step(self, index: int) -> list[Command]:
        self.index = index
        self.plan(index + 1)
        return self.tick(self.grid(index))

    def plan(self, index: int) -> None:
        self.planned = index
        self.world.push(self.grid(index), STEPPING, self.robot, "", index)

    def tick(self, now: float) -> list[Command]:
        self.ticks += 1
        return self.mind.tick(now)

    def finish(self) -> None:
        """Nothing is held back."""


class Skipper(Driver):
    """Ticks where it must, and holds back all of a run of messages but the last."""

    def __init__(self, world: "World", robot: str) -> None:
        super().__init__(world, robot)
        self.pending: dict[str, tuple[Message, float]] = {}

    def first_from(self, instant: float) -> int:
        """The first step not before `instant` that is still to come."""
        index = self.index + 1
        if instant > self.grid(index):
            index = max(index, math.floor((instant - self.phase) / self.period) - 1)
        while self.grid(index) < instant:
            index += 1
        return index

    def feed(self, event: Event, now: float) -> None:
        self.finish()
        super().feed(event, now)
        self.replan(now)

    def hear(self, message: Message, now: float) -> None:
        earlier = self.pending.get(message.sender)
        if earlier and message.goes_on_with(earlier[0], now, self.mind.parameters.silence_timeout):
            self.pending[message.sender] = message, now
            return
        if earlier:
            del self.pending[message.sender]
            self.mind.handle(earlier[0].heard, earlier[1])
        if self.mind.is_refresh(message.heard, now):
            self.pending[message.sender] = message, now
        else:
            self.mind.handle(message.heard, now)
            self.replan(now)

    def finish(self) -> None:
        for message, arrived in self.pending.values():
            self.mind.handle(message.heard, arrived)
        self.pending.clear()

    def replan(self, now: float) -> None:
        """The next step that cannot be skipped, seen from `now`."""
        wanted = min(self.mind.wake(), self.mind.next_lapse())
        index = self.next_beat()
        if max(wanted, now) < self.grid(index):
            index = min(index, self.first_from(max(wanted, now)))
        if index != self.planned or self.index == self.planned:
            self.plan(index)

    def next_beat(self) -> int:
        index = self.first_from(self.mind.cadence.due - 2 * self.period)
        while not self.mind.cadence.is_due(self.grid(index), self.before(index)):
            index += 1
        return index

    def step(self, index: int) -> list[Command]:
        if index != self.planned:
            return []
        now = self.grid(index)
        self.index = index
        self.mind.rest(self.before(index))
        if now >= self.mind.next_lapse():
            self.finish()
        if now >= min(self.mind.wake(), self.mind.next_lapse()):
            self.finish()
            commands = self.tick(now)
        else:
            commands = self.mind.beat(now)
        self.replan(now)
        return commands


class World:
    """Runs a scene with one kind of driver."""

    def __init__(self, scene: Scene, kind: type[Driver]) -> None:
        self.scene = scene
        self.heap: list[tuple[float, int, str, str, int, object]] = []
        self.log: list[tuple[float, str, Command]] = []
        self.complete: set[str] = set()
        self.sent = 0
        self.began: dict[str, float] = {}
        self.trial = 0
        self.drivers = {robot: kind(self, robot) for robot in scene.abilities}
        for number, (at, learning) in enumerate(scene.trials):
            self.push(at, SENSING, "", "", number, TrialStarted(learning))
        for number, (at, task, applicable) in enumerate(scene.applicable):
            self.push(at, SENSING, "", task, number, Sensed(task, applicable=applicable, complete=False))
        for number, (at, robot) in enumerate(scene.failures):
            self.push(at, SENSING, robot, "fails", number, BodyFailed(""))

    def push(self, at: float, rank: int, robot: str, about: str, number: int, what: object = None) -> None:
        heapq.heappush(self.heap, (at, rank, robot, about, number, what))

    def run(self, until: float) -> "World":
        while self.heap and self.heap[0][0] <= until:
            now, rank, robot, about, number, what = heapq.heappop(self.heap)
            if robot and now >= self.scene.dead_after.get(robot, math.inf):
                continue
            if rank == STEPPING:
                self._perform(robot, now, self.drivers[robot].step(number))
            elif isinstance(what, Message):
                self.drivers[robot].hear(what, now)
            else:
                self._sense(robot, about, now, what)
        for driver in self.drivers.values():
            driver.finish()
        return self

    def _sense(self, robot: str, about: str, now: float, what: object) -> None:
        match what:
            case TrialStarted():
                self.complete.clear()
                self.began.clear()
                self.trial += 1
                for task in sorted({task for able in self.scene.abilities.values() for task in able}):
                    self._tell(Sensed(task, applicable=True, complete=False), now, first=what)
            case Sensed():
                if about not in self.complete:
                    self._tell(what, now)
            case BodyFailed():
                for task in self.drivers[robot].mind.active:
                    self.drivers[robot].feed(BodyFailed(task), now)
            case (float() as began, int() as trial):
                done = self.began.get(robot) == began and trial == self.trial
                if done and about in self.drivers[robot].mind.active and about not in self.complete:
                    self.complete.add(about)
                    self._tell(Sensed(about, applicable=False, complete=True), now)

    def _tell(self, sensed: Sensed, now: float, first: Event | None = None) -> None:
        for robot, driver in self.drivers.items():
            if now < self.scene.dead_after.get(robot, math.inf) and sensed.task in self.scene.abilities[robot]:
                if first is not None and sensed.task == next(iter(self.scene.abilities[robot])):
                    driver.feed(first, now)
                driver.feed(sensed, now)

    def _perform(self, robot: str, now: float, commands: list[Command]) -> None:
        for command in commands:
            self.log.append((now, robot, command))
            match command:
                case Activate(decision):
                    self.began[robot] = now
                    if (robot, decision.task) not in self.scene.stuck:
                        ends = now + self.scene.abilities[robot][decision.task]
                        self.push(ends, SENSING, robot, decision.task, self.trial, (now, self.trial))
                case Deactivate():
                    self.began.pop(robot, None)
                case Announce():
                    self._broadcast(robot, now, command)

    def _broadcast(self, sender: str, now: float, said: Announce) -> None:
        since, until = self.scene.silent.get(sender, (math.inf, math.inf))
        message = Message(said, now, sender, self.began.get(sender, -1.0))
        for robot in self.drivers:
            if (
                robot == sender
                or since <= now < until
                or self.scene.chance("loss", sender, robot, now) < self.scene.loss
            ):
                continue
            arrival = now + 1e-4 + self.scene.delay * self.scene.chance("delay", sender, robot, now)
            self.sent += 1
            self.push(arrival, HEARING, robot, sender, self.sent, message)

    @property
    def ticks(self) -> int:
        return sum(driver.ticks for driver in self.drivers.values())

    def told(self) -> str:
        """All that was decided and said, and what was learned, to the last bit (and an unknown time equal to another)."""
        learned = {robot: driver.mind.knowledge.records() for robot, driver in self.drivers.items()}
        return "\n".join(map(repr, [*self.log, *learned.items()]))
