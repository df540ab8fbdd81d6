"""What a plan is, and what becomes of it: robots work through queues of tasks, die, and somebody plans anew.

This is the stage on which `baselines` are compared with L-ALLIANCE. It works on plain arrays: `times[robots, tasks]`, the
seconds a robot needs for a task, infinite where it cannot do it; `deaths[robots]`, the instants at which robots die silently;
and `lives[robots]`, how long they can work before they do; infinite where they do not. It keeps to the world's model of the
task pool:

- a robot does one task at a time, its queue in order, and never leaves a task that it has begun;
- a death interrupts the robot's task. With `restart` that attempt's work is lost; with `shared_max` and `shared_add` the work
  left belongs to the task. A task that is finished at the very instant of its robot's death is finished;
- nobody is on a task that another robot is on: no planner here makes teams, so that the two kinds of sharing are the same.

Planners are favoured in every respect but one. They know true times, they are told at once what is done, planning takes no
time, and messages are never lost. But a death is noticed only after `detection` seconds; until then the dead robot's tasks
wait. Then the planner is asked again, with all tasks that nobody has begun; it is not asked if the robot left nothing to do.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lalliance_agents.errors import UserError
from lalliance_study.assignments import Floats, check_times
from world_server.environments.task_pool import HandOver

#: How long a death goes unnoticed by default, in seconds: a robot's `silence_timeout`.
DETECTION = 1.0
#: The least share that is left of a task which is not done; rounding must not leave nothing.
NEARLY_NOTHING = 1e-12


@dataclass(frozen=True, eq=False, slots=True)
class Situation:
    """What a planner is asked about."""

    times: Floats
    """Seconds a robot still needs for a task, `[robots, tasks]`; infinite where it cannot do it, and all along its row once
    it is known to be dead."""
    ready: Floats
    """Seconds until a robot is through with the task it is on, `[robots]`."""
    open: tuple[int, ...]
    """The tasks to plan: not done, begun by nobody, and within the power of a robot not known to be dead."""
    queues: tuple[tuple[int, ...], ...]
    """The plan so far, without what is not open any more; a dead robot's queue is empty."""
    chance: np.random.Generator
    """Where a planner's randomness comes from."""

    @property
    def lost(self) -> tuple[int, ...]:
        """The open tasks that are in no queue."""
        queued = {task for queue in self.queues for task in queue}
        return tuple(task for task in self.open if task not in queued)


