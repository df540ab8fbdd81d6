"""Accounts that cannot be true, each made from a true one, and the sentence that says so."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import pytest

from lalliance_agents.mission_file import parse_mission
from lalliance_study.simulator import Simulator
from lalliance_testing.judgement import broken, unfired

MISSION = parse_mission(
    """
name: judged
tasks: {a: {}, b: {after: [a]}, c: {arrives: 2}}
robots:
  left: {tasks: {a: 5, b: 3}}
  right: {tasks: {a: 9, b: 5, c: 3}}
  extra: {tasks: {c: 1}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
faults: [{at: 3, robot: left, kind: crash}, {at: 1, until: 2, robot: extra, kind: stuck}]
""",
    "judged.yaml",
)
TRUE = Simulator(MISSION).run()


def test_a_true_account_is_found_true() -> None:
    assert list(broken(MISSION, TRUE)) == []


def last_takeover(summary: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = summary["takeovers"][-1]
    return found


FALSE: dict[str, Callable[[dict[str, Any]], Any]] = {
    "the mission is not complete with 3 of 3 tasks": lambda it: it.update(complete=False),
    "the makespan is 99.000 s, but the last task was complete at": lambda it: it.update(makespan=99.0),
    "extra was on a, which it cannot do": lambda it: it["tasks"]["a"].update(by=["extra"]),
    "a was completed by nobody": lambda it: it["tasks"]["a"].update(by=[]),
    "b was completed at 1.000 s, before a": lambda it: it["tasks"]["b"].update(completed_at=1.0),
    "c was completed at 1.000 s, before it arrived": lambda it: it["tasks"]["c"].update(completed_at=1.0),
    "it is not between two robots that can do it": lambda it: last_takeover(it).update({"from": "right"}),
    "the former had not begun it": lambda it: last_takeover(it).update(taken_at=0.1),
    "nobody had noticed the silence": lambda it: last_takeover(it).update(detected_at=None),
    "the silence was noticed later, at 50.000 s": lambda it: last_takeover(it).update(detected_at=50.0),
    "fault 1-crash fired at 1.000 s, before it began at 3.000 s": lambda it: it["faults"][0].update(fired_at=1.0),
    "a counter is negative": lambda it: it["messages"].update(sent=-1),
}


@pytest.mark.parametrize("sentence", FALSE)
def test_an_account_that_cannot_be_true_is_found_out(sentence: str) -> None:
    false = deepcopy(TRUE)
    FALSE[sentence](false)
    assert any(sentence in found for found in broken(MISSION, false)), list(broken(MISSION, false))


def test_a_fault_that_never_fired_is_told_unless_it_is_excused() -> None:
    [told] = unfired(TRUE["faults"], [])
    assert told.startswith("fault 2-stuck (stuck of extra) never fired: it was in force from 1.0 s until 2.0 s")
    assert unfired(TRUE["faults"], ["2-stuck"]) == unfired(TRUE["faults"], ["stuck of extra"]) == []
