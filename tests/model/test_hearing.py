"""Who was heard, and when: windows that count each first message once, presence, lapses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lalliance_agents.model.hearing import Contact, Hearing


def hearing(*, closed: bool = True, per_attempt: bool = False) -> Hearing:
    return Hearing(1.0, closed=closed, per_attempt=per_attempt)


def hear(ears: Hearing, robot: str, now: float, *, active_for: float = 0.0, fresh: bool = False) -> None:
    ears.heard_on(robot, "x", now, active_for=active_for, expected=9.0, fresh=fresh)


def contact(ears: Hearing, robot: str) -> Contact:
    return next(one for one in ears.contacts("x") if one.robot == robot)


def steps_with_news(ears: Hearing, script: list[tuple[float, str]]) -> list[float]:
    """The instants of the steps that find a first message, where `script` names a robot, or "tick"."""
    found, before = [], 0.0
    for now, what in script:
        if what == "tick":
            found += [now for one in ears.contacts("x") if ears.is_news(one, before, now)]
            ears.note_checked()
            before = now
        else:
            hear(ears, what, now)
    return found


instants = st.one_of(
    st.integers(0, 20).map(lambda step: step * 0.1),  # exactly at a tick
    st.builds(lambda step, off: step * 0.1 + off, st.integers(0, 20), st.sampled_from([-1e-9, -5e-10, 5e-10, 1e-9])),
    st.floats(0.0, 2.0),
)


@given(heard=st.lists(instants, max_size=6), late=st.booleans())
def test_each_first_message_is_news_to_exactly_one_step(heard: list[float], late: bool) -> None:
    """Also a message that comes at the instant of a tick, be it before or after it."""
    messages = [(max(at, 0.0), f"r{number}") for number, at in enumerate(heard)]
    ticks = [(step * 0.1, "tick") for step in range(23)]
    script = sorted(messages + ticks, key=lambda one: (one[0], (one[1] == "tick") is not late))
    assert len(steps_with_news(hearing(), script)) == len(messages)


@given(at=instants)
def test_consecutive_windows_count_each_instant_once(at: float) -> None:
    ears = hearing()
    hear(ears, "a", at)
    ends = [step * 0.1 for step in range(-1, 23)]
    until = [ears.heard_until(contact(ears, "a"), end) for end in ends]
    assert until == sorted(until), "once heard until an instant, heard until every later one"
    assert not until[0]
    assert until[-1]


def test_a_message_after_the_tick_of_its_instant_is_news_to_the_next_tick() -> None:
    assert steps_with_news(hearing(), [(0.1, "tick"), (0.1, "a"), (0.2, "tick"), (0.3, "tick")]) == [0.2]


def test_only_the_first_message_is_news() -> None:
    script = [(0.05, "a"), (0.1, "tick"), (0.15, "a"), (0.2, "tick"), (5.0, "a"), (5.1, "tick")]
    assert steps_with_news(hearing(), script) == [0.1]


def test_an_open_window_misses_what_comes_at_a_tick() -> None:
    assert steps_with_news(hearing(closed=False), [(0.1, "a"), (0.1, "tick"), (0.2, "tick")]) == []
    assert steps_with_news(hearing(closed=False), [(0.15, "a"), (0.2, "tick"), (0.3, "tick")]) == [0.2]


def test_a_fresh_attempt_is_news_only_where_patience_counts_per_attempt() -> None:
    for per_attempt, news in ((False, False), (True, True)):
        ears = hearing(per_attempt=per_attempt)
        hear(ears, "a", 0.0)
        ears.note_checked()
        hear(ears, "a", 8.0, fresh=True)
        assert ears.is_news(contact(ears, "a"), 7.9, 8.0) is news
        assert ears.heard_until(contact(ears, "a"), 5.0) is not news


@pytest.mark.parametrize(("now", "present"), [(3.0, True), (3.9, True), (4.0, False), (4.5, False)])
def test_a_robot_is_present_for_less_than_tau_after_its_last_message(now: float, present: bool) -> None:
    ears = hearing()
    ears.heard("a", 3.0)
    assert ears.is_present("a", now) is present
    assert ears.robots_present(now) == (["a"] if present else [])


def test_each_silence_is_counted_once() -> None:
    ears = hearing()
    ears.heard("a", 3.0)
    for now in (3.5, 4.0, 4.5):
        ears.note_lapses(now)
    assert (ears.presences["a"].lapses, ears.presences["a"].lapsed_at) == (1, 4.0)
    ears.heard("a", 5.0)
    for now in (5.1, 6.2):
        ears.note_lapses(now)
    assert (ears.presences["a"].lapses, ears.presences["a"].lapsed_at) == (2, 6.2)


def test_a_robot_never_heard_is_absent() -> None:
    assert not hearing().is_present("a", 0.0)
    assert hearing().silences(1.0) == {}


def test_robots_are_listed_in_the_order_in_which_they_were_first_heard() -> None:
    ears = hearing()
    for robot in ("c", "a", "b", "c", "a"):
        ears.heard(robot, 0.0)
    assert ears.robots_present(0.5) == ["c", "a", "b"]
    assert ears.silences(0.5) == {"c": 0.5, "a": 0.5, "b": 0.5}


def test_an_idle_robot_is_present_and_on_no_task() -> None:
    ears = hearing()
    hear(ears, "a", 0.0)
    ears.heard("a", 2.0)
    assert ears.is_present("a", 2.5)
    assert not ears.anybody_on("x", 2.5)
    assert not ears.anybody_on("y", 2.5)


def test_a_lapse_is_noted_at_the_step_that_notices_it_and_ends_with_the_next_message() -> None:
    ears = hearing()
    hear(ears, "a", 0.05)
    log = []
    for step in range(9, 14):
        ears.note_lapses(step * 0.1)
        log.append(contact(ears, "a").lapsed_at)
    assert log == [None, None, pytest.approx(1.1), pytest.approx(1.1), pytest.approx(1.1)]
    hear(ears, "a", 1.35)
    assert contact(ears, "a").lapsed_at is None


def test_the_start_is_what_the_teammate_says_and_moves_only_with_a_fresh_attempt() -> None:
    ears = hearing()
    hear(ears, "a", 5.0, active_for=2.0)
    hear(ears, "a", 6.0, active_for=2.5)
    assert contact(ears, "a").started == 3.0  # 5 - 2
    hear(ears, "a", 9.0, active_for=0.5, fresh=True)
    assert contact(ears, "a").started == 8.5  # 9 - 0.5


def test_has_heard_asks_for_the_whole_roster_in_this_trial() -> None:
    ears = hearing()
    assert ears.has_heard(frozenset())
    ears.heard("a", 0.0)
    assert not ears.has_heard(frozenset({"a", "b"}))
    hear(ears, "b", 9.0)
    assert ears.has_heard(frozenset({"a", "b"}))
    ears.forget()
    assert not ears.has_heard(frozenset({"a"}))
    assert list(ears.contacts("x")) == []
