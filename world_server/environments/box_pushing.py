"""A long box that is pushed at its two ends, after Parker's demonstration on real robots.

There, two R-2 robots could push either end and a slower Genghis-II only one of them, and the box had to be kept roughly
straight: no end can be pushed on while it is ahead of the other by more than a little. So the two tasks (the mission's first
is the left end, the second the right one) depend on each other all the time, and a robot left alone must go to and fro.

An end's position runs from 0 to 1, its goal, and is the progress of its task. A robot's own time is what it needs to push
that end over the whole way alone. The rules:

- An end moves at the speed of the fastest robot that pushes it; a second robot adds nothing.
- An end is never further than `slack` ahead of the other. With both ends pushed, the faster one is carried along from there
  at the other's speed. With the other end at rest it jams.
- A jammed end is not applicable and does not move. It comes free when the other end has caught up to half the slack, or as
  soon as both ends are pushed together. Half, and not a hair, because an end that came free at once would call a lone robot
  back for a push as short as that: it would run between the ends all day. So each of its pushes carries an end by at
  least half the slack.

This module does not know who turns to which end, and why.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from lalliance_agents.config import Mission, misplaced
from lalliance_agents.model.parameters import SLACK, Record
from world_server.environments.base import EventDriven, TaskView, Work

#: Two positions this close are one, as a share of the way: many roundings of 1.1e-16, and nothing anybody could see.
ROUNDING = 1e-12

ENDS = (0, 1)


@dataclass(frozen=True, slots=True)
class Motion:
    """What a set of actions does to the two ends, from where they are now."""

    pushers: tuple[tuple[str, ...], tuple[str, ...]]
    """The fastest robots at each end, in order of name."""
    jammed: tuple[bool, bool]
    """Whether the end is held by the other, which lags behind."""
    carried: tuple[bool, bool]
    """Whether the end is at its furthest and kept there by the other, which is no faster."""
    speeds: tuple[float, float]
    """How fast each end moves, in shares of the way per second."""


class BoxPushing(EventDriven):
    """The environment of this file."""

    class Options(Record):
        """What a mission can choose."""

        slack: Annotated[float, Field(ge=0.001, le=1, allow_inf_nan=False)] = 0.1
        """How far an end may be ahead of the other, as a share of the way; with 0.001 a lone robot turns 1000 times."""

    @classmethod
    def check(cls, mission: Mission) -> None:
        """Two tasks, the ends, that start together and do not wait for each other."""
        super().check(mission)
        if len(mission.tasks) != 2:
            raise misplaced(("tasks",), f"box_pushing has two ends; expected 2 tasks, not {len(mission.tasks)}")
        for name, task in mission.tasks.items():
            if task.after:
                raise misplaced(("tasks", name, "after"), "an end of the box cannot come after the other one")
            if task.arrives:
                raise misplaced(("tasks", name, "arrives"), "an end of the box is there from the start; expected 0")

    def __init__(self, mission: Mission, *, seed: int) -> None:  # noqa: ARG002 - nothing here is random
        self._slack = self.Options.model_validate(mission.environment.options).slack
        left, right = mission.tasks
        self._tasks = (left, right)
        self._own_times = {robot: dict(spec.tasks) for robot, spec in mission.robots.items()}
        self._at = [0.0, 0.0]
        self._complete = [False, False]
        self._jammed = (False, False)
        self._actions: Mapping[str, Work] = {}
        self._motion = self._motion_under({})

    def next_change(self, actions: Mapping[str, Work]) -> float:
        """See `Environment.next_change`."""
        motion = self._motion_under(actions)
        return min(wait(end, motion) for end in ENDS for wait in (self._to_goal, self._to_limit, self._to_release))

    def sense(self) -> dict[str, TaskView]:
        """See `Environment.sense`."""
        return {self._tasks[end]: self._view(end) for end in ENDS}

    def _view(self, end: int) -> TaskView:
        complete = self._complete[end]
        return TaskView(complete=complete, applicable=not (complete or self._jammed[end]), progress=self._at[end])

    def _limit(self, end: int) -> float:
        """The furthest position that `end` can have just now; infinite where its goal comes first."""
        limit = self._at[1 - end] + self._slack
        return limit if limit < 1 - ROUNDING else math.inf

    def _is_furthest(self, end: int) -> bool:
        return self._at[end] >= self._limit(end) - ROUNDING

    def _catching_up(self, end: int) -> float:
        """What the other end has yet to move for `end` to come free, as a share of the way; 0 or less: nothing."""
        return self._at[end] - self._at[1 - end] - self._slack / 2

    def _motion_under(self, actions: Mapping[str, Work]) -> Motion:
        pushes = [self._push(end, actions) for end in ENDS]
        pushed = (pushes[0][0], pushes[1][0])
        jammed = (self._jams(0, pushed), self._jams(1, pushed))
        carried = (self._is_carried(0, pushed), self._is_carried(1, pushed))
        speeds = [0.0 if jammed[end] else pushed[1 - end] if carried[end] else pushed[end] for end in ENDS]
        return Motion((pushes[0][1], pushes[1][1]), jammed, carried, (speeds[0], speeds[1]))

    def _is_carried(self, end: int, pushed: tuple[float, float]) -> bool:
        return self._is_furthest(end) and pushed[end] >= pushed[1 - end] > 0

    def _push(self, end: int, actions: Mapping[str, Work]) -> tuple[float, tuple[str, ...]]:
        """The speed at which `end` is pushed, and the robots that are as fast as that."""
        if self._complete[end]:
            return 0.0, ()
        task = self._tasks[end]
        speeds = {
            robot: work.pace / self._own_times[robot][task]
            for robot, work in actions.items()
            if work.task == task and work.pace > 0 and task in self._own_times.get(robot, {})
        }
        fastest = max(speeds.values(), default=0.0)
        return fastest, tuple(sorted(robot for robot, speed in speeds.items() if speed >= fastest * (1 - 1e-9)))

    def _jams(self, end: int, pushed: tuple[float, float]) -> bool:
        if self._complete[end] or min(pushed) > 0 or self._catching_up(end) <= ROUNDING:
            return False
        return self._jammed[end] or (self._is_furthest(end) and pushed[1 - end] == 0)

    def _to_goal(self, end: int, motion: Motion) -> float:
        """How long until `end` is at its goal, in seconds."""
        return _time_for(1 - self._at[end], motion.speeds[end])

    def _to_limit(self, end: int, motion: Motion) -> float:
        """How long until `end` is as far ahead as it can be, in seconds."""
        if self._is_furthest(end):
            return math.inf
        return _time_for(self._limit(end) - self._at[end], motion.speeds[end] - motion.speeds[1 - end])

    def _to_release(self, end: int, motion: Motion) -> float:
        """How long until `end` is no longer jammed, in seconds."""
        if not motion.jammed[end]:
            return math.inf
        return _time_for(self._catching_up(end), motion.speeds[1 - end])

    def _take_up(self, actions: Mapping[str, Work]) -> None:
        self._actions = dict(actions)
        self._motion = self._motion_under(actions)
        self._jammed = self._motion.jammed

    def _advance(self, dt: float) -> None:
        if dt == 0:
            return
        for end in ENDS:
            self._at[end] = min(self._at[end] + self._motion.speeds[end] * dt, 1.0)
        for end in ENDS:
            if self._motion.carried[end]:
                # Derived and not added up, so that the two cannot drift apart by rounding.
                self._at[end] = min(self._at[1 - end] + self._slack, 1.0)

    def _settle(self) -> list[tuple[str, tuple[str, ...]]]:
        motion = self._motion
        at_goal = [end for end in ENDS if self._to_goal(end, motion) <= SLACK]
        at_limit = [end for end in ENDS if self._to_limit(end, motion) <= SLACK]
        released = [end for end in ENDS if self._to_release(end, motion) <= SLACK]
        for end in at_limit:
            self._at[end] = self._limit(end)
        for end in at_goal:
            self._at[end] = 1.0
            self._complete[end] = True
        self._jammed = (self._jammed[0] and 0 not in released, self._jammed[1] and 1 not in released)
        self._take_up(self._actions)
        return [(self._tasks[end], motion.pushers[end]) for end in at_goal]


def _time_for(way: float, speed: float) -> float:
    """How long a share `way` takes at `speed` shares per second, in seconds."""
    if speed <= 0:
        return math.inf
    return max(way, 0.0) / speed
