"""What is asked about and what is shown: windows, patterns, rates, the rows of `top`, and the keys that sort them."""

from typing import Any

import pytest

from lalliance_agents.bus.faulty import LOST
from lalliance_agents.errors import UserError
from lalliance_agents.wire.keys import Keys, Kind
from lalliance_agents.wire.messages import DecisionMade, LinkReport, Motivations, encode
from mission_control.watch.board import Row, Selection, rows
from mission_control.watch.echo import lines, plain
from mission_control.watch.happened import Happened
from mission_control.watch.keyboard import names
from mission_control.watch.patterns import whole_pattern
from mission_control.watch.rates import Arrivals, Rate
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story
from mission_control.watch.window import Window, instant
from mission_control.watch_commands import why

HEADER = {"incarnation": 1, "seq": 1, "at": 5.0}


def decided(robot: str, task: str, at: float) -> Happened:
    fields = {"verb": "activate", "cause": "free", "other": None, "active_for": 0.0, "trial": 1, "factors": {}}
    made = DecisionMade(sender=robot, task=task, elapsed=at, teammates=[], **HEADER, **fields)
    return Happened(at, "activate", f"{robot} starts {task}", robot, task, made=made, trial=1)


@pytest.mark.parametrize(("text", "seconds"), [("134", 134.0), ("134.5", 134.5), ("2:14", 134.0), ("0:00.5", 0.5)])
def test_an_instant_is_seconds_or_minutes_and_seconds(text: str, seconds: float) -> None:
    assert instant(text) == seconds


@pytest.mark.parametrize("text", ["", "-1", "inf", "nan", "x", "1:2:3", "1:-2000", ":", f"{10**400}:1"])
def test_what_is_no_instant_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="is no instant; expected seconds since the trial began"):
        instant(text)


def test_an_end_before_the_beginning_is_refused() -> None:
    with pytest.raises(UserError, match=r"--to 2:10 is before --from 2:14; expected an instant after it"):
        why(begins="2:14", ends="2:10")


def test_a_window_holds_what_is_asked_about_in_its_order() -> None:
    story = Story("m")
    right, left, crate = decided("right", "a", 2.0), decided("left", "a", 5.0), decided("left", "b", 3.0)
    gone = Happened(4.0, "gone", "left is gone", "left", trial=1)
    complete = Happened(4.5, "complete", "b completed by left", "left", "b", trial=1)
    story.happened.extend([right, left, crate, gone, complete])
    assert Window().of(story) == [right, crate, gone, complete, left]
    assert Window("left").of(story) == [crate, gone, left]
    assert Window("left", "a").of(story) == [left]
    assert Window(task="a").of(story) == [right, left]
    assert Window(begins=3.0, ends=4.0).of(story) == [crate, gone]
    story.robots["left"] = story.robots["lifter"] = None  # type: ignore[assignment]
    with pytest.raises(UserError, match="mission m has no robot 'lft'; did you mean 'left'"):
        Window("lft").check(story)
    with pytest.raises(UserError, match="mission m has no robot 'zzz'; expected one of left, lifter"):
        Window("zzz").check(story)


def test_a_pattern_is_below_the_mission_and_must_match_some_key() -> None:
    assert whole_pattern("heartbeat/*", "m") == "lalliance/m/heartbeat/*"
    assert whole_pattern("/@chaos/rules", "m") == "lalliance/m/@chaos/rules"
    assert whole_pattern("lalliance/*/world/status", "m") == "lalliance/*/world/status"
    with pytest.raises(UserError, match=r"'heartbeet/\*' matches no key of mission m; did you mean 'heartbeat/\*'"):
        whole_pattern("heartbeet/*", "m")
    with pytest.raises(UserError, match="'a//b' is not a pattern of keys; expected chunks joined by single slashes"):
        whole_pattern("a//b", "m")


