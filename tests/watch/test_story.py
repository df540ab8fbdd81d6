"""What an onlooker makes of a mission from what comes over the bus, also of made-up messages."""

from typing import Any

import pytest

from lalliance_agents.wire.keys import LAUNCHER, WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, DecisionMade, encode
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import HEAVIEST_HAPPENED, MOST_AT_ONCE, MOST_NAMES, Story
from mission_control.watch.why import Answer, unworkable
from mission_control.watch.window import Window
from mission_control.watch.words import describe, printable

KEYS = Keys("m")
RUNNING = {"mission": "running", "trials": 2, "learning": "adaptive"}
HEADER = {"sender": "left", "incarnation": 1, "seq": 1, "at": 5.0}


class Bus:
    """Sightings as they come from a bus, numbered."""

    def __init__(self) -> None:
        self.story = Story("m")
        self.seq = 0

    def say(self, what: Kind, now: float, /, *, by: str = WORLD, **fields: Any) -> str | None:
        """Have the story take a message; the line that it adds."""
        self.seq += 1
        message = BODY_OF[what](sender=by, incarnation=1, seq=self.seq, at=now, **fields)
        key = KEYS.build(what, robot=by, task=str(fields.get("task")))
        happened = self.story.take(Sighting(0, now, key, encode(message)))
        return None if happened is None else str(happened)

    def status(self, now: float, elapsed: float, trial: int = 1, **robots: dict[str, Any]) -> None:
        tasks = {"a": {"complete": False, "applicable": True, "progress": 0.25}}
        self.say(Kind.STATUS, now, trial=trial, elapsed=elapsed, tasks=tasks, robots=robots, **RUNNING)

    def event(self, kind: str, text: str, elapsed: float, trial: int = 1, **fields: Any) -> str | None:
        return self.say(Kind.EVENT, elapsed, kind=kind, text=text, elapsed=elapsed, trial=trial, **fields)

    def decide(self, verb: str, cause: str, now: float, *, by: str = "left", **fields: Any) -> str | None:
        given = {"task": "a", "other": None, "active_for": 0.0, "trial": 1, "factors": {}, "teammates": []}
        return self.say(Kind.DECISION, now, by=by, **(given | fields), verb=verb, cause=cause)

    def bars(self) -> list[tuple[Any, ...]]:
        return [
            (one.robot, one.task, one.trial, one.since, one.began, one.until, one.ended) for one in self.story.attempts
        ]


def made(verb: str, cause: str, other: str | None = None, active_for: float = 0.0) -> DecisionMade:
    given = {"task": "a", "trial": 1, "factors": {}, "teammates": []}
    return DecisionMade(**HEADER, **given, verb=verb, cause=cause, other=other, active_for=active_for)


@pytest.mark.parametrize(
    ("decision", "line"),
    [
        (made("activate", "free"), "left starts a: nobody is on it"),
        (made("activate", "silence", "right"), "left starts a: right is not heard any more"),
        (made("activate", "impatience", "right"), "left starts a: patience with right has ended"),
        (made("yield", "contender", "right", 4.25), "left yields a: to right, after 4.2 s"),
        (made("give_up", "no_success", None, 9.0), "left gives up a: no success after 9.0 s"),
        (made("complete", "sensed", None, 9.0), "left is finished with a: it is complete"),
        (made("dance", "{active:1500000000.1f}"), "left dance a: {active:1500000000.1f}"),
    ],
)
def test_each_decision_is_one_line_and_made_up_words_are_only_quoted(decision: DecisionMade, line: str) -> None:
    assert describe(decision) == line


def test_nothing_that_is_printed_changes_the_terminal() -> None:
    assert printable("\x1b[2Jü\tx\ny") == "?[2Jü\tx?y"
    assert printable("x" * 600) == "x" * 500 + " ..."


def test_lines_carry_the_time_of_the_trial_which_a_robot_knows_best_itself() -> None:
    bus = Bus()
    bus.status(40.0, elapsed=30.0)
    assert bus.decide("activate", "free", 42.5) == "   32.5 s  left starts a: nobody is on it"
    assert bus.decide("yield", "contender", 44.0, elapsed=33.9, other="right") is not None
    assert bus.event("gone", "left is gone", 31.0, robot="left") == "   31.0 s  left is gone"
    assert [one.at for one in bus.story.happened] == [32.5, 33.9, 31.0]
    assert bus.story.elapsed(45.0) == 35.0


def test_faults_are_kept_while_they_are_in_force_and_orders_are_not_told() -> None:
    bus = Bus()
    assert bus.event("fault", "fault: crash of left", 1.0, details={"name": "crash-1", "begins": True}) is not None
    assert bus.event("order", "kill left: crash at 31 s", 1.0) is None
    bus.event("fault", "fault: loss 30% from * to left", 2.0, details={"name": "loss-1", "begins": True})
    assert bus.story.faults == {"crash-1": "crash of left", "loss-1": "loss 30% from * to left"}
    bus.event("fault", "fault is over: crash of left", 3.0, details={"name": "crash-1", "begins": False})
    bus.event("fault", "fault is over: what never was", 3.0, details={"name": "none", "begins": False})
    assert bus.story.faults == {"loss-1": "loss 30% from * to left"}


