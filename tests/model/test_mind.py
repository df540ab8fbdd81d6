"""The mind at work: literal logs of what it decides, and why, in small teams and beside scripted teammates.

Times at hand: control period 0.1 s, tau 1 s, delays 0.2 to 1 s, boredom after 1.2 s, collision window 0.4 s. A robot whose
roster is heard in the first step is idle since 0.
"""

import math
from math import inf

import pytest
from model.arena import Arena, ghost

from lalliance_agents.model.events import (
    Activate,
    Announce,
    BodyFailed,
    Cause,
    Command,
    Deactivate,
    Decision,
    Event,
    Heard,
    Pace,
    RosterKnown,
    Sensed,
    TrialStarted,
    Verb,
)
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.parameters import (
    Architecture,
    Erratum,
    HandSet,
    Learning,
    Ordering,
    Parameters,
    Reading,
    Strategy,
)

ALONE = {"me": {"x": 5.0}}
STUCK = frozenset({("me", "x")})


def mind(*tasks: str, **changes: object) -> Mind:
    """A mind that waits for nobody and senses that all its tasks are to be done."""
    made = Mind("me", tasks, Parameters(**changes), now=0.0, draw=lambda: 0.5)  # type: ignore[arg-type]
    made.handle(RosterKnown(frozenset()), 0.0)
    for task in tasks:
        made.handle(Sensed(task, applicable=True, complete=False), 0.0)
    return made


def run(one: Mind, since: float, until: float) -> list[Command]:
    """Tick ten times a second from after `since` up to `until`."""
    steps = round((until - since) * 10)
    return [command for step in range(1, steps + 1) for command in one.tick(round(since + step * 0.1, 9))]


def decisions(commands: list[Command]) -> list[Decision]:
    return [command.decision for command in commands if isinstance(command, Activate | Deactivate)]


# --- strategies


@pytest.mark.parametrize(
    ("strategy", "log"),
    [
        (
            Strategy.I,  # phi of b is its own 5 s; psi of a is its own 9 s, and it completes first
            ["8.2 b activate x impatience a", "9.3 a complete x sensed", "9.3 b complete x sensed"],
        ),
        (
            Strategy.II,  # phi of b is its own 5 s; psi of a is the best time of the team, 5 s
            ["8.2 b activate x impatience a", "8.3 a yield x contender b", "9.9 b complete x sensed"],
        ),
        (
            Strategy.III,  # phi of b is the time of a, 9 s: a is left to complete the task
            ["11.2 a complete x sensed"],
        ),
    ],
)
def test_each_strategy_hands_a_task_over_in_its_own_way(strategy: Strategy, log: list[str]) -> None:
    """B is better at x but busy with y, so a takes x when it is bored; b comes free at 6.9, is bored at 8.1, takes x at 8.2."""
    arena = Arena({"a": {"x": 9.0}, "b": {"x": 5.0, "y": 6.0}}, Parameters(strategy=strategy), given=True)
    arena.run(60)
    assert arena.told() == ["0.9 b activate y free", "2.2 a activate x free", "6.9 b complete y sensed", *log]


@pytest.mark.parametrize(("strategy", "at"), [(Strategy.I, 6.1), (Strategy.II, 6.1), (Strategy.III, 10.1)])
def test_impatience_ends_phi_after_the_first_message(strategy: Strategy, at: float) -> None:
    """Own time 6 s, the teammate's 10 s, first heard at 0.1."""
    arena = Arena(
        {"me": {"x": 6.0}},
        Parameters(strategy=strategy),
        known={"x": {"me": 6, "a": 10}},
        ghosts={"a": ghost(("x", 0.1, inf))},
    )
    assert arena.go(12)[0] == f"{at} me activate x impatience a"


@pytest.mark.parametrize(("strategy", "at"), [(Strategy.I, 8.2), (Strategy.II, 6.2), (Strategy.III, 8.2)])
def test_a_task_is_yielded_after_more_than_psi(strategy: Strategy, at: float) -> None:
    """Active since 2.1; own time 6 s, the contender's 4 s. At psi exactly the task is kept."""
    arena = Arena(
        {"me": {"x": 6.0}},
        Parameters(strategy=strategy),
        known={"x": {"me": 6, "a": 4}},
        ghosts={"a": ghost(("x", 3.0, inf))},
        stuck=STUCK,
    )
    assert arena.go(9)[:2] == ["2.1 me activate x free", f"{at} me yield x contender a"]


