"""The optimum of a mission, proven: the yardstick of the study.

HRASP, the paper's heterogeneous robot action selection problem (sections 3 and 5), asks for the shortest makespan if each
task is done once, by one robot that can do it, and a robot does one task at a time, in any order. In scheduling's words it is
R||Cmax with eligibility. It is NP-hard; what is proven here is proven by a search of CP-SAT (OR-Tools), after bounds which
often settle it alone.

The yardstick depends on the mission's `hand_over`, for where the work left belongs to the task, a team can beat HRASP:

- `restart`: HRASP itself (`optimum`). Each task has a robot whose last attempt did all of it, without a break; these
  attempts are an assignment, and its makespan is not longer than the mission's.
- `shared_max`, `shared_add`: the linear programmes of `bounds` (`shared_optimum`). They are not only bounds but the optimum
  itself for robots that know everything and lose no time. Rates add up: each robot serves its shares one after the other, in
  any order. The fastest counts: that robots serve one task at a time and tasks are served by one robot at a time is an open
  shop with preemption, in which some order meets the busiest robot's or task's time (Gonzalez, Sahni, "Open shop scheduling to
  minimize finish time", 1976; for unrelated machines Lawler, Labetoulle, 1978).

Always shared_add <= shared_max <= restart. Where nothing is proven, `lower` still is: the optimum lies between it and
`makespan`. A mission's time can be shorter by 1e-9 s for each task, as the world takes what is so near to its end as done.

Arrays are as in `assignments`. Robots and tasks are numbered in their order there, or in the mission's.
"""

import math
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_study import bounds
from lalliance_study.assignments import (
    Floats,
    Owners,
    check_times,
    kick,
    loads_of,
    longest_first,
    makespan_of,
    rebalance,
    to_the_earliest,
)
from lalliance_study.extras import study_package
from world_server.environments.task_pool import HAND_OVERS, HandOver, TaskPool

#: What is proven holds but for this share, unless another one is asked for.
TOLERANCE = 1e-6
#: Below it, whole numbers of 64 bits and floats of 53 are too short for the sums.
LEAST_TOLERANCE = 1e-9
#: Longest search for one optimum, in seconds.
TIME_LIMIT = 60.0
#: What a first search may take, in CP-SAT's deterministic seconds; most problems need no more. Only for others it pays to look
#: for a better assignment by other means first.
FIRST_SEARCH = 0.2
#: How many kicks are given to an assignment then; they take a quarter of a second at 20 robots and 40 tasks.
KICKS = 300
#: The k for which a robot is told how many tasks of more than a k-th of its time it can do.
PARTS = (2, 3, 4, 5)


@dataclass(frozen=True, slots=True)
class Yardstick:
    """An optimum, or what is known of it."""

    makespan: float
    """What the best schedule found takes, in seconds."""
    lower: float
    """No schedule is shorter, in seconds; this is proven in any case."""
    tolerance: float
    """Up to which share of the makespan the two may differ and still count as equal."""
    seconds: float
    """How long it took to compute, in seconds; it differs from run to run, and nothing else does."""

    @property
    def proven(self) -> bool:
        """Whether the makespan is the optimum."""
        return self.makespan - self.lower <= self.tolerance * self.makespan


@dataclass(frozen=True, slots=True)
class Optimum(Yardstick):
    """HRASP's: every task by one robot."""

    assignment: tuple[int, ...]
    """The robot of each task."""


@dataclass(frozen=True, slots=True)
class SharedOptimum(Yardstick):
    """Where robots share the work of a task."""

    shares: tuple[tuple[float, ...], ...]
    """What each robot does of each task, `[robots][tasks]`; the shares of a task sum to 1."""


