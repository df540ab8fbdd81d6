"""HRASP's optimum: as good as trying everything, a proven bound where the search ends early, and sentences for bad input."""

import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from study.problems import best_of_all, drawn, mission_of, tables

from lalliance_agents.errors import UserError
from lalliance_agents.extras import MissingExtraError
from lalliance_study import bounds
from lalliance_study.assignments import (
    Floats,
    UnreachableTaskError,
    kick,
    longest_first,
    makespan_of,
    rebalance,
    to_the_earliest,
)
from lalliance_study.optimum import NoYardstickError, Optimum, SharedOptimum, optimum, optimum_of

INF = math.inf
#: Two sums of the same numbers differ by less.
EXACT = 1 + 1e-12


def holds(times: Floats, found: Optimum, ready: Floats | None = None) -> None:
    """What is said of an optimum is so."""
    assert found.lower <= found.makespan
    owner = np.array(found.assignment, dtype=np.intp)
    assert np.isfinite(times[owner, np.arange(times.shape[1])]).all()
    assert found.makespan == makespan_of(times, np.zeros(len(times)) if ready is None else ready, owner)


def test_an_optimum_that_can_be_seen() -> None:
    found = optimum(np.array([[4.0, 4.0, 6.0], [INF, 5.0, 9.0]]))
    assert found.proven
    assert (found.makespan, found.assignment) == (9.0, (0, 0, 1))


@settings(max_examples=80, deadline=None)
@given(tables(robots=4, tasks=5), st.data())
def test_it_is_as_good_as_trying_everything(times: Floats, data: st.DataObject) -> None:
    ready = np.array(
        data.draw(st.lists(st.sampled_from([0.0, 0.0, 1.0, 7.5]), min_size=len(times), max_size=len(times)))
    )
    found, best = optimum(times, ready=ready), best_of_all(times, ready)
    assert found.proven
    assert found.lower <= best * EXACT
    assert best <= found.makespan * EXACT
    assert found.makespan <= best * (1 + found.tolerance) * EXACT
    holds(times, found, ready)


@settings(max_examples=40, deadline=None)
@given(tables(robots=3, tasks=6))
def test_bounds_and_first_assignments_enclose_the_optimum(times: Floats) -> None:
    best, ready = best_of_all(times), np.zeros(len(times))
    listed = to_the_earliest(times, ready, longest_first(times))
    better = rebalance(times, ready, listed)
    assert best <= makespan_of(times, ready, better) * EXACT
    assert makespan_of(times, ready, better) <= makespan_of(times, ready, listed) * EXACT
    slowest = bounds.slowest_of_the_fastest(times, ready)
    one_each = bounds.one_robot_each(times, ready, makespan_of(times, ready, better))
    shared = bounds.relax(times, ready, one_at_a_time=True)
    assert slowest <= one_each <= best * EXACT
    assert shared.lower <= one_each * (1 + 1e-9)


def test_a_bound_without_the_slower_robots_ends_where_one_of_them_helps() -> None:
    """Without the pair of 1.5 s all is on one robot, and takes 2 s; so nothing is proven above 1.5 s."""
    times = np.array([[1.0, 1.0], [INF, 1.5]])
    assert bounds.one_robot_each(times, np.zeros(2), 2.0) == 1.5
    assert optimum(times).makespan == 1.5


@pytest.mark.parametrize(
    ("robots", "tasks", "coverage", "heterogeneity"),
    [(4, 8, 3, 1.0), (5, 10, 3, 8.0), (10, 20, 3, 1.0), (8, 16, 4, 0.0)],
)
def test_middle_sizes_are_proven_and_repeatable(robots: int, tasks: int, coverage: int, heterogeneity: float) -> None:
    times = drawn(3, robots, tasks, coverage, heterogeneity)
    first, second = optimum(times), optimum(times)
    assert first.proven
    holds(times, first)
    assert (first.makespan, first.lower, first.assignment) == (second.makespan, second.lower, second.assignment)


@pytest.mark.parametrize("work_limit", [1e-4, 0.02, 0.2])
def test_a_search_that_ends_early_still_encloses_the_optimum(work_limit: float) -> None:
    times = drawn(5, 8, 24, 4, 1.0)
    best = optimum(times)
    early = optimum(times, work_limit=work_limit)
    assert best.proven
    assert early.lower <= best.makespan <= early.makespan
    holds(times, early)
    again = optimum(times, work_limit=work_limit)
    assert (early.makespan, early.lower, early.assignment) == (again.makespan, again.lower, again.assignment)


def test_a_hard_problem_is_searched_twice_and_stays_repeatable() -> None:
    """Equal times and four robots for each task are the hardest: little work proves nothing."""
    times = drawn(2, 15, 30, 4, 0.0)
    first, second = (optimum(times, work_limit=limit) for limit in (0.2, 0.6))
    assert not second.proven
    assert first.lower <= second.lower <= second.makespan <= first.makespan
    holds(times, second)
    again = optimum(times, work_limit=0.6)
    assert (second.makespan, second.lower, second.assignment) == (again.makespan, again.lower, again.assignment)