def test_without_a_contender_psi_means_nothing() -> None:
    arena = Arena(ALONE, known={"x": {"me": 5, "a": 9}}, ghosts={"a": ghost()}, stuck=STUCK)
    assert arena.go(11) == ["1.0 me activate x free"]


# --- orderings


@pytest.mark.parametrize(
    ("ordering", "log"),
    [
        (
            Ordering.DERIVED,  # q and p are of category 1, longest first; r and s, once bored, shortest first
            ["0.5 q", "7.4 p", "12.0 r", "18.1 s"],
        ),
        (Ordering.MODIFIED_SHORTEST_FIRST, ["0.4 p", "4.2 q", "11.8 r", "17.9 s"]),
        (Ordering.LONGEST_FIRST, ["0.2 s", "8.7 q", "15.5 r", "20.4 p"]),
    ],
)
def test_each_ordering_takes_tasks_in_its_own_order(ordering: Ordering, log: list[str]) -> None:
    """Own times 3, 6, 4, 8 s; the idle teammate is better at r and s. low 2, high 8: the scale is 0.8 / 6."""
    assert order_of(ordering, seed=0) == log


def test_a_random_order_keeps_the_best_robot_category_and_differs_between_seeds() -> None:
    orders = {tuple(order_of(Ordering.MODIFIED_RANDOM, seed)) for seed in range(8)}
    tasks = {tuple(line[-1] for line in order) for order in orders}
    assert len(tasks) > 1
    assert {frozenset(order[:2]) for order in tasks} == {frozenset("pq")}


def order_of(ordering: Ordering, seed: int) -> list[str]:
    arena = Arena(
        {"me": {"p": 3.0, "q": 6.0, "r": 4.0, "s": 8.0}},
        Parameters(ordering=ordering),
        known={
            "p": {"me": 3, "a": 7},
            "q": {"me": 6, "a": 7},
            "r": {"me": 4, "a": 2},
            "s": {"me": 8, "a": 2},
        },
        ghosts={"a": ghost()},
        seed=seed,
    )
    arena.run(60)
    return [f"{at:.1f} {made.task}" for at, _, made in arena.log if made.verb is Verb.ACTIVATE]


# --- deaths, stuck robots, collisions


@pytest.mark.parametrize("period", [0.1, 0.07])
@pytest.mark.parametrize("phase", range(12))
def test_a_dead_robots_task_is_taken_within_tau_and_delay_and_one_control_period(phase: int, period: float) -> None:
    died = 3.0 + phase * 0.05
    arena = Arena({"a": {"x": 9.0}, "b": {"x": 5.0}}, given=True, dead_after={"b": died}, period=period)
    arena.run(60)
    at, _, taken = next(entry for entry in arena.log if entry[1] == "a")
    assert (taken.verb, taken.cause, taken.other) == (Verb.ACTIVATE, Cause.SILENCE, "b")
    assert at <= died + 1.0 + taken.factors.delay + period + 1e-9
    assert at >= died + 1.0 - 0.2 - period, "no earlier than tau after its last message"


def test_death_told_in_full() -> None:
    arena = Arena({"a": {"x": 9.0}, "b": {"x": 5.0}}, given=True, dead_after={"b": 3.0})
    arena.run(60)
    assert arena.told() == ["1.1 b activate x free", "4.0 a activate x silence b", "9.8 a complete x sensed"]


def test_a_stuck_robot_is_replaced_when_patience_ends_and_yields() -> None:
    """Phi of a is its own 9 s since 1.1; b is active for more than its psi of 5 s when the contender comes."""
    arena = Arena({"a": {"x": 9.0}, "b": {"x": 5.0}}, given=True, stuck=frozenset({("b", "x")}))
    arena.run(60)
    assert arena.told() == [
        "1.1 b activate x free",
        "10.1 a activate x impatience b",
        "10.2 b yield x contender a",
        "19.1 a complete x sensed",
    ]


def test_without_contender_a_stuck_robot_gives_up_after_more_than_lambda_and_tries_again_later() -> None:
    """Lambda is 2 * 5 s; the failed attempt of 10.1 s makes the own time 20.2 and lambda 40.4 s."""
    arena = Arena(ALONE, given=True, stuck=STUCK)
    assert arena.go(54) == [
        "1.3 me activate x free",
        "11.4 me give_up x no_success",
        "12.7 me activate x free",
        "53.2 me give_up x no_success",
    ]


