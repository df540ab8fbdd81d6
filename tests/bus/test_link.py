"""Link rules: verdicts hang on five inputs alone, and are as frequent, as late and as bursty as the rules say."""

import math
import statistics
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.bus import link
from lalliance_agents.bus.link import BLOCK, LinkRules, RuledLink, Verdict, in_burst
from lalliance_agents.wire.messages import LONGEST, LinkRule

LARGEST = 2**63 - 1

NAMES = st.sampled_from(["left", "right", "r1", "r2"])
SEEDS = INCARNATIONS = SEQS = st.integers(0, LARGEST)
SHARES = st.sampled_from([0.0, 0.1, 0.5, 0.9, 1.0])


def rule(
    fault: str = "f", senders: Sequence[str] = ("*",), receivers: Sequence[str] = ("*",), **fields: Any
) -> LinkRule:
    return LinkRule(fault=fault, senders=list(senders), receivers=list(receivers), **fields)


def ruled(seed: int, *rules: LinkRule) -> RuledLink:
    found = LinkRules(seed, rules).on("left", "right")
    assert found is not None
    return found


def verdicts(seed: int, count: int, **fields: Any) -> list[Verdict]:
    one = ruled(seed, rule(**fields))
    return [one.verdict(1, seq) for seq in range(1, count + 1)]


def lost(seed: int, count: int, **fields: Any) -> set[int]:
    return {seq for seq, verdict in enumerate(verdicts(seed, count, **fields), 1) if not verdict.delays}


def share_fits(share: float, expected: float, count: int) -> bool:
    """Within five standard deviations of a binomial share."""
    return abs(share - expected) <= 5 * math.sqrt(expected * (1 - expected) / count)


@st.composite
def rules(draw: st.DrawFn) -> LinkRule:
    kind = draw(st.sampled_from(["none", "constant", "uniform", "lognormal"]))
    return rule(
        cut=draw(st.sampled_from([False, False, False, True])),
        loss=draw(SHARES),
        burst_loss=draw(SHARES),
        burst_enter=draw(st.sampled_from([0.0, 0.01, 0.5, 0.9])),
        burst_leave=draw(st.sampled_from([0.05, 0.5, 1.0])),
        delay=kind,
        delay_by=0.2,
        delay_to=0.4,
        duplicate=draw(SHARES),
        reorder=draw(SHARES),
        held=0.5,
    )


def test_the_verdicts_of_one_seed_are_these_for_ever() -> None:
    """Whoever changes the hash changes every recorded run: it has to be on purpose."""
    both = [
        rule("loss", ["left", "r?"], ["right"], loss=0.2, delay="uniform", delay_by=0.1, delay_to=0.3),
        rule("bursts", ["*"], ["right"], burst_loss=0.9, burst_enter=0.2, burst_leave=0.4),
        rule("rest", ["*"], ["right"], duplicate=0.4, reorder=0.3, held=0.5),
    ]
    made = LinkRules(7, both)
    log = []
    for sender in ("left", "third"):
        on = made.on(sender, "right")
        assert on is not None
        for seq in range(1, 11):
            delays, faults = on.verdict(3, seq)
            what = " ".join(f"{delay:.6f}" for delay in delays) or "lost"
            log.append(f"{sender} {seq}: {what} {','.join(faults)}".rstrip())
    assert log == [
        "left 1: 0.109102 0.254765 loss,rest",
        "left 2: lost loss",
        "left 3: 0.202429 0.159974 loss,rest",
        "left 4: 0.192050 0.268566 loss,rest",
        "left 5: 0.104376 loss",
        "left 6: lost loss",
        "left 7: 0.160287 loss",
        "left 8: 0.115046 loss",
        "left 9: 0.130765 loss",
        "left 10: lost loss",
        "third 1: 0.000000",
        "third 2: 0.000000 0.000000 rest",
        "third 3: 0.000000 0.000000 rest",
        "third 4: 0.000000 0.000000 rest",
        "third 5: 0.500000 0.500000 rest",
        "third 6: lost bursts",
        "third 7: lost bursts",
        "third 8: lost bursts",
        "third 9: lost bursts",
        "third 10: lost bursts",
    ]


@settings(deadline=None)
@given(
    st.lists(rules(), min_size=1, max_size=3), SEEDS, st.lists(st.tuples(INCARNATIONS, SEQS), max_size=8), st.randoms()
)
def test_a_verdict_hangs_on_seed_link_incarnation_and_number_alone(
    some: list[LinkRule], seed: int, messages: list[tuple[int, int]], shuffler: Any
) -> None:
    """In whatever order one asks, of one link or with others between, the first time or again."""
    messages = messages + [(incarnation, max(seq - 1, 0)) for incarnation, seq in messages]
    alone = {message: ruled(seed, *some).verdict(*message) for message in messages}
    mixed, again = LinkRules(seed, some), messages * 2
    shuffler.shuffle(again)
    for message in again:
        on = mixed.on("left", "right")
        assert on is not None
        assert on.verdict(*message) == alone[message]
        other = mixed.on("right", "left")
        assert other is not None
        other.verdict(*message)


