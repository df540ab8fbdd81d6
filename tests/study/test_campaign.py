"""The campaign itself: green, the same however it is cut, and red where something is wrong."""

import time
from dataclasses import replace
from typing import Any

import pytest

from lalliance_agents.config import Mission
from lalliance_study import campaign
from lalliance_study.campaign import Failure, Result, check_fully, examine, is_repeatable, skips_nothing, try_mission
from lalliance_study.evidence import Evidence, gather
from lalliance_study.invariants import Violation
from lalliance_study.pool import at_once
from lalliance_study.random_missions import draw_mission

FAILING = "lalliance_study.campaign.gather"


def test_a_campaign_is_green() -> None:
    result = examine(1, range(150))
    assert result.failures == []
    assert (result.missions, result.repeated, result.stepped) == (150, 3, 1)
    assert result.complete + sum(result.excused.values()) == 150
    assert result.complete > 130
    assert sum(result.fired.values()) > 100
    assert result.takeovers["silence"] > 5
    assert result.takeovers["impatience"] > 5


def test_parallel_and_serial_campaigns_are_the_same() -> None:
    serial, parallel = examine(2, range(60)), Result()
    for part in at_once(examine, [(2, range(first, first + 10)) for first in range(0, 60, 10)], 2):
        parallel.add(part)
    assert parallel == serial
    assert examine(3, range(60)).digest != serial.digest


def test_results_add_up_in_any_order() -> None:
    one, two = examine(4, range(8)), examine(4, range(8, 16))
    one.failures.append(Failure(3, (Violation("x", "y"),)))
    two.failures.append(Failure(9, (Violation("x", "y"),)))
    forwards, backwards = Result(), Result()
    for part in (one, two):
        forwards.add(part)
    for part in (two, one):
        backwards.add(part)
    assert forwards.as_plain() == backwards.as_plain()
    assert forwards.failures == backwards.failures
    assert {3, 9} <= {one.number for one in forwards.failures}


def a_mission() -> Mission:
    """One in which robots decide something."""
    return draw_mission(1, 2)[1]


def test_a_run_that_cannot_be_repeated_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence = gather(a_mission())
    assert is_repeatable(evidence) == []
    assert "differs: 'None'" not in str(is_repeatable(evidence))
    changed = replace(evidence, log=[evidence.log[0]._replace(at=0.5), *evidence.log[1:]])
    assert "a second run differs: '0.000000 " in is_repeatable(changed)[0].facts
    assert "lines instead of" in is_repeatable(replace(evidence, log=evidence.log[:-1]))[0].facts
    monkeypatch.setattr(FAILING, lambda *_, **__: evidence)
    assert is_repeatable(evidence) == [Violation("is_repeatable", "another seed gives the very same log")]


def test_a_run_that_skips_too_much_is_seen() -> None:
    evidence = gather(a_mission())
    assert skips_nothing(evidence) == []
    assert skips_nothing(replace(evidence, log=evidence.log[:-1]))[0].invariant == "skips_nothing"


def test_an_error_of_ours_is_a_failure_that_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: Mission) -> Evidence:
        raise ZeroDivisionError("once")

    monkeypatch.setattr(FAILING, fails)
    evidence, violations = try_mission(a_mission())
    assert evidence is None
    assert violations[0].invariant == "no_error"
    assert violations[0].facts.startswith("ZeroDivisionError at test_campaign.py:")
    result = examine(1, range(2))
    assert [failure.number for failure in result.failures] == [0, 1]
    assert check_fully(a_mission()) == violations


def test_a_mission_without_an_end_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def endless(_: Mission) -> Any:
        while True:
            time.sleep(0)

    monkeypatch.setattr(campaign, "TIME_LIMIT", 0.1)
    monkeypatch.setattr(FAILING, endless)
    assert try_mission(a_mission()) == (None, [Violation("ends", "no end after 0.1 s of computing")])