def optimum(
    times: Floats,
    *,
    ready: Floats | None = None,
    tolerance: float = TOLERANCE,
    time_limit: float = TIME_LIMIT,
    work_limit: float = math.inf,
) -> Optimum:
    """HRASP's optimum. The same arguments give the same answer, unless `time_limit` ends the search.

    Args:
        times: seconds a robot needs for a task, `[robots, tasks]`, infinite where it cannot do it.
        ready: from when each robot is free, `[robots]` in seconds; 0 for all by default. The makespan counts from 0.
        tolerance: up to which share the makespan may be above the optimum and still count as proven.
        time_limit: of the search, in seconds.
        work_limit: of the search, in CP-SAT's deterministic seconds, which do not depend on the machine; so what is left
            unproven does not either. One takes about a second.

    Raises:
        UnreachableTaskError: a task that no robot can do.
        UserError: an argument that is none; among these `MissingExtraError`, where OR-Tools or scipy is needed and missing.
    """
    began = perf_counter()
    table = check_times(times)
    if not LEAST_TOLERANCE <= tolerance < 1:
        raise UserError(f"a tolerance of {tolerance:g}; expected a share from {LEAST_TOLERANCE:g} to below 1")
    free_at = np.zeros(len(table)) if ready is None else np.asarray(ready, dtype=np.float64)
    if free_at.shape != (len(table),) or not (np.isfinite(free_at) & (free_at >= 0)).all():
        raise UserError(f"ready is {free_at}; expected an instant of at least 0 for each of {len(table)} robots")
    state = _State(table, free_at, tolerance)
    state.bound()
    if not state.settled:
        state.search(time_limit, min(work_limit, FIRST_SEARCH))
    time_left = time_limit - (perf_counter() - began)
    if not state.settled and time_left > 0 and work_limit > FIRST_SEARCH:
        state.take(kick(table, free_at, state.owner, KICKS))
        state.search(time_left, work_limit - FIRST_SEARCH)
    lower = min(state.lower, state.makespan)
    return Optimum(state.makespan, lower, tolerance, perf_counter() - began, tuple(map(int, state.owner)))


