"""The world's core, driven by hand: every instant is given, and what it tells is compared as it stands."""

import math
from collections.abc import Mapping, Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.config import Mission
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.messages import Action, DecisionMade
from world_server.bodies import DEAD_MAN
from world_server.environments.base import Completion, Environment, TaskView, Work
from world_server.world import TRIAL_PAUSE, Happening, Stage, World

PAIR = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 4, b: 8}}
  right: {tasks: {a: 8, b: 4}}
deadline: 100
"""

SOLO = "name: solo\ntasks: {a: {}}\nrobots: {left: {tasks: {a: 4}}}\n"


class Log:
    """A world that begins at 0, and what it told, one line each."""

    def __init__(self, mission: str | Mission = PAIR, *, present: Sequence[str] = ("left", "right")) -> None:
        self.lines: list[str] = []
        self.mission = parse_mission(mission, "test.yaml") if isinstance(mission, str) else mission
        self.world = World(self.mission, 0.0, self._tell)
        for robot in present:
            self.world.presence(robot, True, 0.0)

    def _tell(self, happening: Happening) -> None:
        self.lines.append(f"{happening.elapsed:g} {happening.kind}: {happening.text}")

    def begin(self, now: float = 0.0) -> World:
        """Start the first trial, and forget what was told before."""
        self.world.begin(now)
        self.lines.clear()
        return self.world

    def act(self, robot: str, task: str | None, now: float, *, trial: int | None = None, fewest: int = 0) -> None:
        trial = self.world.trial if trial is None else trial
        header = {"sender": robot, "incarnation": 1, "seq": 1, "at": 0.0}
        self.world.act(Action(**header, task=task, trial=trial, fewest=fewest), now)

    def work(self, robot: str, task: str, since: float, until: float) -> None:
        """Have `robot` act on `task`, refreshed each second; the world stands at `until` then."""
        self.act(robot, task, since)
        while since + 1.0 < until:
            since += 1.0
            self.act(robot, task, since)
        self.world.advance(until)

    def attempts(self, task: str) -> list[tuple[str, float]]:
        tasks = self.world.summary()["tasks"]
        return [(attempt["robot"], pytest.approx(attempt["at"])) for attempt in tasks[task]["attempts"]]


def test_a_mission_waits_runs_and_is_complete_with_its_last_task() -> None:
    log = Log(present=())
    world = log.world
    assert (world.stage, world.missing()) == (Stage.WAITING, ["left", "right"])
    assert not world.some_there()
    world.presence("right", True, 0.5)
    world.presence("right", True, 0.6)
    world.advance(3.0)
    assert all(not view.applicable for view in world.tasks().values())
    world.presence("left", True, 3.0)
    world.begin(4.0)
    world.begin(4.5)
    assert all(view.applicable for view in world.tasks().values())
    log.act("left", "a", 5.0)
    log.act("right", "b", 5.5)
    world.advance(6.5)
    assert (world.tasks()["a"].progress, world.tasks()["b"].progress) == (0.375, 0.25)
    log.act("left", "a", 7.0)
    log.act("right", "b", 7.0)
    world.advance(9.25)
    log.act("right", "b", 9.25)
    log.act("left", None, 9.25)
    world.advance(50.0)
    world.advance(500.0)
    assert log.lines == [
        "0 present: right is there",
        "0 present: left is there",
        "0 trial: trial 1 begins (adaptive learning)",
        "5 complete: a completed by left",
        "5.5 complete: b completed by right",
        "5.5 complete: complete after 5.5 s",
    ]
    summary = world.summary()
    assert (summary["complete"], summary["makespan"], summary["trials"]) == (True, 5.5, [5.5])
    assert summary["tasks"]["b"] == {
        "completed_at": 5.5,
        "by": ["right"],
        "attempts": [{"robot": "right", "at": 1.5, "ended": "complete"}],
    }
    assert all(view.complete and not view.applicable for view in world.tasks().values())


def test_a_mission_has_failed_exactly_at_its_deadline_and_nothing_changes_that() -> None:
    log = Log()
    world = log.begin(0.1)
    log.act("left", "a", 98.1)
    world.advance(100.0)
    assert world.stage is Stage.RUNNING
    world.advance(100.1)
    log.act("left", "a", 100.2)
    world.presence("left", False, 101.0)
    world.advance(200.0)
    assert log.lines == ["100 failed: not complete by the deadline of 100 s"]
    assert (world.over, world.summary()["makespan"], world.orders()) == (True, None, [])


def test_a_task_that_ends_with_the_deadline_is_complete() -> None:
    log = Log(SOLO + "deadline: 6\n", present=["left"])
    log.begin()
    log.work("left", "a", 2.0, 9.0)
    assert log.world.stage is Stage.COMPLETE
    assert log.world.makespan == 6.0


@pytest.mark.parametrize("steps", [[20.0], [3.49, 3.5, 3.51, 20.0], [n / 8 for n in range(161)]])
def test_the_dead_man_switch_acts_at_its_exact_instant_however_time_is_cut(steps: list[float]) -> None:
    log = Log()
    world = log.begin()
    log.act("left", "b", 1.0)
    for now in steps:
        world.advance(now)
    assert world.tasks()["b"].progress == pytest.approx(DEAD_MAN / 8)
    assert world.bodies["left"].task is None
    log.act("left", "b", 20.0)
    world.advance(21.0)
    assert world.tasks()["b"].progress == pytest.approx((DEAD_MAN + 1.0) / 8)
    assert log.attempts("b") == [("left", 1.0), ("left", 20.0)]


def test_work_that_was_interrupted_by_the_dead_man_switch_begins_anew_where_attempts_do() -> None:
    """Also when the robot acts again in the very instant in which the switch had acted."""
    restart = PAIR + "environment: {kind: task_pool, hand_over: restart}\n"
    for again in (DEAD_MAN, DEAD_MAN + 1e-6, 10.0):
        log = Log(restart)
        world = log.begin()
        log.act("left", "b", 0.0)
        log.act("left", "b", again)
        world.advance(again + 2.0)
        assert world.tasks()["b"].progress == pytest.approx(2.0 / 8)


def test_a_robot_that_is_gone_does_no_work_and_begins_again_when_it_is_back() -> None:
    log = Log()
    world = log.begin()
    log.act("left", "a", 0.0)
    world.presence("left", False, 1.0)
    log.act("left", "a", 1.5)  # was still on its way
    world.advance(2.0)
    assert world.tasks()["a"].progress == 0.25
    world.presence("left", True, 60.0)
    world.advance(61.0)
    assert world.tasks()["a"].progress == 0.25
    log.work("left", "a", 61.0, 70.0)
    assert log.lines == ["1 gone: left is gone", "60 present: left is there", "64 complete: a completed by left"]


def test_a_robot_that_joins_late_is_waited_for_by_nobody_and_ordered_until_it_is_there() -> None:
    late = PAIR.replace("deadline", "  late: {joins: 3, tasks: {a: 1}}\n  later: {joins: 5, tasks: {b: 1}}\ndeadline")
    log = Log(late)
    assert log.world.missing() == []
    world = log.begin()
    told = []
    for now in (2.9, 3.0, 4.0, 5.0, 6.0):
        world.advance(now)
        if now == 4.0:
            world.presence("late", True, now)
        told.append([(order.number, order.deed, order.robot) for order in world.orders()])
    assert told == [[], [(1, "start", "late")], [], [(2, "start", "later")], [(2, "start", "later")]]
    world.presence("later", True, 6.5)
    assert world.orders() == []
    log.work("late", "a", 7.0, 9.0)
    assert log.lines[-1] == "8 complete: a completed by late"


def test_a_late_robot_that_is_there_from_the_beginning_is_not_ordered_again() -> None:
    late = PAIR.replace("deadline", "  late: {joins: 3, tasks: {a: 1}}\ndeadline")
    world = Log(late, present=["left", "right", "late"]).begin()
    world.advance(4.0)
    assert world.orders() == []


def test_trials_follow_each_other_after_a_pause_and_faults_belong_to_the_last() -> None:
    log = Log(SOLO + "phases: [{learning: active, trials: 2}, {learning: adaptive}]\n"
              "faults: [{at: 1, robot: left, kind: crash}]\n", present=["left"])  # fmt: skip
    world = log.begin()
    log.work("left", "a", 0.0, 4.0)
    assert (world.trial, world.learning, world.live) == (1, "active", False)
    assert (world.tasks()["a"].complete, world.orders()) == (True, [])
    log.act("left", "a", 4.5)
    world.advance(4.0 + TRIAL_PAUSE)
    assert world.tasks()["a"] == TaskView(complete=False, applicable=True, progress=0.0)
    log.work("left", "a", 6.0, 10.0 + TRIAL_PAUSE)
    assert (world.trial, world.learning, world.live) == (3, "adaptive", True)
    log.act("left", "a", 11.5, trial=2)  # was meant for the trial before
    world.advance(12.0)
    assert (world.tasks()["a"].progress, [order.robot for order in world.orders()]) == (0.0, ["left"])
    log.work("left", "a", 12.0, 20.0)
    assert log.lines == [
        "4 complete: a completed by left",
        "4 trial: trial 1 complete after 4.0 s",
        "0 trial: trial 2 begins (active learning)",
        "5 complete: a completed by left",
        "5 trial: trial 2 complete after 5.0 s",
        "0 trial: trial 3 begins (adaptive learning)",
        "1 fault: fault: crash of left",
        "1 warning: nobody here can reach the robots' processes: crash of left has to be made by hand",
        "5 complete: a completed by left",
        "5 complete: complete after 5.0 s",
    ]
    assert world.summary()["trials"] == [4.0, 5.0, 5.0]
    assert world.summary()["makespan"] == 5.0


def test_training_ends_early_when_the_monitors_of_all_who_are_there_are_full() -> None:
    log = Log(PAIR + "parameters: {trials: 3}\n"
              "phases: [{learning: active, trials: 9, until: full}, {learning: adaptive}]\n")  # fmt: skip
    world = log.begin()
    now = 0.0
    for left, right in ((1, 3), (3, 2), (3, 3)):
        assert (world.learning, world.live) == ("active", False)
        log.act("left", "a", now, fewest=left)
        log.act("right", "b", now, fewest=right)
        for _ in range(5):
            now += 1.0
            log.act("left", "a", now, fewest=left)
            log.act("right", "b", now, fewest=right)
        world.advance(now)
    assert (world.trial, world.learning, world.live) == (4, "adaptive", True)


@pytest.mark.parametrize("steps", [[30.0], [7.0, 30.0], [n / 20 for n in range(601)]])
def test_a_trial_ends_with_its_last_task_however_time_is_cut(steps: list[float]) -> None:
    log = Log(SOLO.replace("a: 4", "a: 2") + "phases: [{trials: 2}]\n", present=["left"])
    world = log.begin()
    log.act("left", "a", 0.01)
    for now in steps:
        world.advance(now)
    assert log.lines == [
        "2.01 complete: a completed by left",
        "2.01 trial: trial 1 complete after 2.0 s",
        "0 trial: trial 2 begins (adaptive learning)",
    ]
    assert world.elapsed == pytest.approx(30.0 - 2.01 - TRIAL_PAUSE)


def test_what_makes_no_sense_is_ignored() -> None:
    log = Log()
    log.act("left", "a", 0.0)
    world = log.begin(1.0)
    for task, robot, trial in (("a", "stranger", 1), ("a", "left", 0), ("a", "left", 2), ("c", "left", 1)):
        log.act(robot, task, 1.0, trial=trial)
        world.advance(1.5)
        assert world.bodies["left"].task is None
    world.presence("stranger", True, 2.0)
    world.presence("stranger", False, 2.0)
    world.decided(decision("stranger", "left"), 2.0)
    world.decided(decision("left", "right", trial=2), 2.0)
    log.act("left", "a", 3.0)
    log.act("left", "c", 4.0)  # there is no such task: it stops
    world.advance(50.0)
    assert world.tasks()["a"].progress == pytest.approx(0.25)
    assert (log.lines, log.attempts("a"), world.bodies.keys()) == ([], [("left", 2.0)], {"left", "right"})


def test_an_instant_that_has_passed_changes_nothing() -> None:
    log = Log()
    world = log.begin()
    log.act("left", "a", 0.0)
    world.advance(2.0)
    for now in (1.0, -5.0, 2.0, 0.0):
        world.advance(now)
        log.act("left", "a", now)
        world.presence("right", now > 0, now)
    assert (world.elapsed, world.tasks()["a"].progress) == (2.0, 0.5)
    world.advance(4.0)
    assert log.lines[-1] == "4 complete: a completed by left"


def decision(sender: str, other: str, *, trial: int = 1) -> DecisionMade:
    header = {"sender": sender, "incarnation": 1, "seq": 1, "at": 0.0}
    fields = {"task": "a", "cause": "silence", "active_for": 0.0, "factors": {}, "teammates": []}
    return DecisionMade(**header, **fields, verb="activate", other=other, trial=trial)


def test_a_takeover_is_told() -> None:
    log = Log()
    world = log.begin()
    log.act("left", "a", 1.0)
    world.presence("left", False, 2.0)
    log.act("right", "a", 3.5)
    world.decided(decision("right", "left"), 3.5)
    assert log.lines == ["2 gone: left is gone", "3.5 takeover: right takes a from left (silence)"]
    [takeover] = world.summary()["takeovers"]
    assert (takeover["failed_at"], takeover["after_failure"]) == (2.0, 1.5)


CRASH = (
    PAIR + "faults: [{at: 2, robot: left, kind: crash, restart: true, until: 5}, {at: 20, robot: left, kind: crash}]\n"
)


def test_a_crash_is_ordered_until_it_is_seen_and_so_is_the_restart() -> None:
    log = Log(CRASH)
    world = log.begin()
    seen: list[tuple[float, list[tuple[int, str]]]] = []
    presences = {4.0: False, 7.0: True, 22.0: False}
    for half in range(50):
        now = half / 2
        world.advance(now)
        if now in presences:
            world.presence("left", presences[now], now)
        orders = [(order.number, f"{order.deed} {order.robot}") for order in world.orders()]
        if not seen or seen[-1][1] != orders:
            seen.append((now, orders))
    assert seen == [
        (0.0, []), (2.0, [(1, "kill left")]), (4.0, []), (5.0, [(2, "start left")]), (7.0, []),
        (20.0, [(3, "kill left")]), (22.0, []),
    ]  # fmt: skip
    fields = {"kind": "crash", "robot": "left", "text": "crash of left", "fired": True, "count": 1}
    assert world.summary()["faults"] == [
        {**fields, "name": "1-crash", "at": 2.0, "until": 5.0, "state": "over", "fired_at": 4.0},
        {**fields, "name": "2-crash", "at": 20.0, "until": None, "state": "on", "fired_at": 22.0},
    ]


def test_a_crash_that_nobody_carried_out_or_that_came_by_itself_has_not_fired() -> None:
    log = Log(CRASH)
    world = log.begin()
    world.presence("left", False, 1.0)  # by itself, before its time
    world.presence("left", True, 1.5)
    world.advance(10.0)
    assert [str(order.deed) for order in world.orders()] == ["kill"]
    assert [(fault["fired"], fault["fired_at"]) for fault in world.summary()["faults"]] == [(False, None)] * 2


class Instant(Environment):
    """An environment of a user's own: `a` is complete as soon as somebody begins it, and `b` from the start."""

    def __init__(self, mission: Mission, *, seed: int) -> None:
        self._done = False

    def step(self, dt: float, actions: Mapping[str, Work]) -> list[Completion]:
        by = tuple(sorted(robot for robot, work in actions.items() if work.task == "a"))
        if self._done or not by:
            return []
        self._done = True
        return [Completion("a", by, 0.0)]

    def next_change(self, actions: Mapping[str, Work]) -> float:
        return math.inf

    def sense(self) -> dict[str, TaskView]:
        return {
            "a": TaskView(self._done, not self._done, 0.0),
            "b": TaskView(complete=True, applicable=False, progress=1.0),
        }


