"""The planners that L-ALLIANCE is compared with: what each decides, and what none of them may ever do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from study.problems import best_of_all, drawn, tables

from lalliance_agents.errors import UserError
from lalliance_study.assignments import Floats
from lalliance_study.baselines import BASELINES, repaired_optimum
from lalliance_study.cbba import Bidder, consensus
from lalliance_study.optimum import optimum, shared_optimum
from lalliance_study.queues import Plan, Situation, carry_out
from world_server.environments.task_pool import HandOver

INF = math.inf
names = pytest.mark.parametrize("name", BASELINES)
RULES: list[HandOver] = ["restart", "shared_max", "shared_add"]


def situation(times: Floats, ready: Floats | None = None) -> Situation:
    return Situation(
        times=times,
        ready=np.zeros(len(times)) if ready is None else ready,
        open=tuple(range(times.shape[1])),
        queues=((),) * len(times),
        chance=np.random.default_rng(0),
    )


def plan(name: str, times: Floats) -> list[list[int]]:
    return [list(queue) for queue in BASELINES[name](situation(times))]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        # r0 takes the shortest task, 1; r1, free at the same instant, task 2 before task 0. At 2 s r0 takes what is left.
        ("greedy", [[1, 0], [2]]),
        # Bids: task 1 by r0 at 2; then task 2 by r1 at 4; then task 0 by r0 at 2 + 6 or r1 at 4 + 5.
        ("auction", [[1, 0], [2]]),
        # The longest first: task 0 to r1 at 5; task 2 to r0, at 5 and not at 9; task 1 to r0, at 7 and not at 8.
        ("lpt", [[2, 1], [0]]),
        ("optimum", [[1, 2], [0]]),
    ],
)
def test_what_each_decides(name: str, expected: list[list[int]]) -> None:
    assert plan(name, np.array([[6.0, 2.0, 5.0], [5.0, 3.0, 4.0]])) == expected


def test_greedy_does_not_wait_for_a_better_robot_and_an_auction_does() -> None:
    """The slow robot is free and takes the long task; the fast one would have done both sooner."""
    times = np.array([[1.0, 2.0], [1.5, 20.0]])
    assert plan("greedy", times) == [[0], [1]]
    assert plan("auction", times) == [[0, 1], []]


def test_random_draws_are_seeded_and_spread() -> None:
    times = np.ones((3, 30))
    first, again, other = (carry_out(BASELINES["random"], times, seed=seed) for seed in (1, 1, 2))
    assert first == again
    assert first.done_by != other.done_by
    assert {first.done_by.count(robot) > 3 for robot in range(3)} == {True}


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 4), st.lists(st.floats(0.5, 50), min_size=1, max_size=12))
def test_for_identical_robots_auction_and_greedy_are_one(robots: int, lengths: list[float]) -> None:
    times = np.tile(lengths, (robots, 1))
    assert plan("auction", times) == plan("greedy", times)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 4), st.lists(st.floats(0.5, 50), min_size=1, max_size=7))
def test_lpt_keeps_grahams_bound_on_identical_robots(robots: int, lengths: list[float]) -> None:
    times = np.tile(lengths, (robots, 1))
    assert carry_out(BASELINES["lpt"], times).makespan <= best_of_all(times) * (4 / 3 - 1 / (3 * robots)) + 1e-9


def test_grahams_bound_is_met_by_his_own_example() -> None:
    """Two robots and the lengths 3, 3, 2, 2, 2: 7 instead of 6."""
    times = np.tile([3.0, 3.0, 2.0, 2.0, 2.0], (2, 1))
    assert carry_out(BASELINES["lpt"], times).makespan == 7.0
    assert carry_out(BASELINES["optimum"], times).makespan == 6.0


@names
@settings(max_examples=30, deadline=None)
@given(times=tables(robots=4, tasks=6))
def test_without_deaths_none_beats_the_optimum(name: str, times: Floats) -> None:
    best, outcome = optimum(times), carry_out(BASELINES[name], times)
    assert best.lower <= outcome.makespan + 1e-9
    assert best.makespan <= outcome.makespan * (1 + 1e-5)
    assert (outcome.reallocations, outcome.plans) == (0, 1)
    for task, (robot, at) in enumerate(zip(outcome.done_by, outcome.done_at, strict=True)):
        assert times[robot, task] <= at + 1e-9


@names
@settings(max_examples=40, deadline=None)
@given(times=tables(robots=4, tasks=6), hand_over=st.sampled_from(RULES), data=st.data())
def test_with_deaths_all_is_done_that_a_survivor_can_do(
    name: str, times: Floats, hand_over: HandOver, data: st.DataObject
) -> None:
    instant = st.sampled_from([0.0, 0.5, 1.0, 3.0, 7.0, 20.0, INF, INF])
    deaths = np.array(data.draw(st.lists(instant, min_size=len(times), max_size=len(times))))
    detection = data.draw(st.sampled_from([0.0, 1.0, 2.5]))
    outcome = carry_out(BASELINES[name], times, deaths, hand_over=hand_over, detection=detection)
    safe = np.isfinite(times[np.isinf(deaths)]).any(axis=0)
    done = np.isfinite(outcome.done_at)
    assert done[safe].all()
    assert (outcome.makespan < INF) == done.all()
    for task in np.flatnonzero(done):
        assert outcome.done_at[task] <= deaths[outcome.done_by[task]]
    yardstick = optimum(times) if hand_over == "restart" else shared_optimum(times, hand_over)
    assert yardstick.lower <= outcome.makespan + 1e-9
    assert outcome == carry_out(BASELINES[name], times, deaths, hand_over=hand_over, detection=detection)


@settings(max_examples=60, deadline=None)
@given(tables(robots=5, tasks=8), st.data())
def test_cbba_converges_without_conflict(times: Floats, data: st.DataObject) -> None:
    ready = np.array(data.draw(st.lists(st.sampled_from([0.0, 2.0, 30.0]), min_size=len(times), max_size=len(times))))
    queues, rounds = consensus(situation(times, ready))
    assert sorted(task for queue in queues for task in queue) == list(range(times.shape[1]))
    assert 1 <= rounds <= times.shape[1]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.01, 5.0), min_size=1, max_size=8), st.floats(0, 3))
def test_a_bid_is_what_a_task_adds_to_the_worth_of_the_best_path(lengths: list[float], ready: float) -> None:
    """Also where longer tasks are in the bundle already, which then are delayed."""

    def worth(held: list[float]) -> float:
        return float(np.exp(-ready - np.cumsum(np.sort(held))).sum())

    bidder = Bidder(dict(enumerate(lengths)), ready, bundle=list(range(1, len(lengths))))
    assert bidder.gain(0) == pytest.approx(worth(lengths) - worth(lengths[1:]), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_where_nobody_dies_cbba_ends_with_the_plan_of_the_auction(seed: int) -> None:
    """The sequential greedy plan (Choi, Brunet, How, theorem 1), by those who know only the highest bids."""
    times = drawn(seed, 5, 12, 3, 3.0)
    assert [sorted(queue) for queue in plan("cbba", times)] == [sorted(queue) for queue in plan("auction", times)]


def test_cbba_bids_on_all_tasks_however_long_they_are() -> None:
    """Thirty tasks of a like length, and one that is a thousand times as long: worth next to nothing, but done."""
    times = np.append(1.0 + 1e-9 * np.arange(30), 1000.0)[None, :]
    queues, _ = consensus(situation(times))
    assert queues == [list(range(31))]


@pytest.mark.parametrize(("hand_over", "makespan"), [("restart", 24.5), ("shared_max", 14.0), ("shared_add", 14.0)])
@pytest.mark.parametrize("name", [name for name in BASELINES if name != "random"])
def test_what_a_death_costs(name: str, hand_over: HandOver, makespan: float) -> None:
    """A robot dies 3 s before the end of its 10 s; at 9.5 s that is noticed, and the other one begins what takes it 15 s."""
    times = np.array([[10.0, INF], [15.0, 8.0]])
    outcome = carry_out(BASELINES[name], times, np.array([7.0, INF]), hand_over=hand_over, detection=2.5)
    assert outcome.makespan == pytest.approx(makespan)
    assert (outcome.done_by, outcome.reallocations, outcome.plans) == ((1, 1), 1, 2)


def test_a_robot_dies_after_so_much_work_and_not_while_it_is_idle() -> None:
    """It has 3 s of life left after its first task, and spends them on what the other one left at its death."""
    times = np.array([[4.0, 10.0], [INF, 6.0], [INF, 30.0]])
    outcome = carry_out(BASELINES["lpt"], times, lives=np.array([7.0, 5.0, INF]), hand_over="shared_max", detection=1.0)
    # The second dies at 5 s with 1/6 left, noticed at 6 s: the first takes it then, and would need 10/6 s.
    assert outcome.done_by == (0, 0)
    assert outcome.makespan == pytest.approx(6.0 + 10 / 6)
    shorter = carry_out(BASELINES["lpt"], times, lives=np.array([5.0, 5.0, INF]), hand_over="shared_max", detection=1.0)
    # Here it dies after 1 s of that, at 7 s, noticed at 8 s, and the slow one does the rest.
    assert shorter.done_by == (0, 2)
    assert shorter.makespan == pytest.approx(8.0 + 30 * (1 / 6 - 1 / 10))


def test_a_task_done_with_the_last_of_a_life_is_done() -> None:
    times = np.array([[4.0, 4.0], [INF, 20.0]])
    outcome = carry_out(BASELINES["lpt"], times, lives=np.array([4.0, INF]), detection=1.0)
    assert (outcome.done_by, outcome.makespan) == ((0, 1), 25.0)


def test_what_nobody_is_left_to_do_stays_undone_and_the_rest_is_done() -> None:
    outcome = carry_out(BASELINES["lpt"], np.array([[4.0, INF], [INF, 6.0]]), np.array([3.0, INF]))
    assert outcome.makespan == INF
    assert (outcome.done_at, outcome.done_by) == ((INF, 6.0), (-1, 1))


def test_a_task_done_at_the_instant_of_a_death_is_done() -> None:
    assert carry_out(BASELINES["lpt"], np.array([[4.0]]), np.array([4.0])).makespan == 4.0


def test_a_death_that_leaves_nothing_to_do_changes_no_plan() -> None:
    outcome = carry_out(BASELINES["lpt"], np.array([[4.0, INF], [INF, 9.0]]), np.array([5.0, INF]))
    assert (outcome.makespan, outcome.plans) == (9.0, 1)


@pytest.mark.parametrize(
    ("deaths", "detection", "sentence"),
    [
        ([1.0], 1.0, "expected a time of at least 0 for each of 2 robots"),
        ([1.0, -1.0], 1.0, "expected a time of at least 0"),
        ([1.0, INF], INF, "a death is noticed after inf s; expected a finite time"),
    ],
)
def test_what_is_no_mission_is_refused(deaths: list[float], detection: float, sentence: str) -> None:
    with pytest.raises(UserError, match=sentence):
        carry_out(BASELINES["lpt"], np.ones((2, 1)), np.array(deaths), detection=detection)
    with pytest.raises(UserError, match=r"lives is .*; expected a time of at least 0 for each of 2 robots"):
        carry_out(BASELINES["lpt"], np.ones((2, 1)), lives=np.array([-1.0, 2.0]))
    with pytest.raises(UserError, match="no robot can do task 0"):
        carry_out(BASELINES["lpt"], np.full((2, 1), INF))


def test_a_plan_that_is_none_is_a_defect() -> None:
    times = np.array([[1.0, 2.0], [INF, 2.0]])
    plans: list[tuple[Plan, str]] = [
        ([[0, 1]], "a plan of 1 queues for 2 robots"),
        ([[0], []], r"a plan for the tasks \[0\]; open are \[0, 1\]"),
        ([[0, 1], [1]], "a plan for the tasks"),
        ([[1], [0]], "robot 1 does task 0, which it cannot"),
    ]
    for wrong, sentence in plans:
        with pytest.raises(ValueError, match=sentence):
            carry_out(lambda _, plan=wrong: plan, times)


@pytest.mark.parametrize(("coverage", "heterogeneity"), [(3, 1.0), (4, 8.0)])
def test_larger_teams_with_deaths(coverage: int, heterogeneity: float) -> None:
    times = drawn(2, 10, 20, coverage, heterogeneity)
    deaths = np.where(np.arange(10) % 4 == 1, 150.0, INF)
    assert np.isfinite(times[np.isinf(deaths)]).any(axis=0).all()  # else the mission could not be completed
    found = {name: carry_out(planner, times, deaths, hand_over="restart") for name, planner in BASELINES.items()}
    quick = repaired_optimum(lambda times, ready: optimum(times, ready=ready, tolerance=1e-2, work_limit=0.1))
    found["quick"] = carry_out(quick, times, deaths)
    lower = optimum(times).lower
    assert all(lower <= outcome.makespan < INF for outcome in found.values())
    assert all(outcome.reallocations > 0 for outcome in found.values())
    assert found["optimum"].makespan < found["random"].makespan