def test_the_hash_is_that_of_splitmix64() -> None:
    """The generator's first three numbers from seed 0, as published with it."""
    numbers = [link._mixed(0x9E3779B97F4A7C15 * step) for step in (1, 2, 3)]
    assert numbers == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_each_input_matters() -> None:
    base = [ruled(1, rule(loss=0.5)).verdict(1, seq) for seq in range(100)]
    one_rule = LinkRules(1, [rule(loss=0.5)])
    others = [
        [ruled(2, rule(loss=0.5)).verdict(1, seq) for seq in range(100)],
        [ruled(1, rule(loss=0.5)).verdict(2, seq) for seq in range(100)],
        [ruled(1, rule(loss=0.5)).verdict(1, seq + 1) for seq in range(100)],
        *(
            [on.verdict(1, seq) for seq in range(100)]
            for on in (one_rule.on("left", "r2"), one_rule.on("r2", "right"))
            if on
        ),
    ]
    assert len(others) == 5
    for other in others:
        assert 25 < sum(a == b for a, b in zip(base, other, strict=True)) < 75


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.6, 0.97, 1.0])
def test_as_many_are_lost_as_the_rule_says(share: float) -> None:
    count = 5000
    found = lost(1, count, loss=share, delay="constant", delay_by=0.1, delay_to=0.1)
    assert share_fits(len(found) / count, share, count)


@given(SEEDS, st.floats(0, 1), st.floats(0, 1))
@settings(deadline=None, max_examples=30)
def test_what_a_milder_rule_loses_a_harsher_one_loses_too(seed: int, one: float, other: float) -> None:
    milder, harsher = sorted((one, other))
    assert lost(seed, 200, loss=milder) <= lost(seed, 200, loss=harsher)


@pytest.mark.parametrize(
    ("enter", "leave", "good", "bad"), [(0.02, 0.2, 0.0, 1.0), (0.01, 0.05, 0.1, 0.7), (0.9, 0.8, 0.0, 1.0)]
)
def test_bursts_are_as_frequent_and_as_long_as_computed(enter: float, leave: float, good: float, bad: float) -> None:
    """In the long run enter/(enter + leave) of the messages fall into bursts, whose mean length is 1/leave."""
    count = 60_000
    bursty = {"loss": good, "burst_loss": bad, "burst_enter": enter, "burst_leave": leave}
    one, known, states = rule(**bursty), link.NOTHING_KNOWN, []
    for seq in range(count):
        states.append(in_burst(one, 5, seq, known))
        known = link.Known(5, seq, states[-1])
    share, lengths = enter / (enter + leave), [len(list(run)) for state, run in groupby(states) if state]
    assert sum(states) / count == pytest.approx(share, rel=0.1)
    assert statistics.mean(lengths) == pytest.approx(1 / leave, rel=0.1)
    assert len(lost(5, 20_000, **bursty)) / 20_000 == pytest.approx(share * bad + (1 - share) * good, rel=0.15)


