"""Independent tasks that are done by spending time on them.

A robot that can do a task finishes it alone in its own time, if nothing else happens. A task can be worked on once it has
arrived and the tasks it comes after are complete. What a second robot finds is the mission's choice (`hand_over`):

- `shared_max`: the work left belongs to the task, and the fastest robot on it counts;
- `shared_add`: the work left belongs to the task, and the rates of all robots on it add up;
- `restart`: each attempt starts from zero, is on its own, and is lost when the robot leaves.

Work is measured as a share of the task, 0 to 1, and a rate in shares per second is a robot's pace divided by the time of its
attempt. That time is the robot's own time, blurred by `noise` anew for each attempt. An attempt lasts while the robot acts on
the task in every step, also while the task is not yet applicable and while its pace is 0.

This module does not know why a robot stops, who is allowed to work, or what a box is.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal, Protocol, get_args
from zlib import crc32

import numpy as np
from pydantic import Field

from lalliance_agents.config import Mission
from lalliance_agents.model.parameters import SLACK, Record
from world_server.environments.base import EventDriven, TaskView, Work

#: A share this near to 1 is 1. Adding the share that was missing leaves at most four roundings of 1.1e-16 each.
ROUNDING = 1e-15

HandOver = Literal["shared_max", "shared_add", "restart"]
HAND_OVERS: tuple[HandOver, ...] = get_args(HandOver)


def deviation(seed: int, robot: str, task: str, number: int) -> float:
    """How far the time of a robot's `number`-th attempt on a task is off, from -1 to 1, uniform.

    A function of its arguments alone: neither the order of attempts nor the rest of the team changes it. Each part of the
    key is one 32-bit word, so that no two keys run together.
    """
    key = (crc32(robot.encode()), crc32(task.encode()), number)
    return float(np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key)).uniform(-1.0, 1.0))


@dataclass(slots=True)
class Attempt:
    """One robot's uninterrupted work on one task."""

    number: int
    """1 for the robot's first attempt on the task."""
    time: float
    """What it would take alone at the robot's own pace, in seconds."""
    rate: float
    """What the robot does of the task at its present pace, in shares per second."""
    done: float = 0.0
    """What this attempt has done by itself, as a share; used where work restarts."""


class Crew(dict[str, Attempt]):
    """The attempts on one task, by robot; none joins or leaves, or changes its rate, once a rate was asked for."""

    @cached_property
    def fastest(self) -> float:
        """The greatest rate, in shares per second."""
        return max(attempt.rate for attempt in self.values())

    @cached_property
    def together(self) -> float:
        """All rates, in shares per second."""
        return math.fsum(attempt.rate for attempt in self.values())


_NOBODY = Crew()
#: What a complete task looks like.
_DONE = TaskView(complete=True, applicable=False, progress=1.0)


class TaskWork(Protocol):
    """How the work of a crew on one task adds up."""

    def progress(self, crew: Crew) -> float:
        """Share of the task that is done, 0 to 1."""

    def time_left(self, crew: Crew) -> float:
        """How long until the task is complete if the crew goes on, in seconds."""

    def advance(self, crew: Crew, dt: float) -> None:
        """Let the crew work for `dt` seconds."""

    def finishers(self, crew: Crew) -> Iterable[str]:
        """Whose work completes a task that is due."""


class SharedMax:
    """The work left belongs to the task; the fastest robot counts."""

    def __init__(self) -> None:
        self._done = 0.0

    def progress(self, crew: Crew) -> float:  # noqa: ARG002 - what is done stays, whoever is there
        """See `TaskWork.progress`."""
        return min(self._done, 1.0)

    def time_left(self, crew: Crew) -> float:
        """See `TaskWork.time_left`."""
        return _time_left(self._done, self._rate(crew))

    def advance(self, crew: Crew, dt: float) -> None:
        """See `TaskWork.advance`."""
        self._done += self._rate(crew) * dt

    def finishers(self, crew: Crew) -> Iterable[str]:
        """The fastest; with equals, all of them (pace and time may be equal but for rounding)."""
        fastest = self._rate(crew)
        return [robot for robot, attempt in crew.items() if attempt.rate >= fastest * (1 - 1e-9)]

    def _rate(self, crew: Crew) -> float:
        return crew.fastest


class SharedAdd(SharedMax):
    """The work left belongs to the task; rates add up."""

    def finishers(self, crew: Crew) -> Iterable[str]:
        """Everyone who works."""
        return [robot for robot, attempt in crew.items() if attempt.rate > 0]

    def _rate(self, crew: Crew) -> float:
        return crew.together


class Restart:
    """Each attempt works for itself, from zero."""

    def progress(self, crew: Crew) -> float:
        """What the best attempt has done."""
        return min(max((attempt.done for attempt in crew.values()), default=0.0), 1.0)

    def time_left(self, crew: Crew) -> float:
        """See `TaskWork.time_left`."""
        return min(_time_left(attempt.done, attempt.rate) for attempt in crew.values())

    def advance(self, crew: Crew, dt: float) -> None:
        """See `TaskWork.advance`."""
        for attempt in crew.values():
            attempt.done += attempt.rate * dt

    def finishers(self, crew: Crew) -> Iterable[str]:
        """Whose attempt is at its end."""
        return [robot for robot, attempt in crew.items() if _time_left(attempt.done, attempt.rate) <= SLACK]


