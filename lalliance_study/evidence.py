"""What is left of a simulated mission for a judge: its log, its summary, and what a watcher saw robots sense and decide.

`Evidence` is plain data, so that a test can falsify it and see the judge notice. `History` is the log read once more as spans
of time: when each robot's process ran, and when each robot was on which task. Instants are seconds since the simulation began.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

from lalliance_agents.config import Mission
from lalliance_agents.model.events import Cause, Decision, Verb
from lalliance_agents.model.parameters import Erratum
from lalliance_study.logbook import Line, Timing
from lalliance_study.simulator import Simulator

_CAUSES = frozenset(cause.value for cause in Cause)
_VERBS = frozenset(verb.value for verb in Verb)


class Sight(NamedTuple):
    """A robot senses that a task stands otherwise than it knew."""

    at: float
    robot: str
    task: str
    applicable: bool
    complete: bool


class Choice(NamedTuple):
    """A robot decides about a task."""

    at: float
    robot: str
    verb: str
    task: str
    cause: str
    other: str | None
    """The teammate that the decision speaks of."""
    silent_for: float
    """How long ago that teammate was last heard on the task, in seconds; 0 if there is none."""
    ready: bool
    """Whether all factors of the set's motivation are 1."""


class Span(NamedTuple):
    """A robot was on a task."""

    robot: str
    task: str
    since: float
    until: float
    """Infinite if it still was at the end."""


class Witness:
    """Writes down what a simulator tells its watcher."""

    def __init__(self) -> None:
        self.notes: list[Sight | Choice] = []

    def sensed(self, at: float, robot: str, task: str, applicable: bool, complete: bool) -> None:
        """See `simulator.Watcher.sensed`."""
        self.notes.append(Sight(at, robot, task, applicable, complete))

    def decided(self, robot: str, decision: Decision) -> None:
        """See `simulator.Watcher.decided`."""
        factors, other = decision.factors, decision.other
        silent = 0.0
        if other is not None:
            silent = next((decision.at - mate.last_heard for mate in decision.teammates if mate.robot == other), 0.0)
        ready = (
            factors.sensory_feedback
            * factors.activity_suppression
            * factors.impatience_reset
            * factors.acquiescence
            * factors.learned_robot_influence
        ) == 1
        verb, cause = decision.verb.value, decision.cause.value
        choice = Choice(decision.at, robot, verb, decision.task, cause, other, silent, ready)
        self.notes.append(choice)


class Completion(NamedTuple):
    """The world saw a task completed."""

    trial: int
    task: str
    text: str


@dataclass(slots=True)
class _Robot:
    runs_since: float | None = None
    task: str | None = None
    on_since: float = 0.0


@dataclass
class History:
    """The log as spans of time."""

    spans: list[Span] = field(default_factory=list)
    running: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    """When each robot's process ran, from and until; the last one may be infinite."""
    births: dict[str, list[float]] = field(default_factory=dict)
    """When each robot's process was started."""
    silenced: list[tuple[float, str, str, str | None]] = field(default_factory=list)
    """When which robot was `killed` or `stopped`, and the task it was on."""
    completions: list[Completion] = field(default_factory=list)
    trials: list[float] = field(default_factory=list)
    """When each trial began, as told at the next step of the world."""
    broken: list[str] = field(default_factory=list)
    """What no log can say: a second active set, the end of one that was not active, a decision of a robot that is not there."""

    def is_on(self, robot: str, task: str, at: float) -> bool:
        """Whether `robot` was on `task` at an instant."""
        return any(one.robot == robot and one.task == task and one.since <= at < one.until for one in self.spans)

    def idle_throughout(self, robot: str, since: float, until: float) -> bool:
        """Whether `robot` was on no task from one instant to another."""
        return not any(one.robot == robot and one.since <= until and one.until > since for one in self.spans)

    def ran_throughout(self, robot: str, since: float, until: float) -> bool:
        """Whether the process of `robot` ran from one instant to another."""
        return any(start <= since and until <= end for start, end in self.running.get(robot, ()))