Plan = Sequence[Sequence[int]]
"""Per robot the tasks it will do after the one it is on, in order; every open task in exactly one queue."""
Planner = Callable[[Situation], Plan]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a mission."""

    makespan: float
    """When the last task was done, in seconds; infinite if not all were."""
    done_at: tuple[float, ...]
    """Per task, in seconds; infinite if it was not done."""
    done_by: tuple[int, ...]
    """Per task its robot; -1 if it was not done."""
    reallocations: int
    """How often a plan gave a task to another robot than the plan before."""
    plans: int
    """How often the planner was asked."""


def carry_out(
    planner: Planner,
    times: Floats,
    deaths: Floats | None = None,
    *,
    lives: Floats | None = None,
    hand_over: HandOver = "restart",
    detection: float = DETECTION,
    seed: int = 0,
) -> Outcome:
    """Carry out a mission by a planner's plans. The same arguments give the same outcome.

    Args:
        planner: makes the plans.
        times: as above.
        deaths: as above; by default nobody dies.
        lives: as above; by default all can work for ever.
        hand_over: what is left of a task whose robot has died.
        detection: how long a death goes unnoticed, in seconds.
        seed: of all that the planner draws.

    Raises:
        UnreachableTaskError: a task that no robot can do.
        UserError: an argument that is none.
        ValueError: the planner's plan is none.
    """
    table = check_times(times)
    dies = _of_each_robot(table, "deaths", deaths)
    lasts = _of_each_robot(table, "lives", lives)
    if not 0 <= detection < math.inf:
        raise UserError(f"a death is noticed after {detection:g} s; expected a finite time of at least 0")
    run = _Run(planner, table, dies, lasts, detection, shared=hand_over != "restart", seed=seed)
    run.to_the_end()
    return Outcome(max(run.done_at, default=0.0), tuple(run.done_at), tuple(run.done_by), run.reallocations, run.plans)


def _of_each_robot(times: Floats, what: str, given: Floats | None) -> Floats:
    """A time of each robot, `[robots]` in seconds; infinite if none is given.

    Raises:
        UserError: it is none.
    """
    made = np.full(len(times), math.inf) if given is None else np.array(given, dtype=np.float64)
    if made.shape != (len(times),) or not (made >= 0).all():
        raise UserError(f"{what} is {made}; expected a time of at least 0 for each of {len(times)} robots")
    return made


class _Run:
    """A mission that is being carried out."""

    def __init__(
        self,
        planner: Planner,
        times: Floats,
        deaths: Floats,
        lives: Floats,
        detection: float,
        *,
        shared: bool,
        seed: int,
    ) -> None:
        robots, tasks = times.shape
        self._planner, self._times, self._shared, self._detection = planner, times, shared, detection
        #: When each robot dies, by all that is known so far, and how long it can still work.
        self._deaths, self._lives = deaths, lives
        self._chance = np.random.default_rng(seed)
        self._now = 0.0
        self._left = np.ones(tasks)
        self._queues: list[list[int]] = [[] for _ in range(robots)]
        self._on: list[int | None] = [None] * robots
        self._began = np.zeros(robots)
        #: When a robot is through with its task; what planners believe of a dead one until its death is noticed.
        self._ends = np.full(robots, math.inf)
        self._dead = [False] * robots
        self._known_dead = [False] * robots
        self._owner: dict[int, int] = {}
        self.done_at = [math.inf] * tasks
        self.done_by = [-1] * tasks
        self.reallocations = 0
        self.plans = 0

    def to_the_end(self) -> None:
        """Go from event to event until all is done, or nothing happens any more."""
        self._plan()
        while math.inf in self.done_at:
            self._begin()
            self._now = min(map(self._next, range(len(self._queues))))
            if self._now == math.inf:
                break
            for robot in range(len(self._queues)):
                self._finish(robot)
                self._die(robot)
            self._notice()

    def _next(self, robot: int) -> float:
        """When something happens to a robot, in seconds."""
        if self._known_dead[robot]:
            return math.inf
        if self._dead[robot]:
            return float(self._deaths[robot] + self._detection)
        return float(min(self._ends[robot], self._deaths[robot]))

    def _begin(self) -> None:
        """Let every robot that is free and lives begin the next task of its queue."""
        for robot, queue in enumerate(self._queues):
            if queue and self._on[robot] is None and self._now < self._deaths[robot]:
                self._on[robot] = task = queue.pop(0)
                self._began[robot] = self._now
                self._ends[robot] = self._now + self._left[task] * self._times[robot, task]
                if self._now + self._lives[robot] < self._ends[robot]:
                    self._deaths[robot] = min(self._deaths[robot], self._now + self._lives[robot])

    def _finish(self, robot: int) -> None:
        task = self._on[robot]
        if task is not None and not self._dead[robot] and self._ends[robot] <= self._now:
            self.done_at[task], self.done_by[task] = self._now, robot
            self._lives[robot] -= self._now - self._began[robot]
            self._on[robot], self._ends[robot] = None, math.inf

    def _die(self, robot: int) -> None:
        if not self._dead[robot] and self._deaths[robot] <= self._now:
            self._dead[robot] = True
            task = self._on[robot]
            if task is not None and self._shared:
                done = (self._now - self._began[robot]) / self._times[robot, task]
                self._left[task] = max(self._left[task] - done, NEARLY_NOTHING)

    def _notice(self) -> None:
        """Take from the dead that are noticed now what they were to do, and plan anew if that is anything."""
        left_behind = False
        for robot, dead in enumerate(self._dead):
            if dead and not self._known_dead[robot] and self._deaths[robot] + self._detection <= self._now:
                self._known_dead[robot] = True
                left_behind = left_behind or self._on[robot] is not None or bool(self._queues[robot])
                self._on[robot], self._ends[robot] = None, math.inf
                self._queues[robot] = []
        if left_behind:
            self._plan()

    def _plan(self) -> None:
        situation = self._situation()
        plan = [list(queue) for queue in self._planner(situation)]
        _check(plan, situation)
        self.plans += 1
        for robot, queue in enumerate(plan):
            for task in queue:
                self.reallocations += self._owner.get(task, robot) != robot
                self._owner[task] = robot
        self._queues = plan

    def _situation(self) -> Situation:
        left = self._times * self._left
        left[self._known_dead] = math.inf
        begun = set(self._on)
        able = set(np.flatnonzero(np.isfinite(left).any(axis=0)).tolist())
        busy = np.array([on is not None for on in self._on])
        return Situation(
            times=left,
            ready=np.where(busy, np.maximum(np.where(busy, self._ends, 0.0) - self._now, 0.0), 0.0),
            open=tuple(
                task for task, at in enumerate(self.done_at) if at == math.inf and task not in begun and task in able
            ),
            queues=tuple(map(tuple, self._queues)),
            chance=self._chance,
        )


def _check(plan: Plan, situation: Situation) -> None:
    """Refuse what is no plan: that is a planner's defect, not a user's.

    Raises:
        ValueError: a queue is missing, an open task is not in exactly one, or a robot cannot do its task.
    """
    if len(plan) != len(situation.times):
        raise ValueError(f"a plan of {len(plan)} queues for {len(situation.times)} robots")
    planned = sorted(task for queue in plan for task in queue)
    if planned != sorted(situation.open):
        raise ValueError(f"a plan for the tasks {planned}; open are {sorted(situation.open)}")
    for robot, queue in enumerate(plan):
        for task in queue:
            if not np.isfinite(situation.times[robot, task]):
                raise ValueError(f"a plan in which robot {robot} does task {task}, which it cannot")