def test_a_robot_that_failed_tries_what_a_stuck_teammate_holds_before_it_returns_to_its_failure() -> None:
    """Nobody else's time for x is known; a is not the best at it by the lower bound that its failure has left."""
    arena = Arena(
        {"a": {"x": 3.0, "y": 3.0}, "b": {"x": 3.0, "y": 3.0}},
        known={"x": {"a": 3}, "y": {"b": 3}},
        stuck=frozenset({("a", "x"), ("b", "y")}),
    )
    assert arena.run(60) < 60
    assert {task: robot for task, (_, robot) in arena.completed.items()} == {"x": "b", "y": "a"}


def test_of_robots_that_start_together_the_fastest_goes_on() -> None:
    """Nothing is known of teammates; the own times differ, but both delays are 0.2 s."""
    arena = Arena({"a": {"x": 9.0}, "b": {"x": 5.0}})
    for robot, own in (("a", 9.0), ("b", 5.0)):
        arena.minds[robot].knowledge.monitors["x"].observe(robot, own, own)
        arena.minds[robot].knowledge.monitors["x"].completed(own)
    arena.begin(Learning.ADAPTIVE)
    assert arena.go(2) == ["1.4 a activate x free", "1.4 b activate x free", "1.5 a yield x collision b"]


def test_of_equal_robots_that_start_together_the_first_by_name_goes_on() -> None:
    arena = Arena({"c": {"x": 5.0}, "a": {"x": 5.0}, "b": {"x": 5.0}}, given=True, restarts=True)
    assert arena.go(7) == [
        "1.1 c activate x free",
        "1.1 a activate x free",
        "1.1 b activate x free",
        "1.2 c yield x collision a",
        "1.2 b yield x collision a",
        "6.1 a complete x sensed",
    ]


def test_who_started_earlier_than_the_window_does_not_yield_to_a_faster_one() -> None:
    """Active since 1.0; the teammate starts more than 0.4 s later."""
    for since, log in (
        (1.4, ["1.0 me activate x free", "1.4 me yield x collision a"]),
        (1.5, ["1.0 me activate x free"]),
    ):
        arena = Arena(
            ALONE, known={"x": {"me": 5, "a": 9}}, ghosts={"a": ghost(("x", since, inf), expected=1.0)}, stuck=STUCK
        )
        assert arena.go(5) == log


# --- patience in a second attempt


@pytest.mark.parametrize(("reading", "at"), [(Reading.LITERAL, 10.2), (Reading.MENDED, 12.1)])
def test_a_second_attempt_gets_patience_only_when_mended(reading: Reading, at: float) -> None:
    """A is on x from 0.1 to 3 and again from 7 on; phi is 5 s. Busy until 8.9, bored at 10.1."""
    arena = Arena(
        {"me": {"x": 5.0, "y": 8.0}},
        Parameters(readings={Erratum.SECOND_PATIENCE: reading}),
        known={"x": {"me": 5, "a": 9}, "y": {"me": 8, "a": 20}},
        ghosts={"a": ghost(("x", 0.1, 3), ("x", 7, inf))},
    )
    assert arena.go(13) == [
        "0.9 me activate y free",
        "8.9 me complete y sensed",
        f"{at} me activate x impatience a",
    ]


# --- active learning


def test_in_active_learning_no_robot_takes_what_a_teammate_is_on() -> None:
    """A is last heard on it at 29.9: until tau has passed it is taken to be there."""
    arena = Arena(ALONE, ghosts={"a": ghost(("x", 0.1, 30.0))}, learning=Learning.ACTIVE)
    assert arena.go(30.8) == []
    assert arena.go(33)[0].endswith("me activate x released a")


def test_in_active_learning_no_robot_yields_or_gives_up() -> None:
    arena = Arena(
        ALONE,
        known={"x": {"me": 5, "a": 3}},
        ghosts={"a": ghost(("x", 5.0, inf))},
        stuck=STUCK,
        learning=Learning.ACTIVE,
    )
    assert [line.split(" ", 1)[1] for line in arena.go(60)] == ["me activate x free"]


