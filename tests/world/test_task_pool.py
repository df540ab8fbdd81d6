"""The pool of tasks: who finishes what and when, for each way of handing over."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.config import Mission
from world_server.environments.base import Work
from world_server.environments.task_pool import TaskPool, deviation

Script = list[tuple[float, dict[str, Work]]]


def pool(robots: dict[str, dict[str, float]], tasks: dict[str, Any], *, seed: int = 0, **options: object) -> TaskPool:
    mission = Mission.model_validate(
        {
            "name": "test",
            "deadline": 1e9,
            "environment": {"kind": "task_pool", **options},
            "tasks": tasks,
            "robots": {name: {"tasks": times} for name, times in robots.items()},
        }
    )
    return TaskPool(mission, seed=seed)


def on(**tasks: str) -> dict[str, Work]:
    return {robot: Work(task) for robot, task in tasks.items()}


def play(environment: TaskPool, script: Script) -> list[Any]:
    """The completions while the script runs, each with its time since the start."""
    now, found = 0.0, []
    for dt, actions in script:
        for done in environment.step(dt, actions):
            assert 0 <= done.after <= dt
            found.append((now + done.after, done.task, done.by))
        now += dt
    return found


TWO = {"fast": {"a": 10.0}, "slow": {"a": 40.0}}


@pytest.mark.parametrize(
    ("hand_over", "half_way", "expected"),
    [
        # fast alone does 0.4 in 4 s; then both: the rest at 1/10 per second.
        ("shared_max", 0.4, [(10.0, "a", ("fast",))]),
        # the rest, 0.6, at 1/10 + 1/40 per second: 4.8 s.
        ("shared_add", 0.4, [(8.8, "a", ("fast", "slow"))]),
        # slow begins from zero and is not done when fast is.
        ("restart", 0.4, [(10.0, "a", ("fast",))]),
    ],
)
def test_a_second_robot_joins(
    hand_over: str, half_way: float, expected: list[tuple[float, str, tuple[str, ...]]]
) -> None:
    environment = pool(TWO, {"a": {}}, hand_over=hand_over)
    assert play(environment, [(4.0, on(fast="a"))]) == []
    assert environment.sense()["a"].progress == pytest.approx(half_way)
    found = play(environment, [(20.0, on(fast="a", slow="a"))])
    assert [(4.0 + time, task, by) for time, task, by in found] == [
        (pytest.approx(time), task, by) for time, task, by in expected
    ]
    assert environment.sense()["a"].complete


@pytest.mark.parametrize(
    ("hand_over", "progress", "left"), [("shared_max", 0.5, 20.0), ("shared_add", 0.5, 20.0), ("restart", 0.0, 40.0)]
)
def test_the_work_left_is_handed_over_or_lost(hand_over: str, progress: float, left: float) -> None:
    environment = pool(TWO, {"a": {}}, hand_over=hand_over)
    environment.step(5.0, on(fast="a"))
    assert environment.sense()["a"].progress == pytest.approx(0.5)
    environment.step(0.0, {})
    assert environment.sense()["a"].progress == pytest.approx(progress)
    assert environment.next_change(on(slow="a")) == pytest.approx(left)
    assert play(environment, [(50.0, on(slow="a"))]) == [(pytest.approx(left), "a", ("slow",))]


def test_a_step_of_no_length_tells_of_an_interruption_and_asking_ahead_does_not() -> None:
    environment = pool(TWO, {"a": {}}, hand_over="restart")
    environment.step(9.0, on(fast="a"))
    assert environment.next_change({}) == math.inf
    assert environment.next_change(on(fast="a")) == pytest.approx(1.0)
    environment.step(0.0, {})
    assert environment.next_change(on(fast="a")) == pytest.approx(10.0)


def test_a_stuck_robot_stays_on_its_attempt() -> None:
    environment = pool(TWO, {"a": {}}, hand_over="restart")
    environment.step(5.0, on(fast="a"))
    environment.step(100.0, {"fast": Work("a", pace=0.0)})
    assert environment.sense()["a"].progress == pytest.approx(0.5)
    assert play(environment, [(20.0, {"fast": Work("a", pace=0.5)})]) == [(pytest.approx(10.0), "a", ("fast",))]


@pytest.mark.parametrize("hand_over", ["shared_max", "shared_add", "restart"])
def test_equals_finish_together_and_one_at_rest_has_no_part(hand_over: str) -> None:
    environment = pool(
        {"z": {"a": 10.0}, "b": {"a": 5.0}, "c": {"a": 10.0}, "d": {"a": 1.0}}, {"a": {}}, hand_over=hand_over
    )
    actions = {"z": Work("a"), "b": Work("a", 0.5), "c": Work("a", 0.5), "d": Work("a", 0.0)}
    (done,) = environment.step(20.0, actions)
    assert done.by == (("b", "c", "z") if hand_over == "shared_add" else ("b", "z"))


def test_what_opens_inside_a_step_is_worked_on_from_that_instant() -> None:
    """One step of 100 s holds two arrivals, two prerequisites and four completions."""
    environment = pool(
        {"r": {"first": 4.0}, "s": {"second": 3.0}, "t": {"late": 2.0}, "u": {"last": 1.5}},
        {"last": {"after": ["late", "second"]}, "second": {"after": ["first"]}, "first": {}, "late": {"arrives": 20.0}},
    )
    actions = on(r="first", s="second", t="late", u="last")
    assert [view.applicable for view in environment.sense().values()] == [False, False, True, False]
    assert environment.next_change(actions) == 4.0
    found = play(environment, [(100.0, actions)])
    assert found == [(4.0, "first", ("r",)), (7.0, "second", ("s",)), (22.0, "late", ("t",)), (23.5, "last", ("u",))]
    assert environment.next_change(actions) == math.inf


def test_an_arrival_is_a_change_even_if_nobody_waits_for_it() -> None:
    environment = pool({"r": {"a": 4.0, "b": 4.0}}, {"a": {"arrives": 3.0}, "b": {"arrives": 5.0}})
    assert environment.next_change({}) == 3.0
    environment.step(3.0, {})
    assert environment.sense()["a"].applicable
    assert environment.next_change({}) == 2.0


def test_vain_work_achieves_nothing() -> None:
    environment = pool({"r": {"a": 1.0, "b": 1.0}, "s": {"b": 1.0}}, {"a": {}, "b": {"after": ["a"]}})
    vain = on(s="a", r="b", stranger="a")
    assert environment.next_change(vain) == environment.next_change(on(r="no-task")) == math.inf
    assert environment.step(10.0, vain) == []
    assert [view.progress for view in environment.sense().values()] == [0.0, 0.0]
    assert play(environment, [(10.0, on(r="a", s="a"))]) == [(1.0, "a", ("r",))]
    assert environment.step(10.0, on(r="a")) == []


def test_a_task_is_not_left_unfinished_by_rounding() -> None:
    """Eighty steps of 0.1 s are a little less than 8 s, and yet the task takes exactly these."""
    environment = pool({"r": {"a": 8.0}}, {"a": {}})
    found = [len(environment.step(0.1, on(r="a"))) for _ in range(80)]
    assert found == [0] * 79 + [1]


@pytest.mark.parametrize("time", [1e4, 3e5, 9e8])
def test_a_long_task_ends_neither_early_nor_never(time: float) -> None:
    environment = pool({"r": {"a": time}}, {"a": {}})
    assert environment.step(time / 7, on(r="a")) == []
    assert environment.step(time * (6 / 7 - 1e-5), on(r="a")) == []
    assert environment.step(time * (1e-5 - 1e-12), on(r="a")) == []
    left = environment.next_change(on(r="a"))
    assert left == pytest.approx(time * 1e-12, rel=1e-3)
    assert environment.step(0.0, on(r="a")) == []
    environment.step(2 * left, on(r="a"))
    assert environment.sense()["a"].complete


def test_a_task_ends_exactly_inside_a_step() -> None:
    environment = pool({"r": {"a": 7.0}}, {"a": {}})
    environment.step(1.0, on(r="a"))
    assert play(environment, [(1e6, on(r="a"))]) == [(pytest.approx(6.0, rel=1e-14), "a", ("r",))]


def test_a_task_shorter_than_any_length_of_time_ends_at_once() -> None:
    environment = pool({"r": {"a": 5e-324}, "s": {"b": 1e-12}}, {"a": {}, "b": {"after": ["a"]}})
    assert play(environment, [(5.0, on(r="a", s="b"))]) == [(0.0, "a", ("r",)), (pytest.approx(0), "b", ("s",))]


@pytest.mark.parametrize("dt", [-1.0, math.inf, math.nan])
def test_a_step_has_a_length(dt: float) -> None:
    with pytest.raises(ValueError, match="seconds"):
        pool(TWO, {"a": {}}).step(dt, {})


def test_a_pace_is_a_number() -> None:
    with pytest.raises(ValueError, match="pace"):
        Work("a", pace=-1.0)


def attempt_times(seed: int, order: str) -> dict[tuple[str, int], float]:
    """How long each attempt of two robots would take if they begin attempts in `order`."""
    environment = pool(TWO, {"a": {}}, seed=seed, noise=0.2, hand_over="restart")
    found, begun = {}, {"fast": 0, "slow": 0}
    for letter in order:
        robot = "fast" if letter == "f" else "slow"
        begun[robot] += 1
        found[robot, begun[robot]] = environment.next_change(on(**{robot: "a"}))
        environment.step(0.0, on(**{robot: "a"}))
        environment.step(0.0, {})
    return found


def test_noise_depends_on_seed_robot_task_and_attempt_alone() -> None:
    times = attempt_times(7, "ffss")
    assert times == attempt_times(7, "sfsf")
    assert len(set(times.values())) == 4
    assert all(8 < time < 12 for (robot, _), time in times.items() if robot == "fast")
    assert times["fast", 2] == 10 * (1 + 0.2 * deviation(7, "fast", "a", 2))
    assert times != attempt_times(8, "ffss")


def test_deviations_are_uniform_and_stay_as_they_are() -> None:
    """The literal number guards recorded runs: a seed means the same in every version."""
    drawn = sorted(deviation(1, robot, "a", number) for robot in ("r", "s") for number in range(500))
    assert all(abs(value - (2 * (rank + 0.5) / 1000 - 1)) < 0.1 for rank, value in enumerate(drawn))
    assert deviation(7, "lifter", "crate-1", 1) == 0.40512122992047117


ROBOTS = ("r", "s", "t")
TASKS = ("a", "b", "c", "d")


@st.composite
def missions(draw: st.DrawFn) -> dict[str, Any]:
    """Arguments of `pool`: whole times on purpose, so that many things happen at once and at the ends of steps."""
    time = st.one_of(st.integers(1, 8).map(float), st.floats(0.01, 50))
    own = {robot: draw(st.dictionaries(st.sampled_from(TASKS), time, min_size=1)) for robot in ROBOTS}
    own["r"] = {task: draw(time) for task in TASKS}
    tasks = {
        task: {
            "after": draw(st.lists(st.sampled_from(TASKS[:index]), max_size=2, unique=True)) if index else [],
            "arrives": draw(st.one_of(st.just(0.0), st.integers(0, 10).map(float), st.floats(0, 30))),
        }
        for index, task in enumerate(TASKS)
    }
    hand_over = draw(st.sampled_from(["shared_max", "shared_add", "restart"]))
    noise = draw(st.sampled_from([0.0, 0.3]))
    return {"robots": own, "tasks": tasks, "hand_over": hand_over, "noise": noise, "seed": draw(st.integers(0, 99))}


def works() -> st.SearchStrategy[dict[str, Work]]:
    pace = st.one_of(st.just(1.0), st.sampled_from([0.0, 0.5, 0.3]))
    return st.dictionaries(st.sampled_from(ROBOTS), st.builds(Work, st.sampled_from(TASKS), pace))


scripts = st.lists(
    st.tuples(st.one_of(st.integers(0, 12).map(float), st.floats(0, 30)), works()), min_size=1, max_size=6
)


def cut(data: st.DataObject, dt: float) -> list[float]:
    """`dt` in pieces."""
    shares = sorted(data.draw(st.lists(st.sampled_from([0.0, 0.1, 1 / 3, 0.5, 0.77, 1.0]), max_size=4)))
    points = [0.0, *(share * dt for share in shares), dt]
    return [after - before for before, after in pairwise(points)]


@settings(deadline=None)
@given(missions(), scripts, st.data())
def test_cutting_a_span_into_steps_changes_nothing(
    mission: dict[str, Any], script: Script, data: st.DataObject
) -> None:
    whole, pieces = pool(**mission), pool(**mission)
    for dt, actions in script:
        expected = play(whole, [(dt, actions)])
        found = play(pieces, [(piece, actions) for piece in cut(data, dt)])
        assert sorted(found, key=by_task) == [
            (pytest.approx(time, abs=1e-6), task, by) for time, task, by in sorted(expected, key=by_task)
        ]
        for one, other in zip(whole.sense().values(), pieces.sense().values(), strict=True):
            assert (one.complete, one.applicable) == (other.complete, other.applicable)
            assert one.progress == pytest.approx(other.progress, abs=1e-6)


def by_task(completion: tuple[float, str, tuple[str, ...]]) -> str:
    return completion[1]


@settings(deadline=None)
@given(missions(), scripts)
def test_what_holds_of_every_run(mission: dict[str, Any], script: Script) -> None:
    """Tasks end once, in order of time, not before they can; work that is shared is never lost; changes are foretold."""
    environment = pool(**mission)
    ended: dict[str, float] = {}
    now, before = 0.0, environment.sense()
    for dt, actions in [*script, (1000.0, on(r="a")), (1000.0, on(r="b")), (1000.0, on(r="c")), (1000.0, on(r="d"))]:
        foretold = environment.next_change(actions)
        completions = environment.step(dt, actions)
        assert [done.after for done in completions] == sorted(done.after for done in completions)
        for done in completions:
            assert done.task not in ended
            assert done.after >= foretold - 1e-8
            assert done.by
            assert set(done.by) <= {robot for robot, work in actions.items() if work.task == done.task and work.pace}
            ended[done.task] = now + done.after
        after = environment.sense()
        changed = applicability(after) != applicability(before)
        assert not changed or foretold <= dt + 1e-8
        if mission["hand_over"] != "restart":
            assert all(after[task].progress >= before[task].progress for task in TASKS)
        now, before = now + dt, after
    assert ended.keys() == set(TASKS)
    for task, spec in mission["tasks"].items():
        assert all(ended[task] >= ended[needed] for needed in spec["after"])
        assert ended[task] >= spec["arrives"] - 1e-8


def applicability(senses: Mapping[str, Any]) -> list[bool]:
    return [view.applicable for view in senses.values()]
