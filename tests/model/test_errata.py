"""Each of the seventeen doubtful places of the Appendix, in both readings: what the literal one costs, in one small scenario.

The robot that is looked at is called "me" where its teammates are scripted; see `test_mind` for the times at hand.
"""

from math import inf
from typing import Any

import pytest
from model.arena import Arena, ghost
from pydantic import ValidationError

from lalliance_agents.model.events import Pace, Verb
from lalliance_agents.model.monitor import Record
from lalliance_agents.model.parameters import Erratum, Learning, Parameters, Reading, Strategy

ALONE = {"me": {"x": 5.0}}
STUCK = frozenset({("me", "x")})
IDLE = {"a": ghost()}


def in_both_readings(erratum: Erratum, abilities: dict[str, dict[str, float]], **scene: Any) -> tuple[Arena, Arena]:
    """The same scene, read literally and mended."""
    strategy = scene.pop("strategy", Strategy.II)
    literal, mended = (
        Arena(abilities, Parameters(strategy=strategy, readings={erratum: reading}), **scene)
        for reading in (Reading.LITERAL, Reading.MENDED)
    )
    return literal, mended


def test_all_are_mended_by_default_but_the_patience_with_a_second_attempt() -> None:
    literal = [erratum for erratum in Erratum if Parameters().is_literal(erratum)]
    assert literal == [Erratum.SECOND_PATIENCE]
    assert len(Erratum) == 17


def test_1_learned_influence_on_the_active_set() -> None:
    """A task that a teammate does better is taken from boredom; taking it ends the boredom, and so the task."""
    literal, mended = in_both_readings(Erratum.INFLUENCE_ON_ACTIVE, ALONE, known={"x": {"me": 5, "a": 3}}, ghosts=IDLE)
    assert literal.go(8) == [
        "2.1 me activate x free",
        "2.2 me drop x not_best",
        "4.3 me activate x free",
        "4.4 me drop x not_best",
        "6.5 me activate x free",
        "6.6 me drop x not_best",
    ]
    assert mended.go(8) == ["2.1 me activate x free", "7.1 me complete x sensed"]


def test_2_impatience_reset_of_the_active_set() -> None:
    """The first message of a challenger throws the performer out long before psi."""
    literal, mended = in_both_readings(
        Erratum.RESET_ON_ACTIVE, ALONE, known={"x": {"me": 5, "a": 8}}, ghosts={"a": ghost(("x", 3.0, inf))}
    )
    assert literal.go(7) == ["1.0 me activate x free", "3.0 me drop x reset a"]
    assert mended.go(7) == ["1.0 me activate x free", "6.0 me complete x sensed"]


def test_3_the_robot_itself_among_those_present() -> None:
    """Without itself in the minimum the best robot is never of category 1, and waits until it is bored."""
    literal, mended = in_both_readings(Erratum.SELF_PRESENCE, ALONE, known={"x": {"me": 5, "a": 8}}, ghosts=IDLE)
    assert literal.go(2) == ["1.3 me activate x free"]
    assert mended.go(2) == ["1.0 me activate x free"]
    assert [arena.log[0][2].factors.category for arena in (literal, mended)] == [2, 1]


def test_4_heartbeats_of_idle_robots() -> None:
    """Nobody is heard at the start, so everybody thinks it is the best: the slowest robot takes the task."""
    literal, mended = in_both_readings(Erratum.IDLE_HEARTBEAT, {"a": {"x": 5.0}, "b": {"x": 8.0}}, given=True)
    assert literal.go(3) == ["0.2 b activate x free"]
    assert mended.go(3) == ["1.1 a activate x free"]


def test_5_several_sets_at_once() -> None:
    """Equal sets activate together and suppress one another for ever."""
    literal, mended = in_both_readings(Erratum.ONE_ACTIVE, {"me": {"x": 5.0, "y": 5.0}}, given=True)
    assert literal.go(3) == [
        "1.3 me activate x free",
        "1.3 me activate y free",
        "1.4 me drop x suppressed",
        "1.4 me drop y suppressed",
        "2.7 me activate x free",
        "2.7 me activate y free",
        "2.8 me drop x suppressed",
        "2.8 me drop y suppressed",
    ]
    assert mended.go(3) == ["1.3 me activate x free"]