def test_training_fills_the_monitors_of_all_with_the_true_times() -> None:
    times = {"a": {"x": 3.0, "y": 2.0}, "b": {"x": 4.0, "y": 5.0}}
    arena = Arena(times, Parameters(trials=3), learning=Learning.ACTIVE)
    shared = {"a": {"b": frozenset("xy")}, "b": {"a": frozenset("xy")}}
    for _ in range(60):
        arena.run(arena.now + 60)
        arena.step()
        if all(one.knowledge.fewest(shared[robot]) == 3 for robot, one in arena.minds.items()):
            break
        arena.begin(Learning.ACTIVE)
    for one in arena.minds.values():
        for robot, own in times.items():
            for task, time in own.items():
                assert one.knowledge.time_of(robot, task) == pytest.approx(time, abs=0.25), "one step and one message"


def test_motivation_grows_by_theta_times_the_draw_in_each_step() -> None:
    draws = iter([0.0, 0.0, 0.3, 0.25, 0.4, 0.1])  # two for the draws of the two trials
    one = Mind("me", ["x"], Parameters(threshold=2.0), now=0.0, draw=lambda: next(draws))
    one.handle(TrialStarted(Learning.ACTIVE), 0.0)
    one.handle(RosterKnown(frozenset()), 0.0)
    one.handle(Sensed("x", applicable=True, complete=False), 0.0)
    grown = []
    for step in range(1, 5):
        one.tick(step * 0.1)
        grown.append(one.factors()["x"].motivation)
    assert grown == pytest.approx([0.6, 1.1, 1.9, 2.1])  # 2 * 0.3, + 2 * 0.25, + 2 * 0.4, + 2 * 0.1
    assert one.active == ["x"]


# --- ALLIANCE


def by_hand(**values: float) -> Parameters:
    return Parameters(architecture=Architecture.ALLIANCE, by_hand=HandSet(**values))


def test_alliance_takes_a_free_task_at_the_fast_rate_without_boredom() -> None:
    """Also where it knows that the teammate is better."""
    arena = Arena(ALONE, by_hand(fast_rate=0.5), known={"x": {"me": 9, "a": 1}}, ghosts={"a": ghost()})
    assert arena.go(3) == ["2.0 me activate x free"]  # 1 / 0.5


def test_alliance_grows_at_the_slow_rate_while_a_teammate_is_on_the_task() -> None:
    arena = Arena(ALONE, by_hand(slow_rate=0.25), ghosts={"a": ghost(("x", 0.1, inf))})
    assert arena.go(5) == ["4.1 me activate x impatience a"]  # reset at 0.1, then 1 / 0.25


def test_alliance_grows_at_the_fast_rate_when_patience_has_ended() -> None:
    """Reset at 0.1; patience ends at 3.1. By 3.0 grown to 2.9 * 0.05 = 0.145, and 0.855 more take 0.9 s at rate 1."""
    arena = Arena(ALONE, by_hand(slow_rate=0.05, patience=3.0), ghosts={"a": ghost(("x", 0.1, inf))})
    assert arena.go(5) == ["3.9 me activate x impatience a"]


def test_alliance_yields_after_its_yield_time_and_gives_up_after_its_give_up_time() -> None:
    """Active since 1.0; the contender is heard from 2 on."""
    limits = by_hand(yield_time=4.0, give_up_time=6.0)
    contended = Arena(ALONE, limits, ghosts={"a": ghost(("x", 2.0, inf))}, stuck=STUCK)
    assert contended.go(6) == ["1.0 me activate x free", "5.1 me yield x contender a"]
    alone = Arena(ALONE, limits, stuck=STUCK)
    assert alone.go(8) == ["1.0 me activate x free", "7.1 me give_up x no_success"]


def test_alliance_has_parameters_per_behaviour_set() -> None:
    parameters = Parameters(
        architecture=Architecture.ALLIANCE, by_hand_tasks={"y": HandSet(fast_rate=2.0), "x": HandSet(fast_rate=1.0)}
    )
    assert Arena({"me": {"x": 5.0, "y": 5.0}}, parameters).go(1) == ["0.5 me activate y free"]


