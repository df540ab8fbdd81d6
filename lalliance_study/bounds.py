"""What no team can beat: lower bounds on the makespan, each proven by a few weights that anybody can check.

The bounds come from linear programmes over the shares x[i, j] of task j that robot i does, solved with HiGHS (scipy). A
solver of floats proves nothing by itself. But by duality *any* weights prove a bound, so only the weights are taken from the
solver, and the bound is computed from them here (`proven_by`): a wrong weight makes it weaker, never wrong.

Three statements, by what a team is allowed (`times[robots, tasks]`, `ready[robots]` as in `assignments`):

- *Rates add up* (`shared_add`): every share counts, whoever else is there. T >= ready_i + sum_j x_ij t_ij for each robot, as it
  does one task at a time; sum_i x_ij = 1 for each task, as that is all its work.
- *The fastest counts* (`shared_max`): besides, at any instant only one robot on a task advances it; what the others do is
  lost and can be taken out of the schedule. So a task advances for at most T seconds: T >= sum_i x_ij t_ij for each task.
- *One robot does all of a task* (HRASP, `restart`): the same with each x 0 or 1. Besides, who has ready_i + t_ij > T has no
  part in a makespan of T (Lenstra, Shmoys, Tardos, "Approximation algorithms for scheduling unrelated parallel machines",
  1990); see `one_robot_each`.

Failures, noise aside, only take from what a team may do, and so do delays, prerequisites and arrivals: the bounds stay valid.
"""

import math
from typing import NamedTuple

import numpy as np

from lalliance_study.assignments import Floats
from lalliance_study.extras import study_package

#: What is taken off a bound for the roundings of its own computation, as a share; there are some thousand of 1e-16 at most.
ROUNDING = 1e-12


class Relaxation(NamedTuple):
    """A solved linear programme."""

    lower: float
    """No schedule is shorter, in seconds; proven by weights."""
    makespan: float
    """What the shares below need, in seconds; equal to `lower` but for rounding."""
    shares: Floats
    """What each robot does of each task, `[robots, tasks]`; each column sums to 1."""


def slowest_of_the_fastest(times: Floats, ready: Floats) -> float:
    """A robot has to do the task that takes longest, and no robot's own time can be taken back, in seconds."""
    return float(max((ready[:, None] + times).min(axis=0).max(initial=0.0), ready.max()))


def proven_by(times: Floats, ready: Floats, of_robot: Floats, of_task: Floats) -> float:
    """The lower bound that non-negative weights prove, in seconds; at least one must be positive.

    Divide the weights u[robots], v[tasks] by their sum and add up the inequalities of the module's page, each times its weight:
    T >= sum_i u_i ready_i + sum_ij x_ij t_ij (u_i + v_j) >= sum_i u_i ready_i + sum_j min_i t_ij (u_i + v_j), as the shares
    of a task sum to 1. Where rates add up, only v = 0 proves anything.
    """
    total = math.fsum(of_robot) + math.fsum(of_task)
    able = np.isfinite(times)
    priced = np.where(able, np.where(able, times, 0.0) * (of_robot[:, None] + of_task), math.inf)
    bound = math.fsum([*(of_robot * ready), *priced.min(axis=0)]) / total
    return bound * (1 - ROUNDING)


def relax(times: Floats, ready: Floats, *, one_at_a_time: bool) -> Relaxation:
    """The least makespan if tasks can be shared out in any way.

    Args:
        times: `[robots, tasks]` in seconds; each task has a finite one.
        ready: `[robots]` in seconds.
        one_at_a_time: whether a task advances by one robot at a time (the fastest counts), or by all (rates add up).
    """
    optimize, sparse = study_package("scipy.optimize"), study_package("scipy.sparse")
    robots, tasks = times.shape
    robot, task = np.nonzero(np.isfinite(times))
    count, unit = len(robot), float(times.min(axis=0).max())
    spent = times[robot, task] / unit
    columns = np.arange(count)
    # One row per robot, and per task where it advances by one robot at a time: what is spent on it is not more than T.
    rows = [robot, robots + task] if one_at_a_time else [robot]
    limits = robots + tasks * one_at_a_time
    left = sparse.csr_array(
        (
            np.concatenate([np.tile(spent, len(rows)), np.full(limits, -1.0)]),
            (
                np.concatenate([*rows, np.arange(limits)]),
                np.concatenate([np.tile(columns, len(rows)), np.full(limits, count)]),
            ),
        )
    )
    right = np.zeros(limits)
    right[:robots] = -ready / unit
    whole = sparse.csr_array((np.ones(count), (task, columns)), shape=(tasks, count + 1))
    goal = np.zeros(count + 1)
    goal[count] = 1.0
    found = optimize.linprog(goal, A_ub=left, b_ub=right, A_eq=whole, b_eq=np.ones(tasks), method="highs-ds")
    if found.x is None:
        raise RuntimeError(f"HiGHS did not solve a programme that has a solution: {found.message}")
    weights = np.maximum(-found.ineqlin.marginals, 0.0)
    shares = np.zeros_like(times)
    shares[robot, task] = np.maximum(found.x[:count], 0.0)
    shares /= shares.sum(axis=0)
    of_task = weights[robots:] if one_at_a_time else np.zeros(tasks)
    lower = proven_by(times, ready, weights[:robots], of_task)
    return Relaxation(max(lower, float(ready.max())), needed(times, ready, shares, one_at_a_time=one_at_a_time), shares)


def needed(times: Floats, ready: Floats, shares: Floats, *, one_at_a_time: bool) -> float:
    """The makespan of shares, in seconds: that of the busiest robot, or of the task that keeps robots busy longest."""
    spent = np.where(shares > 0, np.where(np.isfinite(times), times, 0.0) * shares, 0.0)
    longest = float((ready + spent.sum(axis=1)).max())
    return max(longest, float(spent.sum(axis=0).max())) if one_at_a_time else longest


def one_robot_each(times: Floats, ready: Floats, known: float) -> float:
    """A lower bound on HRASP's makespan, in seconds; stronger than where tasks can be shared out.

    Let c_0 < c_1 < ... be the instants ready_i + t_ij from the largest that is needed (`slowest_of_the_fastest`) on, and f_k
    the relaxed makespan if only pairs with an instant <= c_k take part. If the optimum is below c_k, its pairs are among
    those of c_(k-1), so that it is at least f_(k-1): the optimum is at least min(c_k, f_(k-1)) for every k, and at
    least c_0. f falls and c grows with k, so the best k is found by bisection.

    Args:
        times: `[robots, tasks]` in seconds; each task has a finite one.
        ready: `[robots]` in seconds.
        known: a makespan that can be had; instants above it do not matter.
    """
    ends = ready[:, None] + times
    least = slowest_of_the_fastest(times, ready)
    instants = np.unique(ends[np.isfinite(ends) & (ends >= least) & (ends <= known)])
    best, low, high = least, 0, len(instants)
    while low < high:
        middle = (low + high) // 2
        allowed = np.where(ends <= instants[middle], times, math.inf)
        relaxed = relax(allowed, ready, one_at_a_time=False).lower
        next_one = float(instants[middle + 1]) if middle + 1 < len(instants) else math.inf
        best = max(best, min(next_one, relaxed))
        if relaxed > instants[middle]:
            low = middle + 1
        else:
            high = middle
    return best