def test_6_learning_impatience_since_ever() -> None:
    """A teammate that was once on the task keeps it from all for as long as it is there, though it does something else."""
    literal, mended = in_both_readings(
        Erratum.LEARNING_WINDOW, ALONE, ghosts={"a": ghost(("x", 0.1, 3.0))}, learning=Learning.ACTIVE
    )
    assert literal.go(60) == []
    assert mended.go(60)[0].endswith("me activate x released a")


def test_6_a_dead_teammate_does_not_block_even_literally() -> None:
    """robots_present, over which the Appendix sums, no longer holds it."""
    literal, mended = in_both_readings(
        Erratum.LEARNING_WINDOW, ALONE, ghosts={"a": ghost(("x", 0.1, 3.0), idle=False)}, learning=Learning.ACTIVE
    )
    assert literal.go(60) == mended.go(60)
    assert literal.told()[0].endswith("me activate x silence a")


def test_7_ends_of_windows() -> None:
    """A message at the instant of a step falls between two open windows: the reset never comes."""
    resets = []
    for arena in in_both_readings(
        Erratum.WINDOW_ENDS, ALONE, known={"x": {"me": 5, "a": 8}}, ghosts={"a": ghost(("x", 0.3, inf))}
    ):
        seen = []
        while arena.now < 0.9:
            arena.step()
            seen.append(arena.minds["me"].factors()["x"].impatience_reset)
        resets.append(seen)
    assert resets == [[1, 1, 1, 1, 1, 1, 1, 1, 1], [1, 1, 0, 1, 1, 1, 1, 1, 1]]


def test_8_whose_slow_rate_counts() -> None:
    """a, with 20 s, has left; b, with 4 s, is on the task. Strategy III."""
    rates = []
    for arena in in_both_readings(
        Erratum.SLOWEST_OF_WHOM,
        {"me": {"x": 50.0}},
        strategy=Strategy.III,
        known={"x": {"me": 50, "a": 20, "b": 4}},
        ghosts={"a": ghost(("x", 0.1, 0.5)), "b": ghost(("x", 0.6, inf))},
    ):
        arena.go(3)
        factors = arena.minds["me"].factors()["x"]
        assert factors.pace is Pace.SLOW
        rates.append(factors.rate)
    assert rates == [1 / 20, 1 / 4]


def test_9_boredom_at_work() -> None:
    """A robot with one behaviour set is bored when it gives up, and takes the task again without the pause."""
    literal, mended = in_both_readings(Erratum.BOREDOM_AT_WORK, ALONE, given=True, stuck=STUCK)
    begun = ["1.3 me activate x free", "11.4 me give_up x no_success"]
    assert literal.go(13) == [*begun, "11.6 me activate x free"]
    assert mended.go(13) == [*begun, "12.7 me activate x free"]
    assert [arena.minds["me"].factors()["x"].boredom > 0 for arena in (literal, mended)] == [True, False]


def test_10_unknown_times() -> None:
    """What is computed from an unknown time is unknown, and no motivation grows."""
    literal, mended = in_both_readings(Erratum.UNKNOWN_TIMES, ALONE)
    assert literal.go(7) == []
    assert literal.minds["me"].factors()["x"].pace is Pace.UNDEFINED
    assert mended.go(7) == ["1.3 me activate x free", "6.3 me complete x sensed"]


def test_11_lambda() -> None:
    """A stuck robot without a contender never stops."""
    literal, mended = in_both_readings(Erratum.GIVE_UP_RULE, ALONE, given=True, stuck=STUCK)
    assert literal.go(60) == ["1.3 me activate x free"]
    assert mended.go(12) == ["1.3 me activate x free", "11.4 me give_up x no_success"]