def test_attempts_begin_and_end_with_decisions_and_with_what_befalls_the_robot() -> None:
    bus = Bus()
    bus.event("trial", "trial 1 begins", 0.0, details={"begins": True})
    bus.status(0.0, 0.0, left={"present": True}, right={"present": True})
    bus.decide("activate", "free", 1.0, elapsed=1.0)
    bus.event("gone", "left is gone", 4.0, robot="left")
    bus.decide("activate", "silence", 5.0, elapsed=5.0, by="right", other="left")
    bus.event("takeover", "right takes a from left", 5.0, task="a", robot="right", details={"from": "left"})
    bus.decide("complete", "sensed", 9.0, elapsed=9.0, by="right")
    bus.event("complete", "a completed by right", 9.0, task="a", robot="right")
    assert bus.bars() == [
        ("left", "a", 1, 1.0, "free", 4.0, "lost"),
        ("right", "a", 1, 5.0, "silence", 9.0, "sensed"),
    ]
    assert [(one.robot, one.other) for one in bus.story.takeovers()] == [("right", "left")]
    assert (bus.story.tasks["a"].complete, bus.story.tasks["a"].completed_at) == (True, 9.0)
    assert [robot.present for robot in bus.story.robots.values()] == [False, True]


def test_who_missed_a_decision_still_learns_who_is_on_what_from_what_robots_announce() -> None:
    bus = Bus()
    bus.status(10.0, 10.0)
    bus.say(Kind.ACTIVITY, 12.0, by="left", task="a", trial=1, active_for=3.0, expected=8.0)
    assert bus.story.robots["left"].task == "a"
    bus.say(Kind.HEARTBEAT, 14.0, by="left", trial=1)
    assert bus.story.robots["left"].task is None
    bus.decide("yield", "contender", 14.1, elapsed=13.5, other="right")
    bus.say(Kind.ACTIVITY, 15.0, by="left", task="b", trial=1, active_for=0.0, expected=8.0)
    bus.status(20.0, 1.0, trial=2)
    assert bus.bars() == [
        ("left", "a", 1, 9.0, None, 13.5, "contender"),
        ("left", "b", 1, 15.0, None, 15.0, "new_trial"),
    ]


def test_what_comes_late_has_happened_once_and_changes_nothing_that_holds_now() -> None:
    bus = Bus()
    bus.status(10.0, 10.0)
    bus.seq = 20
    bus.decide("activate", "free", 8.0, elapsed=8.0, task="b")
    bus.event("gone", "right is gone", 9.0, robot="right")
    for _ in range(2):
        bus.seq = 10
        bus.decide("yield", "contender", 11.0, elapsed=7.0, other="right")
        bus.event("present", "right is there", 6.0, robot="right")
    bus.seq = 10
    bus.decide("activate", "free", 11.0, task="c")
    assert [(one.at, one.text) for one in bus.story.happened] == [
        (8.0, "left starts b: nobody is on it"),
        (9.0, "right is gone"),
        (7.0, "left yields a: to right, after 0.0 s"),
        (6.0, "right is there"),
    ]
    assert bus.story.messages["decision", "late"] == bus.story.messages["event", "late"] == 1
    assert (bus.story.messages["decision", "stale"], bus.story.messages["event", "stale"]) == (2, 1)
    assert bus.bars() == [("left", "b", 1, 8.0, "free", None, None)]


def test_who_comes_late_asks_the_world_how_late_it_is_before_it_says_how_long_a_robot_is_on_its_task() -> None:
    bus = Bus()
    bus.decide("activate", "free", 1.0, elapsed=122.0)
    bus.event("gone", "left does not answer", 131.0, robot="left")
    bus.say(Kind.ACTIVITY, 1.0, by="left", task="a", trial=1, active_for=20.0, expected=30.0)
    bus.status(1.1, 142.0)
    bus.say(Kind.ACTIVITY, 1.2, by="left", task="a", trial=1, active_for=20.1, expected=30.0)
    assert [round(one.since, 1) for one in bus.story.attempts] == [122.0, 122.0]


def test_decisions_of_the_dead_do_not_make_them_speak() -> None:
    bus = Bus()
    bus.decide("activate", "free", 1.0, elapsed=30.0)
    assert bus.story.robots["left"].heard_at is None
    bus.say(Kind.HEARTBEAT, 2.0, by="left", trial=1)
    assert bus.story.robots["left"].heard_at == 2.0


