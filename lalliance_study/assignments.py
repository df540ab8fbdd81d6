"""Assignments of tasks to robots that need no solver: how good one is, a first one by a list rule, and a better one.

All work on plain arrays. `times[robots, tasks]` holds the seconds a robot needs for a task, infinite where it cannot do it;
`ready[robots]` the instants from which robots are free, in seconds; an assignment holds for each task the index of its
robot. Ties go to the lower index, and the same arguments give the same assignment.
"""

import math
from collections.abc import Iterable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lalliance_agents.errors import UserError

Floats = NDArray[np.float64]
Owners = NDArray[np.intp]

#: Tasks of two robots that are dealt out anew at once; 2 to the power of this many ways are compared.
MOST_DEALT = 12
#: Tasks that one kick throws, besides one of the busiest robot.
THROWN = 3
#: Share by which a load must fall to count as better, so that rounding cannot make a step go on for ever.
BETTER = 1e-12


class UnreachableTaskError(UserError):
    """A task that no robot can do."""


def check_times(times: Floats) -> Floats:
    """The times as floats, `[robots, tasks]`, if a problem can be made of them.

    Raises:
        UnreachableTaskError: a task is infinite for all robots.
        UserError: they are no table, hold a number that is no time, or name no robot.
    """
    table = np.asarray(times, dtype=np.float64)
    if table.ndim != 2 or table.shape[0] == 0:
        raise UserError(
            f"times of the shape {table.shape} are no team; expected [robots, tasks] with at least one robot"
        )
    wrong = np.argwhere(~(table > 0))
    if len(wrong):
        robot, task = wrong[0]
        raise UserError(
            f"robot {robot} needs {table[robot, task]:g} s for task {task}; expected a positive time, infinite if it cannot"
        )
    lost = np.flatnonzero(np.isinf(table).all(axis=0))
    if len(lost):
        raise UnreachableTaskError(f"no robot can do task {lost[0]}; expected at least one with a finite time for it")
    return table


def loads_of(times: Floats, ready: Floats, owner: Owners) -> Floats:
    """When each robot is through with its tasks, `[robots]`, in seconds."""
    spent = times[owner, np.arange(times.shape[1])]
    return ready + np.bincount(owner, weights=spent, minlength=len(ready))


def makespan_of(times: Floats, ready: Floats, owner: Owners) -> float:
    """When the last robot is through, in seconds; each robot's sum is rounded once only."""
    sums = [math.fsum([ready[robot], *times[robot, owner == robot]]) for robot in range(len(ready))]
    return max(sums)


def longest_first(times: Floats) -> Owners:
    """The tasks in the order of LPT: the one that takes its fastest robot longest comes first."""
    return np.argsort(-times.min(axis=0), kind="stable")


def to_the_earliest(times: Floats, ready: Floats, order: Iterable[int]) -> Owners:
    """List scheduling: each task in turn goes to the robot that would be through with it first.

    For identical robots and the longest first this is Graham's LPT, "Bounds on multiprocessing timing anomalies" (1969):
    at most 4/3 - 1/(3n) times the optimum. For unrelated times no such constant holds.
    """
    loads = ready.copy()
    owner = np.zeros(times.shape[1], dtype=np.intp)
    for task in order:
        ends = loads + times[:, task]
        owner[task] = robot = int(ends.argmin())
        loads[robot] = ends[robot]
    return owner


def rebalance(times: Floats, ready: Floats, owner: Owners) -> Owners:
    """An assignment that is at least as good: the busiest robot shares with another one as long as that helps.

    One step takes the tasks that both can do, at most `MOST_DEALT`, and deals them out in the best of all ways. With each
    step the loads, sorted from the largest, get lexicographically smaller, so that the steps come to an end.
    """
    owner = owner.copy()
    while _relieve(times, ready, owner):
        pass
    return owner


def kick(times: Floats, ready: Floats, owner: Owners, kicks: int, seed: int = 0) -> Owners:
    """An assignment that is at least as good: again and again some tasks are thrown to other robots, and loads rebalanced.

    What is not worse is kept. One task of the busiest robot is always among those thrown, and a robot that is fast at a task
    is likely to catch it.

    Args:
        times: `[robots, tasks]` in seconds; each task has a finite one.
        ready: `[robots]` in seconds.
        owner: where to start.
        kicks: how often.
        seed: of what is thrown where.
    """
    chance = np.random.default_rng(seed)
    robots, tasks = times.shape
    catches = (times.min(axis=0) / times) ** 3
    catches /= catches.sum(axis=0)
    best = makespan_of(times, ready, owner)
    for _ in range(kicks):
        tried = owner.copy()
        burden = np.flatnonzero(owner == loads_of(times, ready, owner).argmax())
        thrown = [
            *chance.choice(tasks, min(THROWN, tasks), replace=False),
            *burden[chance.permutation(len(burden))[:1]],
        ]
        for task in thrown:
            tried[task] = chance.choice(robots, p=catches[:, task])
        tried = rebalance(times, ready, tried)
        makespan = makespan_of(times, ready, tried)
        if makespan <= best:
            owner, best = tried, makespan
    return owner


def _relieve(times: Floats, ready: Floats, owner: Owners) -> bool:
    """Make one step in place; whether there was one."""
    loads = loads_of(times, ready, owner)
    busiest = int(loads.argmax())
    for other in np.argsort(loads, kind="stable"):
        if other != busiest and _deal(times, loads, owner, busiest, int(other)):
            return True
    return False


def _deal(times: Floats, loads: Floats, owner: Owners, first: int, second: int) -> bool:
    """Deal the tasks of two robots out anew, in place, if that makes the later of the two earlier."""
    both = np.isfinite(times[first]) & np.isfinite(times[second]) & ((owner == first) | (owner == second))
    dealt = np.flatnonzero(both)
    if len(dealt) > MOST_DEALT:
        # Long tasks are where they are best; short ones even the loads out.
        lengths = np.minimum(times[first, dealt], times[second, dealt])
        dealt = dealt[np.argsort(lengths, kind="stable")[:MOST_DEALT]]
    mine, yours = times[first, dealt], times[second, dealt]
    held = owner[dealt] == first
    ways = _ways(len(dealt))
    ends = np.maximum(
        loads[first] - mine[held].sum() + ways @ mine, loads[second] - yours[~held].sum() + (1 - ways) @ yours
    )
    best = int(ends.argmin())
    if ends[best] >= loads[first] * (1 - BETTER):
        return False
    owner[dealt] = np.where(ways[best] > 0, first, second)
    return True


@cache
def _ways(count: int) -> Floats:
    """All subsets of `count` things, one per row, as zeros and ones."""
    return ((np.arange(2**count)[:, None] >> np.arange(count)) & 1).astype(np.float64)
