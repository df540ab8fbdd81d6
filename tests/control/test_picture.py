"""What an operator is told of decisions and events, also of made-up ones."""

import pytest

from lalliance_agents.wire.messages import DecisionMade, Event, Status
from mission_control.picture import Picture, describe, printable

HEADER = {"sender": "left", "incarnation": 1, "seq": 1, "at": 5.0}


def decision(verb: str, cause: str, other: str | None = None, active_for: float = 0.0) -> DecisionMade:
    return DecisionMade(
        **HEADER,
        verb=verb,
        task="a",
        cause=cause,
        other=other,
        active_for=active_for,
        trial=1,
        factors={},
        teammates=[],
    )


@pytest.mark.parametrize(
    ("made", "line"),
    [
        (decision("activate", "free"), "left starts a: nobody is on it"),
        (decision("activate", "silence", "right"), "left starts a: right is not heard any more"),
        (decision("activate", "impatience", "right"), "left starts a: patience with right has ended"),
        (decision("yield", "contender", "right", 4.25), "left yields a: to right, after 4.2 s"),
        (decision("give_up", "no_success", None, 9.0), "left gives up a: no success after 9.0 s"),
        (decision("complete", "sensed", None, 9.0), "left is finished with a: it is complete"),
        (decision("dance", "{active:1500000000.1f}"), "left dance a: {active:1500000000.1f}"),
    ],
)
def test_each_decision_is_one_line_and_made_up_words_are_only_quoted(made: DecisionMade, line: str) -> None:
    assert describe(made) == line


def test_lines_carry_the_time_of_the_trial() -> None:
    picture = Picture()
    status = Status(
        **HEADER, mission="running", trial=1, trials=1, learning="adaptive", elapsed=30.0, tasks={}, robots={}
    )
    assert picture.take(status, now=40.0) is None
    assert picture.take(decision("activate", "free"), now=42.5) == "   32.5 s  left starts a: nobody is on it"
    event = Event(**HEADER, kind="gone", elapsed=31.0, trial=1, text="left is gone")
    assert picture.take(event, now=43.0) == "   31.0 s  left is gone"
    assert len(picture.events) == 2


def test_faults_are_told_and_kept_while_they_are_in_force_and_orders_are_not() -> None:
    picture = Picture()

    def tell(kind: str, text: str) -> str | None:
        return picture.take(Event(**HEADER, kind=kind, elapsed=31.0, trial=1, text=text), now=31.0)

    assert tell("fault", "fault: crash of left") == "   31.0 s  fault: crash of left"
    assert tell("order", "kill left: crash at 31 s") is None
    assert tell("fault", "fault: loss 30% from * to left") is not None
    assert picture.faults == ["crash of left", "loss 30% from * to left"]
    assert tell("fault", "fault is over: crash of left") == "   31.0 s  fault is over: crash of left"
    assert tell("fault", "fault is over: what never was") is not None
    assert picture.faults == ["loss 30% from * to left"]


def test_nothing_that_is_printed_changes_the_terminal() -> None:
    assert printable("\x1b[2Jü\tx\ny") == "?[2Jü\tx?y"
    assert printable("x" * 600) == "x" * 500 + " ..."