def test_alliance_learns_nothing_that_changes_it() -> None:
    """A stuck robot that gave up begins again as before."""
    arena = Arena(ALONE, by_hand(give_up_time=2.0), stuck=STUCK)
    assert arena.go(8) == [
        "1.0 me activate x free",
        "3.1 me give_up x no_success",
        "4.1 me activate x free",
        "6.2 me give_up x no_success",
        "7.2 me activate x free",
    ]


# --- bodies, trials


def test_a_failed_body_drops_the_task_and_leaves_a_floor() -> None:
    one = mind("x")
    run(one, 0.0, 4.0)
    one.handle(BodyFailed("x"), 4.05)
    (dropped,) = decisions(one.tick(4.1))
    assert (dropped.verb, dropped.cause, dropped.task) == (Verb.DROP, Cause.BODY_FAILED, "x")
    assert dropped.active_for == pytest.approx(2.8)  # bored at 1.2, active at 1.3
    assert one.knowledge.monitors["x"].floor("me") == pytest.approx(5.6)
    assert one.active == []


def test_a_body_failure_of_an_idle_set_is_nothing() -> None:
    one = mind("x")
    one.handle(BodyFailed("x"), 0.05)
    assert [(made.verb, made.at) for made in decisions(run(one, 0.0, 3.0))] == [(Verb.ACTIVATE, 1.3)]


def test_a_task_that_ceases_to_apply_is_dropped_without_blame() -> None:
    one = mind("x")
    run(one, 0.0, 4.0)
    one.handle(Sensed("x", applicable=False, complete=False), 4.05)
    (dropped,) = decisions(one.tick(4.1))
    assert (dropped.verb, dropped.cause) == (Verb.DROP, Cause.INAPPLICABLE)
    assert one.knowledge.records() == {"x": {}}
    assert decisions(run(one, 4.1, 9.0)) == []


def test_a_trial_forgets_all_but_the_monitors() -> None:
    one = mind("x", "y")
    one.handle(Heard("a", "y", 0.0, 9.0), 0.05)
    run(one, 0.0, 3.0)
    assert one.active == ["x"]
    one.handle(Sensed("x", applicable=False, complete=True), 3.0)
    run(one, 3.0, 3.5)
    learned = one.knowledge.records()
    assert learned["x"]["me"].samples
    one.handle(TrialStarted(Learning.ADAPTIVE), 3.55)
    assert one.knowledge.records() == learned
    assert one.hearing.robots_present(3.55) == []
    assert list(one.hearing.contacts("y")) == []
    one.tick(3.6)
    assert {task: factors.sensory_feedback for task, factors in one.factors().items()} == {"x": 0, "y": 0}
    assert {task: factors.motivation for task, factors in one.factors().items()} == {"x": 0.0, "y": 0.0}


def test_a_trial_drops_the_active_set_and_says_why_and_beside_whom() -> None:
    one = mind("x")
    one.handle(Heard("a", "x", 0.0, 9.0), 0.05)
    run(one, 0.0, 40.0)
    assert one.active == ["x"]
    one.handle(TrialStarted(Learning.ADAPTIVE), 40.05)
    assert one.active == []
    (dropped,) = decisions(one.tick(40.1))
    assert (dropped.verb, dropped.cause, dropped.at) == (Verb.DROP, Cause.NEW_TRIAL, 40.05)
    assert [mate.robot for mate in dropped.teammates] == ["a"]
    assert one.knowledge.records() == {"x": {}}, "the trial's end is nobody's failure"


def test_the_roster_is_waited_for_anew_in_each_trial() -> None:
    one = mind("x")
    one.handle(RosterKnown(frozenset({"a", "me"})), 0.0)
    one.handle(TrialStarted(Learning.ADAPTIVE), 10.0)
    one.handle(Sensed("x", applicable=True, complete=False), 10.0)
    paces = []
    for step in range(1, 13):
        one.tick(10.0 + step * 0.1)
        paces.append(one.factors()["x"].pace)
    assert paces == [Pace.WAITING] * 9 + [Pace.FAST] * 3, "tau has passed at 11.0"
    one.handle(TrialStarted(Learning.ADAPTIVE), 20.0)
    one.handle(Heard("a"), 20.05)
    one.tick(20.1)
    assert one.factors()["x"].pace is Pace.FAST


# --- what must never harm