@settings(max_examples=30, deadline=None)
@given(tables(robots=4, tasks=6))
def test_kicks_never_make_it_worse_and_are_repeatable(times: Floats) -> None:
    ready = np.zeros(len(times))
    owner = to_the_earliest(times, ready, range(times.shape[1]))
    kicked = kick(times, ready, owner, 20)
    assert best_of_all(times) <= makespan_of(times, ready, kicked) * EXACT
    assert makespan_of(times, ready, kicked) <= makespan_of(times, ready, owner)
    assert (kick(times, ready, owner, 20) == kicked).all()


def test_without_time_nothing_is_proven_but_the_bounds() -> None:
    times = drawn(5, 8, 24, 4, 1.0)
    found = optimum(times, time_limit=0.0)
    assert not found.proven
    assert 0 < found.lower < found.makespan
    holds(times, found)


def test_units_hold_for_very_small_and_very_large_times() -> None:
    times = drawn(1, 4, 8, 3, 1.0)
    usual = optimum(times)
    for factor in (2.0**-40, 2.0**40):
        scaled = optimum(times * factor)
        assert scaled.proven
        assert scaled.makespan / factor == pytest.approx(usual.makespan, rel=2e-6)


def test_no_tasks_take_no_time() -> None:
    assert optimum(np.empty((2, 0))).makespan == 0.0
    assert optimum(np.empty((2, 0)), ready=np.array([1.0, 3.0])).makespan == 3.0


def test_a_task_that_nobody_can_do_is_refused() -> None:
    with pytest.raises(UnreachableTaskError, match="no robot can do task 1; expected at least one"):
        optimum(np.array([[1.0, INF], [2.0, INF]]))


@pytest.mark.parametrize(
    ("times", "sentence"),
    [
        (np.array([1.0, 2.0]), r"times of the shape \(2,\) are no team"),
        (np.empty((0, 2)), r"times of the shape \(0, 2\) are no team"),
        (np.array([[1.0, 0.0]]), "robot 0 needs 0 s for task 1; expected a positive time"),
        (np.array([[1.0], [math.nan]]), "robot 1 needs nan s for task 0; expected a positive time"),
    ],
)
def test_what_is_no_table_of_times_is_refused(times: Floats, sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        optimum(times)


def test_other_arguments_that_are_none_are_refused() -> None:
    times = np.array([[1.0, 2.0]])
    with pytest.raises(UserError, match="a tolerance of 0; expected"):
        optimum(times, tolerance=0)
    for ready in (np.zeros(2), np.array([-1.0]), np.array([INF])):
        with pytest.raises(UserError, match="expected an instant of at least 0 for each of 1 robots"):
            optimum(times, ready=ready)


@pytest.mark.parametrize(
    ("module", "package"), [("ortools.sat.python.cp_model", "ortools"), ("scipy.optimize", "scipy")]
)
def test_a_missing_package_is_told_in_a_sentence(module: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    times = drawn(5, 8, 24, 4, 1.0)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"the package {package}, .* pip install 'lalliance\[study\]'"):
        optimum(times)


def test_a_mission_has_the_yardstick_of_its_hand_over() -> None:
    times = np.array([[10.0, INF], [40.0, 50.0]])
    restart, most, add = (
        optimum_of(mission_of(times, hand_over=rule)) for rule in ("restart", "shared_max", "shared_add")
    )
    assert isinstance(restart, Optimum)
    assert isinstance(most, SharedOptimum)
    assert isinstance(add, SharedOptimum)
    assert [one.makespan for one in (restart, most, add)] == pytest.approx([50.0] * 3)
    assert optimum_of(mission_of(times), "restart").makespan == 50.0
    assert isinstance(optimum_of(mission_of(times)), SharedOptimum)  # a pool's default is shared_max


def test_a_mission_of_another_kind_has_no_optimum_here() -> None:
    plain = mission_of(np.array([[1.0, 2.0]])).model_dump()

    def reason(**changes: object) -> str:
        with pytest.raises(NoYardstickError) as caught:
            optimum_of(type(mission_of(np.ones((1, 1)))).model_validate({**plain, **changes}))
        return str(caught.value)

    assert reason(tasks={"t0": {}, "t1": {"after": ["t0"]}}).endswith("its task t1 cannot be worked on from the start")
    assert reason(tasks={"t0": {"arrives": 2}, "t1": {}}).endswith("its task t0 cannot be worked on from the start")
    assert reason(robots={"r0": {"tasks": {"t0": 1, "t1": 2}, "joins": 3}}).endswith("its robot r0 joins later")
    assert reason(faults=[{"at": 1, "robot": "r0", "kind": "crash"}]).endswith("it has faults")
    assert "noise" in reason(environment={"kind": "task_pool", "noise": 0.1})
    assert reason(environment={"kind": "box_pushing"}).startswith(
        "the optimum of mission test is not known: its environment"
    )