def test_hostile_messages_are_counted_and_change_nothing() -> None:
    bus = Bus()
    bus.status(10.0, 10.0)
    bus.decide("fault", "boom", 11.0, trial=2**60)
    assert (bus.story.trial, bus.story.faults, bus.story.takeovers()) == (1, {}, [])
    for key, payload in [
        (KEYS.build(Kind.STATUS), b"\xc1"),
        ("lalliance/other/world/status", b""),
        (KEYS.build(Kind.HELLO, robot="left"), encode(made("activate", "free"))),
        (KEYS.build(Kind.DECISION, robot="right"), encode(made("activate", "free"))),
        (KEYS.build(Kind.DECISION, robot="left"), encode(made("activate", "free"))),
    ]:
        assert bus.story.take(Sighting(0, 12.0, key, payload)) is None
    assert bus.story.messages == {
        ("status", "read"): 1,
        ("decision", "read"): 1,
        ("status", "msgpack"): 1,
        ("unknown", "key"): 1,
        ("hello", "content"): 1,
        ("decision", "sender"): 1,
        ("decision", "stale"): 1,
    }
    assert LAUNCHER not in bus.story.robots
    assert WORLD not in bus.story.robots


def test_without_a_world_robots_say_which_trial_it_is_and_presence_tells_who_went() -> None:
    bus = Bus()
    alive = KEYS.build(Kind.ALIVE, robot="left")
    assert bus.story.take(Sighting(0, 1.0, alive, b"")) is None
    bus.say(Kind.ACTIVITY, 2.0, by="left", task="a", trial=1, active_for=0.0, expected=8.0)
    gone = bus.story.take(Sighting(0, 4.0, alive, b"", gone=True))
    assert str(gone) == "    4.0 s  left is gone"
    assert bus.bars() == [("left", "a", 1, 2.0, None, 4.0, "lost")]


def test_whoever_makes_things_up_gets_little_room() -> None:
    bus = Bus()
    bus.status(0.0, 0.0)
    for number in range(MOST_NAMES + 50):
        bus.event("fault", "fault: made up", 1.0, details={"name": f"{number}-{'x' * 100}", "begins": True})
        bus.say(Kind.ACTIVITY, 2.0, by="ghost", task=f"task-{number}", trial=1, active_for=0.0, expected=1.0)
    assert len(bus.story.faults) == MOST_NAMES
    assert max(map(len, bus.story.faults)) <= 64
    assert len(bus.story.robots["ghost"].attempts) == MOST_AT_ONCE
    bus.say(Kind.HELLO, 3.0, by="ghost", tasks=[f"task-{number}" for number in range(MOST_NAMES + 50)])
    assert len(bus.story.robots["ghost"].tasks) == MOST_NAMES
    for number in range(600):
        bus.decide("activate", "free", 4.0, factors={"boast": "x" * 150_000}, elapsed=float(number))
    assert 400 < len(bus.story.happened) <= HEAVIEST_HAPPENED // 150_000
    assert bus.story.happened[-1].at == 599.0


def test_a_robot_that_is_far_ahead_of_the_world_is_not_believed() -> None:
    bus = Bus()
    bus.status(10.0, elapsed=5.0)
    bus.decide("activate", "free", 11.0, elapsed=1e12)
    assert bus.story.happened[-1].at == 6.0
    bus.decide("activate", "free", 12.0, elapsed=300.0)
    assert bus.story.happened[-1].at == 300.0


def test_made_up_robots_make_room_for_those_of_the_world() -> None:
    bus = Bus()
    for number in range(MOST_NAMES):
        bus.story.take(Sighting(0, 0.0, KEYS.build(Kind.ALIVE, robot=f"ghost-{number}"), b""))
    bus.say(Kind.HEARTBEAT, 1.0, by="left", trial=0)
    assert "left" not in bus.story.robots
    bus.status(2.0, elapsed=1.0, left={"present": True}, right={"present": True})
    assert [bus.story.robots[name].present for name in ("left", "right")] == [True, True]
    assert len(bus.story.robots) == MOST_NAMES
    bus.say(Kind.HEARTBEAT, 3.0, by="one-more-ghost", trial=0)
    assert "one-more-ghost" not in bus.story.robots


@pytest.mark.parametrize(
    ("task", "said"),
    [
        ({"complete": True, "applicable": False}, "is complete"),
        ({"complete": False, "applicable": False}, "cannot be worked on just now"),
        ({"complete": False, "applicable": True}, "is complete or cannot be worked on just now"),
    ],
)
def test_the_world_knows_why_a_task_does_not_apply(task: dict[str, bool], said: str) -> None:
    bus = Bus()
    bus.status(10.0, 10.0)
    bus.say(Kind.STATUS, 11.0, trial=1, elapsed=11.0, tasks={"a": task}, robots={}, **RUNNING)
    assert unworkable(bus.story, "a") == said


def test_who_did_what_the_robot_did_not_decide_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    bus = Bus()
    bus.decide("activate", "free", 1.0, elapsed=1.0)
    Answer(Window("right", "a"), as_json=False).past(bus.story, None, goes_on=False)
    assert capsys.readouterr().out == "right has decided nothing about a; left did\n"