ODD: list[Event] = [
    Heard("a", "unknown task", 1.0, 9.0),
    Heard("stranger"),
    Heard("stranger", "x", 0.0, 9.0),
    Heard("me", "x", 0.0, 0.0),
    Heard("me"),
    Heard("a", "x", -5.0, 9.0),
    Heard("a", "x", math.nan, math.nan),
    Heard("a", "x", math.inf, math.inf),
    Heard("a", "x", -math.inf, -math.inf),
    Heard("a", "x", 1e300, -1.0),
    Heard("", "", 0.0, 0.0),
    Sensed("unknown task", applicable=True, complete=False),
    BodyFailed("unknown task"),
    Sensed("x", applicable=True, complete=True),
    Heard("a", "x", 3.0, 9.0),
    BodyFailed("x"),
    Sensed("x", applicable=False, complete=False),
    Heard("a", "x", 1.0, 9.0),
    RosterKnown(frozenset({"me"})),
    TrialStarted(Learning.ACTIVE),
    TrialStarted(Learning.ACTIVE),
    Sensed("x", applicable=True, complete=False),
]


@pytest.mark.parametrize("architecture", Architecture)
@pytest.mark.parametrize("reading", Reading)
def test_odd_messages_do_no_harm(architecture: Architecture, reading: Reading) -> None:
    readings = dict.fromkeys(Erratum, reading)
    one = mind("x", "y", architecture=architecture, readings=readings)
    for turn in range(6):
        for number, event in enumerate(ODD[turn:] + ODD[:turn]):
            now = turn * 100.0 + number * 3.0
            one.handle(event, now)
            run(one, now, now + 2.9)
    for robots in one.knowledge.records().values():
        for record in robots.values():
            assert all(0 < sample < math.inf for sample in record.samples)


def test_a_message_from_oneself_is_not_heard() -> None:
    one = mind("x")
    one.handle(Heard("me", "x", 0.0, 1.0), 0.0)
    assert one.hearing.robots_present(0.5) == []
    assert list(one.hearing.contacts("x")) == []


def test_an_impossible_activity_says_only_that_the_teammate_is_there() -> None:
    one = mind("x")
    for active_for in (-1.0, math.nan, math.inf):
        one.handle(Heard("a", "x", active_for, 1.0), 0.0)
    assert one.hearing.robots_present(0.5) == ["a"]
    assert not one.hearing.anybody_on("x", 0.5)


def test_a_message_about_a_complete_task_begins_no_attempt() -> None:
    one = mind("x")
    one.handle(Sensed("x", applicable=False, complete=True), 1.0)
    one.handle(Heard("a", "x", 5.0, 9.0), 1.1)
    one.handle(Sensed("x", applicable=False, complete=True), 1.2)
    run(one, 1.2, 5.0)
    assert one.knowledge.records() == {"x": {}}


# --- broadcasts


def announcements(commands: list[Command]) -> list[Announce]:
    return [command for command in commands if isinstance(command, Announce)]


@pytest.mark.parametrize(
    ("rate", "period", "expected"), [(5.0, 0.1, 50), (5.0, 0.05, 50), (4.0, 0.1, 40), (5.0, 0.15, 50)]
)
def test_a_robot_announces_itself_at_rate_rho(rate: float, period: float, expected: int) -> None:
    """Whether idle or not, and whatever the control period."""
    one = mind("x", broadcast_rate=rate)
    one.handle(Sensed("x", applicable=False, complete=False), 0.0)
    said = announcements([command for step in range(1, round(10 / period) + 1) for command in one.tick(step * period)])
    assert said == [Announce(None)] * len(said)
    assert len(said) == pytest.approx(expected, abs=1)


def test_a_start_is_announced_at_once_with_the_time_expected() -> None:
    one = mind("x", initial_task_time=12.0, broadcast_rate=2.5)
    said = [(round(step * 0.1, 1), one.tick(step * 0.1)) for step in range(1, 20)]
    on_task = [(at, told) for at, commands in said for told in announcements(commands) if told.task]
    assert on_task[0] == (1.3, Announce("x", 0.0, 12.0))
    assert on_task[1] == (1.7, Announce("x", pytest.approx(0.4), 12.0))


def test_a_robot_without_tasks_is_there_and_does_nothing() -> None:
    one = mind()
    assert set(run(one, 0.0, 3.0)) == {Announce(None)}
    assert repr(one) == "<Mind me: idle, 0 sets>"