def test_what_is_complete_at_once_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("world_server.environments.create", Instant)
    log = Log()
    world = log.begin()
    log.act("left", "a", 1.5)
    assert log.lines == ["1.5 complete: a completed by left", "1.5 complete: complete after 1.5 s"]
    assert world.summary()["tasks"]["b"]["completed_at"] is None
    assert world.summary()["makespan"] == 1.5


TEAM = """
name: team
environment: {kind: task_pool, hand_over: %s}
tasks: {a: {}, b: {after: [a]}, c: {arrives: 3}}
robots: {r0: {tasks: {a: 1, b: 2, c: 3}}, r1: {tasks: {a: 2, b: 1}}, r2: {tasks: {c: 1, a: 5}}}
phases: [{trials: 2}]
deadline: 40
"""

STEPS = st.tuples(
    st.sampled_from([0.0, 0.05, 0.3, 1.0, 2.0, DEAD_MAN, 4.0]),
    st.sampled_from(["act", "act", "act", "act", "gone", "there", "advance", "decided"]),
    st.sampled_from(["r0", "r1", "r2", "stranger"]),
    st.sampled_from(["a", "b", "c", None, "unknown"]),
)


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(["shared_max", "shared_add", "restart"]), st.lists(STEPS, max_size=80))
def test_whatever_happens_nothing_is_completed_twice_lost_or_credited_to_who_did_not_work(
    hand_over: str, steps: list[tuple[float, str, str, str | None]]
) -> None:
    told: list[tuple[int, Happening]] = []
    world = World(parse_mission(TEAM % hand_over, "test.yaml"), 0.0, lambda it: told.append((world.trial, it)))
    for robot in world.bodies:
        world.presence(robot, True, 0.0)
    world.begin(0.0)
    now, trial, complete = 0.0, 1, set[str]()
    worked: set[tuple[int, str, str | None]] = set()
    for wait, deed, robot, task in steps:
        now += wait
        header = {"sender": robot, "incarnation": 1, "seq": 1, "at": now}
        world.advance(now)
        match deed:
            case "act":
                worked.add((world.trial, robot, task))
                world.act(Action(**header, task=task, trial=world.trial, fewest=0), now)
            case "decided":
                world.decided(decision(robot, "r0", trial=world.trial), now)
            case "gone" | "there":
                world.presence(robot, deed == "there", now)
        if world.trial != trial:
            trial, complete = world.trial, set()
        views = world.tasks()
        assert complete <= {name for name, view in views.items() if view.complete}
        complete = {name for name, view in views.items() if view.complete}
        summary = world.summary()
        assert complete == {name for name, facts in summary["tasks"].items() if facts["completed_at"] is not None}
        for name, facts in summary["tasks"].items():
            assert all((trial, by, name) in worked for by in facts["by"])
            assert bool(facts["by"]) == (name in complete)
        if world.stage is Stage.COMPLETE:
            last = max(facts["completed_at"] for facts in summary["tasks"].values())
            assert summary["makespan"] == summary["trials"][-1] == last
    completions = [(trial, it.task, it.elapsed) for trial, it in told if it.kind == "complete" and it.task]
    assert len({(trial, task) for trial, task, _ in completions}) == len(completions)
    for trial in (1, 2):
        instants = [at for which, _, at in completions if which == trial]
        assert instants == sorted(instants)
