"""A mission as it was at any instant, and what of it is new to a viewer."""

import itertools
from typing import Any

import pytest
from support.telling import Telling

from lalliance_agents.wire.keys import Kind
from mission_control.dashboard.series import FEWEST, Series
from mission_control.dashboard.view import View
from mission_control.watch.gaps import Gap, Moment


def drawn(updates: list[dict[str, Any]]) -> dict[str, Any]:
    """What a page has after these updates, put together as `page/mission.js` does it."""
    scene: dict[str, dict[str, Any]] = {"robots": {}, "tasks": {}, "links": {}, "figures": {}}
    things: dict[str, dict[int, Any]] = {"bars": {}, "marks": {}, "faults": {}, "told": {}}
    for update in updates:
        for part, changed in update["scene"].items():
            scene[part] |= changed
        for part, kept in things.items():
            kept |= {one["id"]: one for one in update.get(part, [])}
    # A new viewer gets them in the order in which they changed, which nothing depends on.
    return {"scene": scene, **{part: dict(sorted(kept.items())) for part, kept in things.items()}}


def test_the_timeline_shows_who_took_what_over_from_whom() -> None:
    telling = Telling()
    telling.takeover()
    update = View(telling.chronicle).update()
    bars = [(bar["robot"], bar["task"], bar["from"], bar["to"], bar["end"], bar["taken"]) for bar in update["bars"]]
    assert sorted(bars) == [("left", "a", 1.0, 4.1, "lost", False), ("right", "a", 5.2, None, "", True)]
    marks = [(mark["kind"], mark["robot"], mark["other"], mark["at"]) for mark in update["marks"]]
    assert marks == [("gone", "left", None, 4.1), ("takeover", "right", "left", 5.2)]
    assert update["marks"][1]["why"].startswith("right took a: left not heard any more")
    [fault] = update["faults"]
    assert (fault["name"], fault["text"], fault["from"], fault["to"]) == ("1-crash", "crash of left", 4.0, None)
    assert "right takes a from left (silence)" in [one["text"] for one in update["told"]]


def test_a_time_in_which_nothing_could_be_heard_is_a_line_where_it_began() -> None:
    telling = Telling()
    telling.takeover()
    view = View(telling.chronicle)
    view.update()
    telling.chronicle.miss(Gap(Moment(3.0, 3, 3.0), Moment(5.5, 5, 5.5), "nobody was there\x1b"))
    [line] = view.update()["told"]
    told = "nobody was there? for 2.5 s; what happened then is not known"
    assert (line["from"], line["elapsed"], line["kind"], line["text"]) == (3.0, 3.0, "gap", told)


def test_the_state_is_found_again_as_it_was() -> None:
    telling = Telling()
    telling.takeover()
    view = View(telling.chronicle)
    [early, later] = [view.past(at, "")["scene"] for at in (3.0, 6.0)]
    assert (early["tasks"]["a"]["progress"], later["tasks"]["a"]["progress"]) == (0.25, 0.75)
    assert (early["robots"]["left"]["task"], later["robots"]["left"]["task"]) == ("a", None)
    assert (early["robots"]["right"]["task"], later["robots"]["right"]["task"]) == (None, "a")


def test_who_gets_only_what_is_new_has_the_same_in_the_end_as_who_comes_late() -> None:
    telling = Telling()
    view = View(telling.chronicle)
    updates = [view.update()]
    telling.takeover()
    updates.append(view.update())
    telling.link(6.5, by="right", left={"received": 7, "silence": 2.5, "lost_for": 1.4})
    telling.event("fault_over", "", 7.0)
    over = {"robot": "left", "details": {"name": "1-crash", "begins": False}}
    telling.event("fault", "fault is over: crash of left", 7.0, **over)
    telling.event("complete", "a completed by right", 8.0, robot="right", task="a")
    telling.decide("complete", "sensed", 8.0, by="right", task="a")
    telling.status(8.1, a=1.0)
    updates.append(view.update())
    assert drawn(updates) == drawn([View(telling.chronicle).update()])
    assert drawn(updates)["scene"]["tasks"]["a"] == {
        "progress": 1.0, "applicable": True, "complete": True, "at": 8.0, "by": "right"
    }  # fmt: skip
    assert drawn(updates)["scene"]["links"]["right"]["left"] == (7, None, 2.5, True)
    assert [fault["to"] for fault in drawn(updates)["faults"].values()] == [7.0]
    assert "bars" not in view.update()


