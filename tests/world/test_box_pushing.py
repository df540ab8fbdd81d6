"""The box: two ends that cannot leave each other behind."""

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic_core import PydanticCustomError

from lalliance_agents.config import Mission
from world_server.environments.base import TaskView, Work
from world_server.environments.box_pushing import BoxPushing

TEAM = {"r2": {"left": 10.0, "right": 10.0}, "r2b": {"left": 20.0, "right": 20.0}, "genghis": {"left": 40.0}}


def mission(tasks: dict[str, Any] | None = None, robots: dict[str, dict[str, float]] = TEAM, **options: Any) -> Mission:
    return Mission.model_validate(
        {
            "name": "test",
            "environment": {"kind": "box_pushing", **options},
            "tasks": {"left": {}, "right": {}} if tasks is None else tasks,
            "robots": {name: {"tasks": times} for name, times in robots.items()},
        }
    )


def box(**options: Any) -> BoxPushing:
    return BoxPushing(mission(**options), seed=0)


def on(**tasks: str) -> dict[str, Work]:
    return {robot: Work(task) for robot, task in tasks.items()}


def step(environment: BoxPushing, dt: float, actions: dict[str, Work]) -> list[Any]:
    return [(done.task, done.by, done.after) for done in environment.step(dt, actions)]


def state(environment: BoxPushing) -> Any:
    """Position and applicability of both ends."""
    return [(round(view.progress, 9), view.applicable) for view in environment.sense().values()]


def alternate(environment: BoxPushing) -> list[tuple[float, str, float]]:
    """The pushes of a robot that turns when its end is not applicable: when each was over, which end, and how far it is."""
    log, now, target = [], 0.0, "left"
    while not all(view.complete for view in environment.sense().values()):
        actions = on(r2=target)
        wait = environment.next_change(actions)
        environment.step(wait, actions)
        now += wait
        if not environment.sense()[target].applicable:
            log.append((round(now, 6), target, round(environment.sense()[target].progress, 9)))
            target = "right" if target == "left" else "left"
    return log


def test_a_lone_robot_goes_to_and_fro_and_loses_no_time() -> None:
    """Own time 10 s per end and slack 0.1: 1 s to the first stop, then 2 s per push, 20 s in all."""
    assert alternate(box()) == [
        (1.0, "left", 0.1),
        (3.0, "right", 0.2),
        (5.0, "left", 0.3),
        (7.0, "right", 0.4),
        (9.0, "left", 0.5),
        (11.0, "right", 0.6),
        (13.0, "left", 0.7),
        (15.0, "right", 0.8),
        (17.0, "left", 0.9),
        (19.0, "right", 1.0),
        (20.0, "left", 1.0),
    ]


@pytest.mark.parametrize("parts", [2, 3, 49, 1000])
def test_rounding_adds_no_push(parts: int) -> None:
    pushes = alternate(box(slack=1 / parts))
    assert len(pushes) == parts + 1
    assert pushes[-1][0] == 20.0


def test_nothing_jams_a_hair_before_the_goal() -> None:
    """With slack 1 the furthest an end can be ahead is the goal; it is reached from any position before."""
    environment = BoxPushing(mission(robots={"r": {"left": 1e6, "right": 1e6}}, slack=1.0), seed=0)
    assert environment.step(1e6 - 1e-7, on(r="left")) == []
    assert [done.task for done in environment.step(1.0, on(r="left"))] == ["left"]


def test_a_jammed_end_comes_free_at_half_the_slack() -> None:
    environment = box()
    environment.step(5.0, on(r2="left"))
    assert state(environment) == [(0.1, False), (0.0, True)]
    assert environment.next_change(on(r2="left")) == math.inf
    assert environment.next_change(on(r2="right")) == pytest.approx(0.5)
    environment.step(0.4, on(r2="right"))
    assert state(environment) == [(0.1, False), (0.04, True)]
    environment.step(9.0, on(r2="left"))
    assert state(environment) == [(0.1, False), (0.04, True)]
    environment.step(0.1, on(r2="right"))
    assert state(environment) == [(0.1, True), (0.05, True)]
    environment.step(9.0, on(r2="left"))
    assert state(environment) == [(0.15, False), (0.05, True)]


def test_the_faster_end_is_carried_along_by_the_slower() -> None:
    """Left 0.1 per second, right 0.05: 0.1 ahead after 2 s, together from there; left ends at 18 s, right at 20 s."""
    environment = box()
    both = on(r2="left", r2b="right")
    assert environment.next_change(both) == pytest.approx(2.0)
    assert environment.step(2.0, both) == []
    assert state(environment) == [(0.2, True), (0.1, True)]
    environment.step(4.0, both)
    assert state(environment) == [(0.4, True), (0.3, True)]
    assert step(environment, 50.0, both) == [
        ("left", ("r2",), pytest.approx(12.0)),
        ("right", ("r2b",), pytest.approx(14.0)),
    ]