def test_12_strategy_i() -> None:
    """The Appendix has no formula for it; Table 1 says own time for both."""
    with pytest.raises(ValidationError, match="strategy_one"):
        Parameters(strategy=Strategy.I, readings={Erratum.STRATEGY_ONE: Reading.LITERAL})
    arena = Arena(ALONE, Parameters(strategy=Strategy.I), known={"x": {"me": 5, "a": 3}}, ghosts=IDLE)
    arena.go(2.2)
    made = arena.log[0][2]
    assert (made.verb, made.factors.psi, made.factors.own_time, made.factors.best_time) == (Verb.ACTIVATE, 5, 5, 3)


def test_13_memory_of_failed_attempts() -> None:
    """The nominally best but stuck robot takes the task back again and again where work restarts."""
    literal, mended = in_both_readings(
        Erratum.FAILED_ATTEMPTS,
        {"a": {"x": 5.0}, "b": {"x": 12.0}},
        given=True,
        stuck=frozenset({("a", "x")}),
        restarts=True,
    )
    assert literal.run(600) == inf
    assert mended.run(600) == pytest.approx(24.1)
    assert mended.told() == [
        "1.1 a activate x free",
        "11.2 a give_up x no_success",
        "12.1 b activate x released a",
        "24.1 b complete x sensed",
    ]


def test_14_credit_for_a_finished_task() -> None:
    """Who finishes what another began looks faster than it is."""
    literal, mended = in_both_readings(
        Erratum.CREDIT, {"a": {"x": 5.0}, "b": {"x": 9.0}}, given=True, dead_after={"a": 3.0}
    )
    for arena in (literal, mended):
        arena.run(60)
        arena.step()
        assert arena.told()[1:] == ["4.0 b activate x silence a", "9.8 b complete x sensed"]
    samples = [arena.minds["b"].knowledge.records()["x"]["b"].samples for arena in (literal, mended)]
    assert samples == [(9.0, pytest.approx(5.8)), (9.0,)]


def test_15_collisions() -> None:
    """Equal robots that start together both go on to the end."""
    literal, mended = in_both_readings(Erratum.COLLISION, {"a": {"x": 5.0}, "b": {"x": 5.0}}, given=True, restarts=True)
    started = ["1.1 a activate x free", "1.1 b activate x free"]
    assert literal.go(7) == [*started, "6.1 a complete x sensed", "6.1 b complete x sensed"]
    assert mended.go(7) == [*started, "1.2 b yield x collision a", "6.1 a complete x sensed"]


def test_16_patience_with_a_second_attempt() -> None:
    """A is on x from 0.1 to 3 and again from 7 on; phi is 5 s. Busy until 8.9, bored at 10.1."""
    literal, mended = in_both_readings(
        Erratum.SECOND_PATIENCE,
        {"me": {"x": 5.0, "y": 8.0}},
        known={"x": {"me": 5, "a": 9}, "y": {"me": 8, "a": 20}},
        ghosts={"a": ghost(("x", 0.1, 3), ("x", 7, inf))},
    )
    assert literal.go(13)[-1] == "10.2 me activate x impatience a"
    assert mended.go(13)[-1] == "12.1 me activate x impatience a"


def test_17_teammates_heard_elsewhere() -> None:
    """A does x better, and is on y, which this robot cannot do: that is no reason to take it for dead."""
    literal, mended = in_both_readings(
        Erratum.HEARD_ELSEWHERE, ALONE, known={"x": {"me": 5, "a": 3}}, ghosts={"a": ghost(("y", 0.5, inf))}
    )
    assert literal.go(3) == ["1.5 me activate x free"]
    assert mended.go(3) == ["2.1 me activate x free"]
    assert [arena.log[0][2].factors.category for arena in (literal, mended)] == [1, 2]


def test_a_failed_attempt_is_remembered_over_a_restart_of_the_process() -> None:
    arena = Arena(ALONE, given=True, stuck=STUCK)
    arena.go(12)
    stored = arena.minds["me"].knowledge.records()
    assert stored == {"x": {"me": Record((5.0,), pytest.approx(20.2), 10)}}
