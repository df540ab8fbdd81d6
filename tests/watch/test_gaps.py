"""What an onlooker takes for a gap, and what it knows already of what it is told again."""

from typing import Any

from lalliance_agents.bus.base import LEASE, Sample
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, encode
from mission_control.watch.gaps import DESERTED, DOWN, Gap, Gaps, Moment
from mission_control.watch.known import MOST_PAST, Known

KEYS = Keys("m")
EVENT = KEYS.build(Kind.EVENT)
DECISION = KEYS.build(Kind.DECISION, robot="left")
RULES = KEYS.build(Kind.CHAOS_RULES)


def at(real: float) -> Moment:
    return Moment(real, round(real * 1e9), real * 2)


def test_a_gap_begins_with_the_last_that_was_heard_unless_that_was_long_ago() -> None:
    gaps = Gaps()
    assert gaps.comes_back(at(0.0)) is None
    gaps.hears(at(1.0))
    gaps.goes_down(at(3.0))
    gaps.goes_down(at(3.5))
    assert gaps.lost == at(1.0)
    assert gaps.comes_back(at(5.0)) == Gap(at(1.0), at(5.0), DOWN)
    gaps.goes_down(at(9.0))
    assert gaps.comes_back(at(9.5)) == Gap(at(9.0), at(9.5), DOWN)


def test_when_all_are_away_and_silent_for_a_lease_there_was_a_gap_but_not_when_somebody_was_heard() -> None:
    gaps = Gaps()
    assert gaps.meets("left", True, at(0.0)) is None
    assert gaps.meets("right", True, at(0.0)) is None
    gaps.hears(at(1.0))
    gaps.meets("left", False, at(3.0))
    assert gaps.meets("left", True, at(9.0)) is None  # right was there all the time
    gaps.meets("left", False, at(10.0))
    gaps.meets("right", False, at(10.0))
    assert gaps.hears(at(10.5)) is None  # the world goes on: the robots have ended
    assert gaps.meets("left", True, at(20.0)) is None
    gaps.meets("left", False, at(21.0))
    assert gaps.meets("left", True, at(20.0 + LEASE)) == Gap(at(20.0), at(20.0 + LEASE), DESERTED)
    gaps.meets("left", False, at(30.0))
    gaps.goes_down(at(30.0))
    assert gaps.comes_back(at(40.0)) == Gap(at(30.0), at(40.0), DOWN)
    assert gaps.meets("left", True, at(43.0)) is None  # that was one gap, not two


def test_a_world_is_silent_for_unusually_long_by_what_is_usual_for_it() -> None:
    for usual, longest in ((0.25, LEASE), (3.0, 12.0)):
        gaps, now = Gaps(), 0.0
        for silence in (usual, usual, usual, longest):
            now += silence
            assert not gaps.hears_world(at(now))
        for silence, told in ((longest * 2, True), (usual, False)):
            now += silence
            assert gaps.hears_world(at(now)) is told


def test_a_gap_says_what_became_of_it() -> None:
    gap = Gap(at(1.0), at(3.5), DOWN)
    assert str(gap) == "the bus was not reached for 2.5 s; what happened then is not known"
    told = "the bus was not reached for 2.5 s; 1 event or decision of then was asked for afterwards"
    assert str(gap._replace(answered=True, recovered=1)) == told
    assert str(gap._replace(answered=True, recovered=2)).endswith(
        "; 2 events and decisions of then were asked for afterwards"
    )
    assert str(gap._replace(answered=True)).endswith("; nothing had happened that the world remembers")


def event(seq: int, text: str, incarnation: int = 1) -> Sample:
    header = {"sender": WORLD, "incarnation": incarnation, "seq": seq, "at": 0.5}
    return Sample(EVENT, encode(BODY_OF[Kind.EVENT](**header, kind="present", elapsed=0.0, trial=0, text=text)))


def decision(seq: int, **other: Any) -> Sample:
    fields = {"task": "a", "verb": "activate", "cause": "free", "other": None, "active_for": 0.0, "trial": 1}
    header = {"sender": "left", "incarnation": 1, "seq": seq, "at": 1.0}
    return Sample(DECISION, encode(BODY_OF[Kind.DECISION](**header, **fields, factors={}, teammates=[], **other)))


def test_what_is_known_is_no_news_also_from_a_world_that_counts_anew() -> None:
    known = Known(KEYS)
    here, gone = event(1, "left is there"), event(2, "left is gone")
    for sample in (here, gone, decision(7), Sample(RULES, b"old")):
        known.note(sample)
    # While no trial runs, all is at one instant: that it is there was said once, and now it is the second time.
    anew = [
        event(number, text, 2) for number, text in ((1, "left is there"), (2, "left is gone"), (3, "left is there"))
    ]
    answers = [*anew, decision(7), decision(6), Sample(RULES, b"old"), Sample(EVENT, b"\xc1")]
    assert known.news(answers) == [anew[2], decision(6), Sample(EVENT, b"\xc1")]
    assert known.news([*answers, Sample(RULES, b"new")]) == [Sample(RULES, b"new")]


def test_what_is_known_is_limited() -> None:
    known = Known(KEYS)
    for number in range(MOST_PAST + 1):
        known.note(Sample(EVENT, b"%d" % number))
    assert known.news([Sample(EVENT, b"0"), Sample(EVENT, b"%d" % MOST_PAST)]) == [Sample(EVENT, b"0")]