class _State:
    """What is known of a problem: an assignment with its makespan, and a lower bound."""

    def __init__(self, times: Floats, ready: Floats, tolerance: float) -> None:
        self._times, self._ready, self._tolerance = times, ready, tolerance
        self.owner = rebalance(times, ready, to_the_earliest(times, ready, longest_first(times)))
        self.makespan = makespan_of(times, ready, self.owner)
        self.lower = bounds.slowest_of_the_fastest(times, ready)

    @property
    def settled(self) -> bool:
        """Whether nothing is left to be proven."""
        return self.makespan - self.lower <= self._tolerance * self.makespan

    def take(self, owner: Owners) -> None:
        """Keep an assignment if it is better."""
        makespan = makespan_of(self._times, self._ready, owner)
        if makespan < self.makespan:
            self.owner, self.makespan = owner, makespan

    def bound(self) -> None:
        """Prove what linear programmes can, if that is needed."""
        if not self.settled:
            self.lower = bounds.one_robot_each(self._times, self._ready, self.makespan)

    def search(self, time_limit: float, work_limit: float) -> None:
        """Let CP-SAT look for a better assignment and a better bound.

        It counts in whole units. All times are rounded down to them, so that a makespan in units is never above the true one
        and its bound holds for the true times; it is below by at most one unit for each task, `tolerance`/2 for all. A unit
        is a power of two, so that the floats here round nothing.
        """
        cp_model = study_package("ortools.sat.python.cp_model")
        unit = 2.0 ** math.floor(math.log2(self._tolerance * self.makespan / (2 * self._times.shape[1] + 2)))
        within = (int(self.lower // unit), int(self.makespan // unit))
        model, chosen = _model(np.floor(self._times / unit), np.floor(self._ready / unit), self.owner, within)
        solver = cp_model.CpSolver()
        solver.parameters.num_workers = 1
        solver.parameters.random_seed = 0
        solver.parameters.catch_sigint_signal = False  # else Ctrl-C would make an ordinary answer of what it has
        solver.parameters.relative_gap_limit = 0.4 * self._tolerance
        solver.parameters.max_time_in_seconds = time_limit
        solver.parameters.max_deterministic_time = work_limit
        status = solver.solve(model)
        if status not in {cp_model.OPTIMAL, cp_model.FEASIBLE, cp_model.UNKNOWN}:
            raise RuntimeError(f"CP-SAT finds no assignment although there is one: {solver.status_name(status)}")
        self.lower = max(self.lower, math.floor(solver.best_objective_bound) * unit)
        if status != cp_model.UNKNOWN:
            found = self.owner.copy()
            for (robot, task), variable in chosen.items():
                if solver.boolean_value(variable):
                    found[task] = robot
            self.take(rebalance(self._times, self._ready, found))


def _model(
    times: Floats, ready: Floats, owner: Owners, within: tuple[int, int]
) -> tuple[Any, dict[tuple[int, int], Any]]:
    """The problem for CP-SAT, in whole units, with an assignment as a hint; and its variables by robot and task.

    Of tasks that take a robot more than a k-th of the time that it has, it can do k - 1; that follows, and helps the solver.
    """
    cp_model = study_package("ortools.sat.python.cp_model")
    model = cp_model.CpModel()
    makespan = model.new_int_var(*within, "makespan")
    chosen = {
        (int(robot), int(task)): model.new_bool_var(f"{robot} does {task}")
        for robot, task in np.argwhere(ready[:, None] + times <= within[1])
    }
    for task in range(times.shape[1]):
        model.add_exactly_one(chosen[pair] for pair in chosen if pair[1] == task)
    for robot, begins in enumerate(ready):
        own = {variable: int(times[pair]) for pair, variable in chosen.items() if pair[0] == robot}
        model.add(int(begins) + sum(time * variable for variable, time in own.items()) <= makespan)
        for parts in PARTS:
            large = [variable for variable, time in own.items() if time * parts > within[1] - int(begins)]
            if len(large) >= parts:
                model.add(sum(large) < parts)
    for pair, variable in chosen.items():
        model.add_hint(variable, owner[pair[1]] == pair[0])
    model.add_hint(makespan, int(loads_of(times, ready, owner).max()))
    model.minimize(makespan)
    return model, chosen


def shared_optimum(times: Floats, hand_over: HandOver) -> SharedOptimum:
    """The optimum where the work left belongs to the task: `shared_max` or `shared_add`.

    Args:
        times: seconds a robot needs for a task, `[robots, tasks]`, infinite where it cannot do it.
        hand_over: what a second robot on a task does for it.

    Raises:
        UnreachableTaskError: a task that no robot can do.
        UserError: an argument that is none; among these `MissingExtraError`, where scipy is missing.
    """
    began = perf_counter()
    table = check_times(times)
    if hand_over not in {"shared_max", "shared_add"}:
        raise UserError(f"hand_over is {hand_over!r}; expected shared_max or shared_add, as restart shares no work")
    if table.shape[1] == 0:
        return SharedOptimum(0.0, 0.0, TOLERANCE, perf_counter() - began, tuple(() for _ in table))
    found = bounds.relax(table, np.zeros(len(table)), one_at_a_time=hand_over == "shared_max")
    shares = tuple(tuple(map(float, row)) for row in found.shares)
    return SharedOptimum(found.makespan, min(found.lower, found.makespan), TOLERANCE, perf_counter() - began, shares)


class NoYardstickError(UserError):
    """A mission whose optimum is not known here."""


def times_of(mission: Mission) -> Floats:
    """The own times of a mission's robots, `[robots, tasks]` in seconds, infinite where a robot cannot do a task."""
    rows = [[robot.tasks.get(task, math.inf) for task in mission.tasks] for robot in mission.robots.values()]
    return np.array(rows, dtype=np.float64)


def optimum_of(
    mission: Mission,
    hand_over: HandOver | None = None,
    *,
    tolerance: float = TOLERANCE,
    time_limit: float = TIME_LIMIT,
    work_limit: float = math.inf,
) -> Yardstick:
    """The optimum of a mission with independent tasks that are there from the start, and a team without faults.

    Args:
        mission: the mission.
        hand_over: the yardstick; by default that of the mission, below which it cannot come. The paper's is `restart`.
        tolerance: as of `optimum`, as the two limits.
        time_limit: of the search, in seconds.
        work_limit: of the search, in CP-SAT's deterministic seconds.

    Raises:
        NoYardstickError: a mission of another kind.
        UserError: as `optimum`.
    """
    reason = _why_not(mission)
    if reason is not None:
        raise NoYardstickError(f"the optimum of mission {mission.name} is not known: {reason}")
    rule = hand_over or TaskPool.Options.model_validate(mission.environment.options).hand_over
    if rule not in HAND_OVERS:
        raise UserError(f"hand_over is {rule!r}; expected one of {', '.join(HAND_OVERS)}")
    times = times_of(mission)
    if rule != "restart":
        return shared_optimum(times, rule)
    return optimum(times, tolerance=tolerance, time_limit=time_limit, work_limit=work_limit)


def _why_not(mission: Mission) -> str | None:
    """What makes a mission more than HRASP, as the end of a sentence; None if nothing does."""
    if mission.environment.kind != "task_pool":
        return f"its environment is {mission.environment.kind}, expected task_pool"
    if mission.environment.options.get("noise"):
        return "its environment has noise, so that no robot's time for a task is known beforehand"
    for name, task in mission.tasks.items():
        if task.after or task.arrives > 0:
            return f"its task {name} cannot be worked on from the start"
    for name, robot in mission.robots.items():
        if robot.joins > 0:
            return f"its robot {name} joins later"
    return "it has faults" if mission.faults else None
