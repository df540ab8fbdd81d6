"""The ledger: which activations are takeovers, and counters summed over the lives of robots."""

from typing import Any

import pytest

from lalliance_agents.wire.messages import DecisionMade, Drop, LinkReport
from world_server import ledger as module
from world_server.ledger import Ledger


def activation(sender: str, other: str | None, cause: str, task: str = "a", **more: Any) -> DecisionMade:
    fields = {"factors": {}, "teammates": [], "incarnation": 1, "seq": 1, "at": 100.0, "verb": "activate", "trial": 1}
    return DecisionMade(sender=sender, other=other, cause=cause, task=task, active_for=0.0, **(fields | more))


def report(sender: str, incarnation: int, *, sent: int, **more: Any) -> LinkReport:
    fields = {"received": 1, "dropped": {}, "teammates": {}, "ticks": 10, "missed": 1, "seq": 1, "at": 0.0} | more
    return LinkReport(sender=sender, incarnation=incarnation, sent=sent, **fields)


@pytest.mark.parametrize("cause", ["silence", "impatience", "released"])
def test_a_task_that_another_robot_was_on_is_taken_over(cause: str) -> None:
    ledger = Ledger(["a"])
    ledger.began("left", "a", 1.0)
    ledger.failed("left", 4.0)
    ledger.began("right", "a", 5.5)
    mates = [{"robot": "left", "lapsed_at": 99.25}]
    made = activation("right", "left", cause, teammates=mates, factors={"delay": 0.25})
    expected = {
        "task": "a", "from": "left", "to": "right", "cause": cause, "detected_at": 4.75, "taken_at": 5.5, "delay": 0.25,
        "failed_at": 4.0, "after_failure": 1.5,
    }  # fmt: skip
    assert ledger.decided(made, 5.5) == expected
    assert ledger.summary()["takeovers"] == [expected]


def test_what_is_no_takeover() -> None:
    """Nothing taken, nobody to take it from, or the one who takes it had it last itself: the loser of a collision left."""
    ledger = Ledger(["a", "b"])
    ledger.began("left", "a", 1.0)
    ledger.began("right", "a", 1.1)  # the loser of a collision, which yields at once
    for made in (
        activation("left", "right", "free"),
        activation("left", None, "silence"),
        activation("left", "stranger", "silence"),
        activation("left", "right", "silence", task="unknown"),
        activation("left", "right", "silence", task="b"),
        activation("left", "right", "silence", verb="yield"),
    ):
        assert ledger.decided(made, 2.0) is None
    ledger.began("left", "a", 3.0)
    ledger.began("left", "a", 4.0)
    assert ledger.decided(activation("left", "right", "released"), 4.0) is None
    ledger.began("right", "a", 5.0)
    ledger.began("left", "a", 6.0)
    assert ledger.decided(activation("left", "right", "silence"), 6.0) is not None


def test_a_completed_task_has_no_attempt_without_an_end() -> None:
    """Whatever reports of robots are still under way when the mission ends."""
    ledger = Ledger(["a"])
    for robot, at in (("left", 1.0), ("right", 2.0), ("third", 3.0)):
        ledger.began(robot, "a", at)
    ledger.failed("left", 4.0)
    ledger.completed("a", ("right",), 5.0)
    ledger.decided(activation("right", None, "sensed", verb="complete"), 5.1)
    assert [one["ended"] for one in ledger.summary()["tasks"]["a"]["attempts"]] == ["lost", "complete", "complete"]


def test_a_robot_that_came_back_has_not_failed_and_a_new_trial_knows_of_no_failure() -> None:
    ledger = Ledger(["a"])
    ledger.failed("left", 1.0)
    ledger.returned("left")
    ledger.began("left", "a", 2.0)
    ledger.began("right", "a", 3.0)
    takeover = ledger.decided(activation("right", "left", "impatience"), 3.0)
    assert takeover is not None
    assert "failed_at" not in takeover
    assert takeover["detected_at"] is None
    ledger.failed("left", 4.0)
    ledger.new_trial()
    assert ledger.summary()["takeovers"] == []
    assert ledger.summary()["tasks"] == {"a": {"completed_at": None, "by": [], "attempts": []}}
    ledger.began("left", "a", 0.5)
    ledger.began("right", "a", 1.0)
    takeover = ledger.decided(activation("right", "left", "impatience"), 1.0)
    assert takeover is not None
    assert "failed_at" not in takeover


