"""Bounds and optima where the work left belongs to the task: held against the world itself, from both sides."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from study.problems import drawn, mission_of, tables

from lalliance_agents.errors import UserError
from lalliance_study.assignments import Floats
from lalliance_study.bounds import proven_by
from lalliance_study.optimum import optimum, optimum_of, shared_optimum
from world_server.environments.base import Work
from world_server.environments.task_pool import HandOver, TaskPool

RULES: list[HandOver] = ["restart", "shared_max", "shared_add"]


def makespan_in_the_world(times: Floats, hand_over: HandOver, script: Iterator[tuple[float, dict[str, Work]]]) -> float:
    """When the mission is complete while the script runs, in seconds; infinite if it is not."""
    pool = TaskPool(mission_of(times, hand_over=hand_over), seed=0)
    now = 0.0
    for dt, actions in script:
        for done in pool.step(dt, actions):
            if pool.is_complete:
                last = now + done.after
        now += dt
        if pool.is_complete:
            return last
    return math.inf


def one_after_the_other(spent: Floats) -> Iterator[tuple[float, dict[str, Work]]]:
    """Each robot serves its tasks in order, whoever else is on them; `spent[robots, tasks]` in seconds."""
    ends = spent.cumsum(axis=1)
    marks = np.unique(np.append(ends, 0.0))
    for begin, end in pairwise(marks):
        middle = (begin + end) / 2
        serving = [int(np.searchsorted(row, middle)) for row in ends]
        yield (
            float(end - begin),
            {f"r{robot}": Work(f"t{task}") for robot, task in enumerate(serving) if task < spent.shape[1]},
        )


def open_shop(spent: Floats, length: float) -> Iterator[tuple[float, dict[str, Work]]]:
    """A preemptive open shop in `length` seconds: robots serve one task at a time and tasks are served by one at a time.

    The table is filled up to rows and columns of equal sums; such a table is a sum of matchings (Birkhoff), and each one is
    done for as long as its smallest entry lasts.
    """
    robots, tasks = spent.shape
    idle_robots, idle_tasks = np.diag(length - spent.sum(axis=1)), np.diag(length - spent.sum(axis=0))
    left = np.block([[spent, idle_robots], [idle_tasks, spent.T]])
    while left.max() > 1e-9 * length:
        row, column = linear_sum_assignment(np.where(left > 1e-10 * length, 0.0, 1.0))
        lasts = float(left[row, column].min())
        assert lasts > 0
        left[row, column] -= lasts
        served = [(robot, task) for robot, task in zip(row, column, strict=True) if robot < robots and task < tasks]
        yield lasts, {f"r{robot}": Work(f"t{task}") for robot, task in served}


@pytest.mark.parametrize("seed", range(6))
def test_rates_that_add_up_reach_the_optimum_in_the_world(seed: int) -> None:
    times = drawn(seed, 4, 7, 3, 2.0)
    best = shared_optimum(times, "shared_add")
    assert best.proven
    spent = np.where(np.isfinite(times), times, 0.0) * best.shares
    script = one_after_the_other(spent * (1 + 1e-9))
    assert makespan_in_the_world(times, "shared_add", script) == pytest.approx(best.makespan, rel=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_where_the_fastest_counts_the_optimum_is_reached_in_the_world(seed: int) -> None:
    times = drawn(seed, 4, 7, 3, 2.0)
    best = shared_optimum(times, "shared_max")
    assert best.proven
    spent = np.where(np.isfinite(times), times, 0.0) * best.shares
    script = open_shop(spent * (1 + 1e-6), best.makespan * (1 + 1e-6))
    assert makespan_in_the_world(times, "shared_max", script) == pytest.approx(best.makespan, rel=1e-5)


@settings(max_examples=40, deadline=None)
@given(tables(), st.integers(0, 2**32), st.sampled_from(RULES))
def test_no_team_is_faster_than_its_yardstick(times: Floats, seed: int, hand_over: HandOver) -> None:
    """Robots that change their minds at random times: teams form, work is handed over, and none beats the bound."""
    chance = np.random.default_rng(seed)
    able = [np.flatnonzero(np.isfinite(row)) for row in times]

    def script() -> Iterator[tuple[float, dict[str, Work]]]:
        actions: dict[str, Work] = {}
        for _ in range(60):
            for robot, tasks in enumerate(able):
                if len(tasks) and chance.random() < 0.4:
                    actions[f"r{robot}"] = Work(f"t{chance.choice(tasks)}")
            yield float(chance.exponential(np.nanmax(np.where(np.isfinite(times), times, np.nan)))), dict(actions)

    makespan = makespan_in_the_world(times, hand_over, script())
    assert makespan >= optimum_of(mission_of(times, hand_over=hand_over)).lower - 1e-9 * times.shape[1]


@settings(max_examples=40, deadline=None)
@given(tables(robots=4, tasks=5), st.data())
def test_any_weights_prove_a_bound(times: Floats, data: st.DataObject) -> None:
    weight = st.sampled_from([0.0, 0.1, 0.5, 1.0])
    of_robot = np.array(data.draw(st.lists(weight, min_size=len(times), max_size=len(times)))) + 0.01
    of_task = np.array(data.draw(st.lists(weight, min_size=times.shape[1], max_size=times.shape[1])))
    ready = np.zeros(len(times))
    most, add = shared_optimum(times, "shared_max"), shared_optimum(times, "shared_add")
    assert proven_by(times, ready, of_robot, of_task) <= most.makespan
    assert proven_by(times, ready, of_robot, np.zeros_like(of_task)) <= add.makespan
    assert add.lower <= most.makespan
    assert most.lower <= optimum(times).makespan
    assert add.proven
    assert most.proven


def test_the_three_yardsticks_of_one_mission() -> None:
    """Two equal robots and three equal tasks of 6 s: 12 s one by one, 9 s if work is handed over or done together."""
    times = np.full((2, 3), 6.0)
    assert optimum(times).makespan == 12.0
    assert shared_optimum(times, "shared_max").makespan == pytest.approx(9.0)
    assert shared_optimum(times, "shared_add").makespan == pytest.approx(9.0)
    alone = np.full((2, 1), 6.0)  # a single task: only where rates add up is a second robot any use
    assert shared_optimum(alone, "shared_max").makespan == pytest.approx(6.0)
    assert shared_optimum(alone, "shared_add").makespan == pytest.approx(3.0)


def test_what_is_not_shared_is_refused() -> None:
    with pytest.raises(UserError, match="hand_over is 'restart'; expected shared_max or shared_add"):
        shared_optimum(np.ones((1, 1)), "restart")
    with pytest.raises(UserError, match="no robot can do task 0"):
        shared_optimum(np.full((1, 1), math.inf), "shared_add")
    assert shared_optimum(np.empty((2, 0)), "shared_add").makespan == 0.0