def test_an_end_jams_when_the_other_one_is_left_and_is_freed_by_pushing_both() -> None:
    environment = box()
    environment.step(6.0, on(r2="left", r2b="right"))
    environment.step(0.0, on(r2="left"))
    assert state(environment) == [(0.4, False), (0.3, True)]
    environment.step(1.0, {"r2": Work("left"), "r2b": Work("right", pace=0.0)})
    assert state(environment) == [(0.4, False), (0.3, True)]
    environment.step(2.0, {"r2": Work("left"), "r2b": Work("right", pace=0.5)})
    assert state(environment) == [(0.45, True), (0.35, True)]


def test_two_robots_at_one_end_do_not_add_up_and_nobody_pushes_what_he_cannot() -> None:
    environment = box(slack=1.0)
    environment.step(4.0, on(r2="left", r2b="left", genghis="right", stranger="right"))
    assert state(environment) == [(0.4, True), (0.0, True)]
    assert step(environment, 8.0, on(r2="left", r2b="left")) == [("left", ("r2",), pytest.approx(6.0))]
    assert environment.sense()["left"] == TaskView(complete=True, applicable=False, progress=1.0)


def test_equals_finish_an_end_together() -> None:
    actions = {"r2": Work("left", 0.5), "r2b": Work("left"), "genghis": Work("left")}
    (done,) = box(slack=1.0).step(20.0, actions)
    assert done.by == ("r2", "r2b")


@pytest.mark.parametrize(
    ("tasks", "path"),
    [
        ({"left": {}}, ["tasks"]),
        ({"left": {}, "right": {}, "top": {}}, ["tasks"]),
        ({"left": {}, "right": {"after": ["left"]}}, ["tasks", "right", "after"]),
        ({"left": {"arrives": 3}, "right": {}}, ["tasks", "left", "arrives"]),
    ],
)
def test_a_mission_that_is_no_box_is_refused_with_its_place(tasks: dict[str, Any], path: list[str]) -> None:
    with pytest.raises(PydanticCustomError) as refused:
        BoxPushing.check(mission(tasks, {"r": dict.fromkeys(tasks, 1.0)}))
    assert refused.value.context is not None
    assert refused.value.context["path"] == path


works = st.dictionaries(
    st.sampled_from(list(TEAM)),
    st.builds(Work, st.sampled_from(["left", "right"]), st.sampled_from([1.0, 1.0, 0.5, 0.3, 0.0])),
)
scripts = st.lists(
    st.tuples(st.one_of(st.integers(0, 8).map(float), st.sampled_from([0.5, 2.5]), st.floats(0, 10)), works),
    min_size=1,
    max_size=12,
)
slacks = st.one_of(st.sampled_from([0.001, 0.05, 0.1, 0.5, 1.0]), st.floats(0.001, 1))


@settings(deadline=None)
@given(slacks, scripts, st.data())
def test_cutting_a_span_into_steps_changes_nothing(
    slack: float, script: list[tuple[float, dict[str, Work]]], data: st.DataObject
) -> None:
    whole, pieces = box(slack=slack), box(slack=slack)
    for dt, actions in script:
        expected = [(task, by, pytest.approx(after, abs=1e-6)) for task, by, after in sorted(step(whole, dt, actions))]
        shares = sorted(data.draw(st.lists(st.sampled_from([0.0, 0.1, 1 / 3, 0.5, 0.77, 1.0]), max_size=4)))
        found: list[Any] = []
        for begin, end in pairwise([0.0, *(share * dt for share in shares), dt]):
            found += [(task, by, begin + after) for task, by, after in step(pieces, end - begin, actions)]
        assert sorted(found) == expected
        for one, other in zip(whole.sense().values(), pieces.sense().values(), strict=True):
            assert (one.complete, one.applicable) == (other.complete, other.applicable)
            assert one.progress == pytest.approx(other.progress, abs=1e-6)


@settings(deadline=None)
@given(slacks, scripts)
def test_what_holds_of_every_run(slack: float, script: list[tuple[float, dict[str, Work]]]) -> None:
    """Ends never part by more than the slack, never move back, end once; an open end can be pushed; changes are foretold."""
    environment = box(slack=slack)
    ended: list[str] = []
    before = environment.sense()
    for dt, actions in script:
        foretold = environment.next_change(actions)
        environment.step(0.0, actions)
        settled = environment.sense()
        ended += [done.task for done in environment.step(dt, actions)]
        after = environment.sense()
        left, right = after.values()
        assert abs(left.progress - right.progress) <= slack + 1e-11
        assert all(after[task].progress >= before[task].progress for task in after)
        assert sorted(ended) == sorted(task for task, view in after.items() if view.complete)
        assert left.applicable or right.applicable or len(ended) == 2
        looks = [(view.complete, view.applicable) for view in settled.values()]
        assert foretold <= dt + 1e-8 or looks == [(view.complete, view.applicable) for view in after.values()]
        for task, view in settled.items():
            pushed = any(work.task == task and work.pace and task in TEAM[name] for name, work in actions.items())
            moved = after[task].progress > view.progress
            assert moved or not (view.applicable and pushed and dt > 1e-6)
        before = after