def test_trials_follow_one_another_on_one_line_of_time() -> None:
    telling = Telling()
    telling.takeover()
    telling.event("trial_over", "trial 1 is complete", 9.0)
    telling.status(9.0)
    telling.status(10.2, trial=2, elapsed=0.2)
    telling.say(Kind.ACTIVITY, 11.0, by="left", task="b", trial=2, active_for=0.0, expected=5.0)
    telling.status(11.5, trial=2, elapsed=1.5)
    update = View(telling.chronicle).update()
    assert update["trials"] == [{"trial": 1, "at": 0.0}, {"trial": 2, "at": 10.0}]
    assert update["now"] == 11.5
    [bar] = [bar for bar in update["bars"] if bar["task"] == "b"]
    assert (bar["from"], bar["since"]) == (11.0, 1.0)


def test_the_curves_of_the_chosen_robot_come_with_their_factors() -> None:
    telling = Telling()
    telling.status(0.5)
    view = View(telling.chronicle)
    view.choose("left")
    for now, value in ((1.0, 0.2), (1.2, 0.4), (3.0, 0.9)):
        telling.motivations(now, by="left", a=value)
        telling.status(now)
    curves = view.update()["curves"]
    assert curves["points"] == [(1.0, {"a": 0.2}), (1.2, {"a": 0.4}), (3.0, {"a": 0.9})]
    assert curves["factors"]["a"]["pace"] == "fast"
    past = view.past(2.0, "left")["curves"]
    assert [value for _, value in past["points"]] == [{"a": 0.2}, {"a": 0.4}]
    assert past["factors"]["a"]["motivation"] == 0.2
    assert "curves" not in view.update()


def test_what_was_lost_on_the_way_is_told_of_each_pair() -> None:
    telling = Telling()
    telling.status(0.0)
    for second in range(1, 9):
        for tenth in range(10):
            now = second + tenth / 10
            telling.say(Kind.ACTIVITY, now, by="left", task="a", trial=1, active_for=0.0, expected=5.0)
        telling.link(second + 0.95, by="right", left={"received": 7 * second, "silence": 0.1})
        telling.status(second + 0.96)
    received, lost, silence, silent = View(telling.chronicle).update()["scene"]["links"]["right"]["left"]
    assert (received, silence, silent) == (56, 0.1, False)
    assert lost is not None
    assert abs(lost - 0.3) < 0.03


def test_whoever_makes_things_up_gets_little_room_and_does_not_move_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mission_control.dashboard.chronicle.MOST_TRIALS", 20)
    telling = Telling()
    chronicle = telling.chronicle
    telling.takeover()
    for number in range(70):
        details = {"cause": f"cause-{number}", "from": "right"}
        telling.event("takeover", "made up", 6.0, robot="left", task="a", details=details)
        telling.event("complete", "made up", 6.0, robot="left", task=f"task-{number}", trial=number + 1)
    assert chronicle.takeovers == {"silence": 1, "unknown": 70}
    assert len(chronicle.trials) == 20
    telling = Telling()
    chronicle = telling.chronicle
    telling.takeover()
    made = {"verb": "activate", "task": "b", "cause": "free", "other": None, "active_for": 0.0, "factors": {}}
    telling.say(Kind.DECISION, 6.1, by="left", **made, trial=1, elapsed=1e12, teammates=[])
    telling.say(Kind.DECISION, 6.2, by="left", **made, trial=10**9, elapsed=2.0, teammates=[])
    telling.link(6.3, by="right", **{f"ghost-{number}": {"received": 7} for number in range(2000)})
    telling.status(6.5)
    assert chronicle.now < 20
    assert list(chronicle.trials) == [1, 2]
    assert View(chronicle).update()["scene"]["links"] == {"right": {}}


def test_a_series_of_bytes_has_little_room_for_large_ones() -> None:
    series: Series[bytes] = Series(100, 1000)
    for number in range(500):
        series.add(float(number), bytes(10 if number < 50 else 200))
    assert len(series) <= FEWEST
    assert series.at(499.0) == bytes(200)
    assert series.at(0.0) == bytes(10)


def test_a_series_keeps_the_whole_time_in_little_room() -> None:
    series: Series[int] = Series(100)
    for number in range(10_000):
        series.add(float(number), number)
    assert len(series) <= 100
    assert [series.at(instant) for instant in (-1.0, 0.0, 9999.0, 1e9)] == [None, 0, 9999, 9999]
    kept = [number for _, number in series.between(-1.0, 1e9)]
    assert max(later - earlier for earlier, later in itertools.pairwise(kept)) <= 1000
    for _ in range(1000):
        series.add(9999.0, 0)
    assert len(series) <= 100
