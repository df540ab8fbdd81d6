"""What people use instead of L-ALLIANCE: six planners for the stage of `queues`.

| name | how it plans | who decides |
|---|---|---|
| `random` | each task to some robot that can do it, in some order | a centre |
| `greedy` | who is free takes the task that is shortest for it; of several, who is fastest first | robots, hearing all |
| `auction` | sequential single-item auction, bids are completion times | robots, one auctioneer |
| `cbba` | consensus-based bundles, time-discounted reward (see `cbba`) | robots, by consensus |
| `lpt` | list scheduling: the longest task first, to the earliest completion | a centre |
| `optimum` | HRASP's optimum; after a death the optimum of what is left | a centre |

All of them are favoured against L-ALLIANCE: they get true times, plan in no time and repair a plan as soon as a death is
noticed; and those with a centre have one that neither fails nor misses a message. What they do at a death differs, as it
does in use: `random` and `auction` place the lost tasks alone and keep all other contracts; the rest plan everything anew
that nobody has begun.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from lalliance_study.assignments import Floats, Owners, longest_first, to_the_earliest
from lalliance_study.cbba import cbba
from lalliance_study.optimum import Optimum, optimum
from lalliance_study.queues import Plan, Planner, Situation

#: How near to the optimum `optimum` plans: the ratios of the study are told to three digits.
TOLERANCE = 1e-4
#: How long `optimum` searches for one plan, in CP-SAT's deterministic seconds; then it takes the best that it has.
WORK_LIMIT = 5.0


def at_random(situation: Situation) -> Plan:
    """Each lost task to a robot that can do it, all alike, at the end of its queue; tasks in random order."""
    queues = [list(queue) for queue in situation.queues]
    for task in situation.chance.permutation(np.array(situation.lost, dtype=np.intp)):
        able = np.flatnonzero(np.isfinite(situation.times[:, task]))
        queues[situation.chance.choice(able)].append(int(task))
    return queues


def greedy(situation: Situation) -> Plan:
    """Whenever robots are free, the pair of a free robot and an open task with the shortest time comes together.

    Iterated greedy assignment: Gerkey, Matarić, "A formal analysis and taxonomy of task allocation in multi-robot systems",
    IJRR 23(9), 2004 (section 5.1; as in BLE and M+). Nobody waits for a better robot. As times are known, what robots will do
    can be worked out beforehand; they would decide the same on the spot.
    """
    queues: list[list[int]] = [[] for _ in situation.times]
    times, free_at = situation.times, situation.ready.copy()
    left = list(situation.open)
    while left:
        offered = times[:, left]
        waiting = np.where(np.isfinite(offered).any(axis=1), free_at, np.inf)
        free = waiting <= waiting.min()
        robot, place = np.unravel_index(int(np.where(free[:, None], offered, np.inf).argmin()), offered.shape)
        task = left.pop(int(place))
        queues[int(robot)].append(task)
        free_at[robot] += times[robot, task]
    return queues


def auction(situation: Situation) -> Plan:
    """Sequential single-item auction with the MiniMax rule: a bid is the instant at which the bidder would be done.

    Lagoudakis et al., "Auction-based multi-robot routing", RSS 2005. In each round all robots bid on all tasks that are still
    to be had, and the lowest bid wins; the task comes to the end of its robot's queue. Here, without ways between tasks, it
    is also the Min-Min rule of list scheduling. What was sold stays sold: after a death only lost tasks are auctioned.
    """
    queues = [list(queue) for queue in situation.queues]
    free_at = situation.ready + [sum(row[queue]) for row, queue in zip(situation.times, queues, strict=True)]
    left = list(situation.lost)
    while left:
        bids = free_at[:, None] + situation.times[:, left]
        robot, place = np.unravel_index(int(bids.argmin()), bids.shape)
        free_at[robot] = bids[robot, place]
        queues[int(robot)].append(left.pop(int(place)))
    return queues


def lpt(situation: Situation) -> Plan:
    """List scheduling: the longest task first, each to the robot that would be done with it first (`to_the_earliest`)."""
    times = situation.times[:, situation.open]
    order = longest_first(times)
    owner = to_the_earliest(times, situation.ready, order)
    return _queues(situation, owner, order)


def repaired_optimum(solve: Callable[[Floats, Floats], Optimum]) -> Planner:
    """A planner of HRASP's optimum for all tasks that nobody has begun, given when robots are through with what they are on.

    It is the optimum if nobody dies. If robots do, it is not the best that a clairvoyant could do. The order within a queue
    does not matter to the makespan; the shortest come first, so that a death finds most tasks done.

    Args:
        solve: finds an optimum, given times and from when robots are free.
    """

    def plan(situation: Situation) -> Plan:
        times = situation.times[:, situation.open]
        found = solve(times, situation.ready)
        owner = np.array(found.assignment, dtype=np.intp)
        order = np.argsort(times[owner, np.arange(len(owner))], kind="stable")
        return _queues(situation, owner, order)

    return plan


def _optimum(times: Floats, ready: Floats) -> Optimum:
    return optimum(times, ready=ready, tolerance=TOLERANCE, time_limit=math.inf, work_limit=WORK_LIMIT)


def _queues(situation: Situation, owner: Owners, order: Owners) -> list[list[int]]:
    """The queues of an assignment of the open tasks, filled in an order; both count among the open tasks."""
    queues: list[list[int]] = [[] for _ in situation.times]
    for place in order:
        queues[owner[place]].append(situation.open[place])
    return queues


#: All of them, in the order of the table above.
BASELINES: Mapping[str, Planner] = {
    "random": at_random,
    "greedy": greedy,
    "auction": auction,
    "cbba": cbba,
    "lpt": lpt,
    "optimum": repaired_optimum(_optimum),
}