def read(log: Sequence[Line]) -> History:
    """The history that a log tells."""
    history = History()
    robots: dict[str, _Robot] = {}
    for line in log:
        if line.what == "process":
            _read_process(history, robots.setdefault(line.who, _Robot()), line)
        elif line.what in _VERBS and line.why in _CAUSES:
            _read_decision(history, robots.setdefault(line.who, _Robot()), line)
        elif line.what == "complete" and line.task is not None:
            history.completions.append(Completion(len(history.trials), line.task, line.why))
        elif line.what == "trial" and " begins " in line.why:
            history.trials.append(line.at)
    for name, robot in robots.items():
        _leave(history, name, robot, math.inf)
        _halt(history, name, robot, math.inf)
    return history


def _leave(history: History, name: str, robot: _Robot, at: float) -> None:
    if robot.task is not None:
        history.spans.append(Span(name, robot.task, robot.on_since, at))
        robot.task = None


def _halt(history: History, name: str, robot: _Robot, at: float) -> None:
    if robot.runs_since is not None:
        history.running.setdefault(name, []).append((robot.runs_since, at))
        robot.runs_since = None


def _read_process(history: History, robot: _Robot, line: Line) -> None:
    name, at = line.who, line.at
    if line.why in {"started", "continued"}:
        if robot.runs_since is not None:
            history.broken.append(f"{at:.3f} {name} is {line.why} while it runs")
        else:
            robot.runs_since = at
        if line.why == "started":
            history.births.setdefault(name, []).append(at)
        return
    history.silenced.append((at, name, line.why, robot.task))
    _halt(history, name, robot, at)
    if line.why == "killed":
        _leave(history, name, robot, at)


def _read_decision(history: History, robot: _Robot, line: Line) -> None:
    name, at, task = line.who, line.at, line.task or ""
    if robot.runs_since is None:
        history.broken.append(f"{at:.3f} {name} decides ({line.what} {task}) while its process does not run")
    if line.what == Verb.ACTIVATE:
        if robot.task is not None:
            history.broken.append(f"{at:.3f} {name} activates {task} while {robot.task} is active")
            _leave(history, name, robot, at)
        robot.task, robot.on_since = task, at
        return
    if robot.task != task:
        history.broken.append(f"{at:.3f} {name} ends {task} ({line.what}) while {robot.task} is active")
    _leave(history, name, robot, at)


@dataclass
class Evidence:
    """Everything that is known of one simulated mission."""

    mission: Mission
    log: list[Line]
    notes: list[Sight | Choice]
    summary: dict[str, Any]
    began: float
    """When the last trial began; the account of the world counts from there."""
    ended: float
    """When the simulation ended."""
    live: bool
    """Whether the last trial that began is the live one, in which faults happen."""
    message_delay: float
    """Of every message before link rules, in seconds."""

    @cached_property
    def history(self) -> History:
        """The log as spans of time."""
        return read(self.log)

    @property
    def live_for(self) -> float:
        """How long the last trial lasted, in seconds."""
        return self.ended - self.began

    @cached_property
    def several_sets(self) -> bool:
        """Whether a robot may have several active sets (erratum 5, literal): what it is on is then not told by its log."""
        return any(self.mission.parameters_of(robot).is_literal(Erratum.ONE_ACTIVE) for robot in self.mission.robots)

    def choices(self) -> Iterator[Choice]:
        """The decisions, in order."""
        return (note for note in self.notes if isinstance(note, Choice))


def gather(mission: Mission, *, every_step: bool = False) -> Evidence:
    """Simulate a mission and keep the evidence.

    Args:
        mission: a mission that passed `environments.check_options`.
        every_step: whether to make every control step.
    """
    witness = Witness()
    simulator = Simulator(mission, every_step=every_step, watcher=witness)
    simulator.run()
    return collect(simulator, witness)


def collect(simulator: Simulator, witness: Witness) -> Evidence:
    """The evidence of a mission that is over; its faults are those that came to pass, also by injection.

    Args:
        simulator: which has moved it, with the usual `Timing`.
        witness: its watcher.
    """
    world = simulator.world
    return Evidence(
        mission=simulator.mission.model_copy(update={"faults": world.failures.faults()}),
        log=simulator.log,
        notes=witness.notes,
        summary=world.summary(),
        began=world.began,
        ended=simulator.now,
        live=world.live,
        message_delay=Timing().message_delay,
    )