@pytest.mark.parametrize("lapsed", ["soon", True, None, -1e308, 1e308, 2**63])
def test_what_a_robot_says_of_itself_cannot_put_nonsense_into_the_summary(lapsed: object) -> None:
    ledger = Ledger(["a"])
    ledger.began("left", "a", 1.0)
    ledger.began("right", "a", 2.0)
    mates = [{"robot": "left", "lapsed_at": lapsed}]
    takeover = ledger.decided(activation("right", "left", "silence", teammates=mates, factors={"delay": "\n"}), 2.0)
    assert takeover is not None
    assert takeover["delay"] is None
    assert takeover["detected_at"] is None or 0.0 <= takeover["detected_at"] <= 2.0


def test_counters_are_the_latest_of_each_life_and_the_sum_of_all_lives() -> None:
    ledger = Ledger(["a"])
    ledger.reported(report("left", 1, sent=5))
    ledger.reported(report("left", 1, sent=8, dropped={"stale": 1, "loss": 2}))
    ledger.reported(report("right", 1, sent=100, final=True))
    ledger.reported(report("left", 2, sent=1, dropped={"loss": 3}))
    ledger.new_trial()
    for _ in range(2):
        messages = {"sent": 109, "received": 3, "dropped": {"loss": 5, "stale": 1}, "drops": []}
        assert ledger.summary()["messages"] == messages
        assert ledger.summary()["control"] == {"periods": 30, "missed": 3}
    assert [ledger.has_final(robot) for robot in ("left", "right", "stranger")] == [False, True, False]
    ledger.reported(report("left", 2, sent=1, final=True))
    assert ledger.has_final("left")
    ledger.reported(report("left", 3, sent=1))
    assert not ledger.has_final("left")


def test_who_dropped_what_of_whom_is_told_of_robots_and_of_the_world() -> None:
    ledger = Ledger(["a"])
    of_right = {"sender": "right", "reason": "stale"}
    ledger.reported(report("left", 1, sent=5, drops=[Drop(**of_right, count=3)]))
    ledger.reported(report("left", 1, sent=6, drops=[Drop(**of_right, count=4)]))
    ledger.reported(report("left", 2, sent=1, drops=[Drop(**of_right, count=1)]))
    ledger.dropped_here = {("right", "cut off"): 7}
    assert ledger.summary()["messages"]["drops"] == [
        {"at": "left", "of": "right", "reason": "stale", "count": 5},
        {"at": "@world", "of": "right", "reason": "cut off", "count": 7},
    ]
    for life in range(3, 3 + 2 * module.MOST_DROPS):
        ledger.reported(report("left", life, sent=1, drops=[Drop(sender=f"made-up-{life}", reason="stale", count=1)]))
    assert len(ledger.drops()) == module.MOST_DROPS + 1


def test_what_is_kept_is_limited_however_much_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    ledger = Ledger(["a"])
    for life in range(3 * module.MOST_KEPT):
        ledger.reported(report("left", life, sent=1, dropped={f"made up {life}": 1}))
        ledger.began("left", "a", float(life))
        ledger.began("right", "a", float(life))
        ledger.decided(activation("right", "left", "silence"), float(life))
    summary = ledger.summary()
    assert summary["messages"]["sent"] == 3 * module.MOST_KEPT
    assert sum(summary["messages"]["dropped"].values()) == 3 * module.MOST_KEPT
    assert len(summary["messages"]["dropped"]) == module.MOST_REASONS + 1
    assert len(summary["tasks"]["a"]["attempts"]) == len(summary["takeovers"]) == module.MOST_KEPT
    assert summary["tasks"]["a"]["attempts"][-1] == {"robot": "right", "at": 3 * module.MOST_KEPT - 1.0, "ended": None}


def test_an_attempt_that_ended_in_a_collision_is_nothing_to_take_over() -> None:
    ledger = Ledger(["a"])
    ledger.began("left", "a", 1.0)
    ledger.began("right", "a", 1.0)
    collided = activation("right", "left", "collision").model_copy(update={"verb": "yield"})
    assert ledger.decided(collided, 1.1) is None
    ledger.began("left", "a", 9.0)
    assert ledger.decided(activation("left", "right", "silence"), 9.0) is None
    ledger.failed("left", 12.0)
    assert [attempt["ended"] for attempt in ledger.summary()["tasks"]["a"]["attempts"]] == [None, "collision", "lost"]