WORK: dict[HandOver, type[TaskWork]] = {"shared_max": SharedMax, "shared_add": SharedAdd, "restart": Restart}


class TaskPool(EventDriven):
    """The environment of this file."""

    class Options(Record):
        """What a mission can choose."""

        hand_over: HandOver = "shared_max"
        """What a second robot finds: `shared_max`, `shared_add` or `restart`."""
        noise: Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)] = 0.0
        """Each attempt takes the robot's own time times 1 +- up to this share."""

    def __init__(self, mission: Mission, *, seed: int) -> None:
        options = self.Options.model_validate(mission.environment.options)
        self._seed = seed
        self._noise = options.noise
        self._own_times = {
            (robot, task): time for robot, spec in mission.robots.items() for task, time in spec.tasks.items()
        }
        self._now = 0.0
        self._work = {task: WORK[options.hand_over]() for task in mission.tasks}
        self._complete: set[str] = set()
        # What keeps each task from being worked on: its open prerequisites and, while that is to come, its arrival.
        self._waits_for = {task: set(spec.after) for task, spec in mission.tasks.items()}
        self._not_arrived = {task: spec.arrives for task, spec in mission.tasks.items() if spec.arrives > 0}
        self._next_arrival = min(self._not_arrived.values(), default=math.inf)
        self._actions: Mapping[str, Work] = {}
        self._crews: dict[str, Crew] = {}
        #: How long until something changes while `_actions` stay the same, in seconds; None where that is to be looked up.
        self._wait: float | None = None
        self._begun: dict[tuple[str, str], int] = {}

    def next_change(self, actions: Mapping[str, Work]) -> float:
        """See `Environment.next_change`."""
        if actions != self._actions:
            return self._next_change(self._crews_under(actions))
        if self._wait is None:
            self._wait = self._next_change(self._crews)
        return self._wait

    def _next_change(self, crews: Mapping[str, Crew]) -> float:
        soonest = self._next_arrival - self._now
        for task, crew in crews.items():
            if self._is_open(task):
                soonest = min(soonest, self._work[task].time_left(crew))
        return max(soonest, 0.0)

    def sense(self) -> dict[str, TaskView]:
        """See `Environment.sense`."""
        return {task: _DONE if task in self._complete else self._view(task) for task in self._work}

    @property
    def is_complete(self) -> bool:
        """See `Environment.is_complete`."""
        return len(self._complete) == len(self._work)

    def _view(self, task: str) -> TaskView:
        progress = self._work[task].progress(self._crews.get(task, _NOBODY))
        return TaskView(complete=False, applicable=self._is_open(task), progress=progress)

    def _is_open(self, task: str) -> bool:
        return not (self._waits_for[task] or task in self._not_arrived or task in self._complete)

    def _take_up(self, actions: Mapping[str, Work]) -> None:
        if actions == self._actions:
            return
        self._crews = self._crews_under(actions)
        self._actions = dict(actions)
        self._wait = None
        for task, crew in self._crews.items():
            for robot, attempt in crew.items():
                self._begun[robot, task] = attempt.number

    def _crews_under(self, actions: Mapping[str, Work]) -> dict[str, Crew]:
        """The attempts in force while robots do `actions`, by task: those that go on, and new ones."""
        if actions == self._actions:
            return self._crews
        crews: dict[str, Crew] = {}
        for robot, work in actions.items():
            if (robot, work.task) in self._own_times and work.task not in self._complete:
                crews.setdefault(work.task, Crew())[robot] = self._attempt(robot, work)
        return crews

    def _attempt(self, robot: str, work: Work) -> Attempt:
        current = self._crews.get(work.task, _NOBODY).get(robot)
        if current is not None:
            rate = work.pace / current.time
            return current if rate == current.rate else replace(current, rate=rate)
        number = self._begun.get((robot, work.task), 0) + 1
        time = self._own_times[robot, work.task]
        if self._noise:
            time *= 1 + self._noise * deviation(self._seed, robot, work.task, number)
        return Attempt(number, time, work.pace / time)

    def _advance(self, dt: float) -> None:
        if dt == 0:
            return
        self._wait = None
        self._now += dt
        for task, crew in self._crews.items():
            if self._is_open(task):
                self._work[task].advance(crew, dt)

    def _settle(self) -> list[tuple[str, tuple[str, ...]]]:
        if self._next_arrival - self._now <= SLACK:
            self._not_arrived = {
                task: arrives for task, arrives in self._not_arrived.items() if arrives - self._now > SLACK
            }
            self._next_arrival = min(self._not_arrived.values(), default=math.inf)
        self._wait = None
        due = [task for task in self._work if self._is_due(task)]
        return [(task, self._finish(task)) for task in due]

    def _is_due(self, task: str) -> bool:
        crew = self._crews.get(task)
        return crew is not None and self._is_open(task) and self._work[task].time_left(crew) <= SLACK

    def _finish(self, task: str) -> tuple[str, ...]:
        finishers = tuple(sorted(self._work[task].finishers(self._crews.pop(task))))
        self._complete.add(task)
        for needed in self._waits_for.values():
            needed.discard(task)
        return finishers


def _time_left(done: float, rate: float) -> float:
    """How long until a share of `done` has grown to 1 at `rate` shares per second, in seconds."""
    if rate <= 0:
        return math.inf
    return (1 - done) / rate if 1 - done > ROUNDING else 0.0