@settings(deadline=None, max_examples=30)
@given(
    enter=st.floats(0.001, 1),
    leave=st.floats(0, 1),
    key=st.integers(0, 2**64 - 1),
    start=st.integers(0, LARGEST // BLOCK),
)
def test_the_state_of_a_burst_chain_is_that_of_a_walk_from_the_beginning_of_its_block(
    enter: float, leave: float, key: int, start: int
) -> None:
    one, first = rule(burst_enter=enter, burst_leave=leave, burst_loss=1.0), start * BLOCK

    def draw(seq: int) -> float:
        return link._uniform(key, link._Draw.BURST, seq)

    walked = [draw(first) < enter / (enter + leave)]
    for seq in range(first + 1, first + 100):
        walked.append(draw(seq) < (1 - leave if walked[-1] else enter))
    assert [in_burst(one, key, first + step) for step in range(99, -1, -1)] == walked[::-1]
    for step in (3, 50, 98):
        assert in_burst(one, key, first + step + 1, link.Known(key, first + step, walked[step])) == walked[step + 1]


@pytest.mark.parametrize(("enter", "leave"), [(1.0, 1.0), (1e-9, 1e-9), (0.1, 0.0)])
def test_the_largest_number_is_found_as_quickly_as_a_small_one(
    enter: float, leave: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No more than a block is walked, and from one message to the next a single step."""
    draws = []
    uniform = link._uniform
    monkeypatch.setattr(link, "_uniform", lambda *given: (draws.append(given), uniform(*given))[1])
    one = ruled(1, rule(burst_enter=enter, burst_leave=leave, burst_loss=0.5))
    one.verdict(LARGEST, LARGEST - 1)
    assert len(draws) <= BLOCK + 1
    draws.clear()
    one.verdict(LARGEST, LARGEST)
    assert len(draws) == 2


@settings(deadline=None, max_examples=50)
@given(SEEDS, INCARNATIONS, SEQS, st.floats(0, 10), st.floats(0, 10))
def test_uniform_delays_lie_within_their_bounds(seed: int, incarnation: int, seq: int, one: float, more: float) -> None:
    delayed = ruled(seed, rule(delay="uniform", delay_by=one, delay_to=one + more, duplicate=1.0))
    assert all(one <= delay <= one + more for delay in delayed.verdict(incarnation, seq).delays)


def test_delays_are_spread_as_the_rule_says() -> None:
    def delays(**fields: Any) -> list[float]:
        return [verdict.delays[0] for verdict in verdicts(3, 4000, **fields)]

    assert set(delays(delay="constant", delay_by=0.25, delay_to=0.25)) == {0.25}
    uniform = delays(delay="uniform", delay_by=0.1, delay_to=0.5)
    assert statistics.mean(uniform) == pytest.approx(0.3, abs=0.01)
    assert statistics.stdev(uniform) == pytest.approx(0.4 / math.sqrt(12), rel=0.05)
    lognormal = delays(delay="lognormal", delay_by=0.2, delay_to=0.8)
    assert statistics.median(lognormal) == pytest.approx(0.2, rel=0.06)
    assert statistics.stdev(map(math.log, lognormal)) == pytest.approx(0.8, rel=0.06)


def test_a_delay_made_up_overflows_nothing() -> None:
    wild = verdicts(1, 200, delay="lognormal", delay_by=LONGEST, delay_to=LONGEST)
    assert all(0 <= delay < math.inf for verdict in wild for delay in verdict.delays)


def test_a_delay_of_nothing_is_no_effect() -> None:
    assert verdicts(1, 3, delay="constant") == [Verdict((0.0,), ())] * 3


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_as_many_come_twice_or_are_held_back_as_the_rules_say(share: float) -> None:
    count = 4000
    twice = sum(len(verdict.delays) == 2 for verdict in verdicts(1, count, duplicate=share))
    back = sum(verdict.delays == (0.5,) for verdict in verdicts(1, count, reorder=share, held=0.5))
    assert share_fits(twice / count, share, count)
    assert share_fits(back / count, share, count)


def test_the_copy_of_a_message_has_a_delay_of_its_own_and_is_held_back_with_it() -> None:
    both = {"delay": "uniform", "delay_by": 0.1, "delay_to": 0.2, "duplicate": 1.0}
    for alone, held in zip(verdicts(1, 20, **both), verdicts(1, 20, reorder=1.0, held=3.0, **both), strict=True):
        assert alone.delays[0] != alone.delays[1]
        assert held.delays == pytest.approx([delay + 3.0 for delay in alone.delays])


def test_a_cut_wins_over_all_else() -> None:
    some = [rule("late", delay="constant", delay_by=1.0, duplicate=1.0), rule("lossy", loss=0.5), rule("cut", cut=True)]
    assert {ruled(1, *some).verdict(1, seq) for seq in range(50)} == {Verdict((), ("cut",))}


def test_of_two_rules_on_one_aspect_the_first_counts_and_of_different_aspects_both() -> None:
    some = [
        rule("one", delay="constant", delay_by=1.0, delay_to=1.0),
        rule("two", delay="constant", delay_by=2.0, delay_to=2.0, duplicate=1.0),
        rule("three", duplicate=0.5, reorder=1.0, held=0.25),
    ]
    assert ruled(1, *some).verdict(1, 1) == Verdict((1.25, 1.25), ("one", "three", "two"))


@pytest.mark.parametrize(
    ("senders", "receivers", "found"),
    [
        (["*"], ["*"], {"r1-r2", "r2-r1", "r1-x", "x-r1", "r2-x", "x-r2"}),
        (["r?"], ["x"], {"r1-x", "r2-x"}),
        (["r1", "x"], ["r*"], {"r1-r2", "x-r1", "x-r2"}),
        (["r1"], ["r2"], {"r1-r2"}),
        (["R1"], ["*"], set()),
    ],
)
def test_a_rule_holds_on_the_links_that_its_globs_name_and_in_their_direction(
    senders: list[str], receivers: list[str], found: set[str]
) -> None:
    """No link leads from a robot to itself, whatever a glob says."""
    made = LinkRules(0, [rule(senders=senders, receivers=receivers, cut=True)])
    names = ["r1", "r2", "x"]
    assert {f"{one}-{two}" for one in names for two in names if made.on(one, two) is not None} == found


def test_senders_made_up_cannot_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "MOST_LINKS", 10)
    made = LinkRules(0, [rule(senders=["r*"], cut=True)])
    for number in range(100):
        assert made.on(f"r{number}", "x") is not None
    assert len(made._links) <= 10


def test_rules_and_links_say_what_they_are() -> None:
    made = LinkRules(7, [rule(loss=0.1), rule(reorder=0.5)])
    assert repr(made) == "<2 link rules, seed 7>"
    assert repr(made.on("left", "right")) == "<link from left to right: loss, reorder>"