def test_rates_are_those_of_the_latest_arrivals() -> None:
    arrivals = Arrivals(window=3)
    assert arrivals.rate() is None
    for at in (0.0, 7.0, 7.5, 7.5):
        arrivals.add(at)
    assert arrivals.rate() == Rate(rate=4.0, shortest=0.0, longest=0.5, deviation=0.25, window=3)


def test_what_is_echoed_cannot_change_the_terminal() -> None:
    keys = Keys("m")
    said = decided("left", "a", 1.0).made
    assert said is not None
    hostile = said.model_copy(update={"cause": "\x1b[2J\u202e"})
    document = plain(Sighting(7, 1.0, keys.build(Kind.DECISION, robot="left"), encode(hostile)), keys)
    text = list(lines(document))
    assert text[:3] == ["mind/left/decision", "v: 1", "sender: left"]
    assert all(line.isprintable() for line in text)
    broken = plain(Sighting(7, 1.0, "lalliance/m/\x1b", b"\xc1"), keys)
    assert list(lines(broken)) == [
        "?",
        "unreadable: 'key: ''lalliance/m/\\x1b'' is not a key of this mission'",
        "bytes: 1",
    ]
    gone = plain(Sighting(7, 1.0, keys.build(Kind.ALIVE, robot="left"), b"", gone=True), keys)
    assert gone == {"key": "alive/left", "seen_at": 7, "present": False}


def reported(story: Story, robot: str, **fields: Any) -> None:
    counts = {"sent": 1, "received": 50, "dropped": {}, "teammates": {}, "ticks": 99, "missed": 0}
    story.hear(LinkReport(sender=robot, **HEADER, **(counts | fields)), 10.0)


def test_a_row_tells_what_a_robot_is_on_or_wants_and_how_it_hears() -> None:
    story = Story("m")
    story.hear(decided("left", "a", 4.0).made, 4.0)  # type: ignore[arg-type]
    heard = {"right": {"received": 30}, "third": {"received": 0, "lost_for": 2.0}}
    reported(story, "left", dropped={LOST: 10, "stale": 5}, teammates=heard, missed=1)
    reported(story, "right")
    sets = {"a": {"motivation": 0.0}, "b": {"motivation": 0.25}}
    story.hear(Motivations(sender="right", **HEADER, active=[], sets=sets), 11.0)
    assert rows(story, 12.0) == [
        Row("left", None, "a", 8.0, None, 1.0, 1, 2, 0.25, 1, 0.01, 2.0),
        Row("right", None, None, None, "b", 0.25, 0, 0, 0.0, 0, 0.0, 1.0),
    ]


def test_keys_sort_turn_and_scroll_and_q_ends() -> None:
    found = [Row(name, True, task, 1.0, None, 0.0, 0, 0, loss, 0, 0.0, 0.0)
             for name, task, loss in (("c", None, 0.5), ("a", "t2", 0.0), ("b", "t1", 0.1))]  # fmt: skip

    def shown(selection: Selection, room: int = 9) -> str:
        return "".join(row.robot for row in selection.of(found, room))

    selection = Selection()
    assert shown(selection) == "abc"
    pressed = [(key, selection.press(key), shown(selection)) for key in ("r", "r", "t", "l", "right", "left", "x")]
    assert pressed == [
        ("r", False, "cba"), ("r", False, "abc"), ("t", False, "bac"), ("l", False, "cba"),
        ("right", False, "abc"), ("left", False, "cba"), ("x", False, "cba"),
    ]  # fmt: skip
    assert shown(selection, room=2) == "cb"
    assert [(selection.press(key), shown(selection, room=2)) for key in ("down", "down", "up", "page down", "home")] == [
        (False, "ba"), (False, "ba"), (False, "cb"), (False, "ba"), (False, "cb"),
    ]  # fmt: skip
    assert selection.press("q")


def test_keys_that_are_no_letters_have_names() -> None:
    assert list(names(b"q\x1b[A\x1b[6~\x1bOBn\x1b[99~zz")) == ["q", "up", "page down", "down", "n"]
