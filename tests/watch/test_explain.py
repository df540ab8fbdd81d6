"""Each decision in one sentence: of every cause and strategy, of made-up messages, and of a whole simulated mission."""

from typing import Any

import pytest
from support.processes import MISSIONS

from lalliance_agents.config import Mission
from lalliance_agents.mission_file import load_mission, parse_mission
from lalliance_agents.model.events import Cause
from lalliance_agents.model.parameters import Strategy
from lalliance_agents.wire.messages import DecisionMade, decode, encode
from lalliance_study.simulator import Simulator
from mission_control.watch.explain import explain, tell, unmoved
from mission_control.watch.happened import Happened, happened_in

FACTORS: dict[str, Any] = {
    "motivation": 1.05, "pace": "fast", "rate": 3.5, "delay": 0.3, "category": 1, "own_time": 10.0, "best_time": 10.0,
    "boredom": 0.4, "sensory_feedback": 1, "activity_suppression": 1, "impatience_reset": 1, "acquiescence": 1,
    "learned_robot_influence": 1, "psi": 10.0, "lambda": 20.0,
}  # fmt: skip
LIFTER: dict[str, Any] = {
    "robot": "lifter", "first_heard": 80.0, "last_heard": 98.0, "lapsed_at": 99.1, "present": False, "patience": 10.0,
    "task_time": 7.0, "silent_for": 1.1, "started": 88.0, "expected": 7.0,
}  # fmt: skip
TERMS: dict[str, Any] = {
    "architecture": "l-alliance", "strategy": "II", "threshold": 1.0, "silence_timeout": 1.0, "boredom_threshold": 1.0,
    "give_up_factor": 2.0, "collision_window": 0.4,
}  # fmt: skip


def sentence(cause: Cause | str, *, strategy: str = "II", architecture: str = "l-alliance", **changed: Any) -> str:
    """What is said of a decision of `pusher` about barrel-1 at 14.2 s, with some things otherwise than above."""
    fields: dict[str, Any] = {"other": "lifter", "active_for": 0.0, "grown_for": 0.3, "expected": 10.0}
    fields |= {name: changed.pop(name) for name in fields.keys() & changed.keys()}
    mate = LIFTER | {name: changed.pop(name) for name in LIFTER.keys() & changed.keys()}
    made = DecisionMade(
        sender="pusher", incarnation=1, seq=1, at=100.0, trial=1, elapsed=14.2, task="barrel-1", cause=str(cause),
        verb=cause.verb if isinstance(cause, Cause) else "dance", factors=FACTORS | changed, teammates=[mate],
        terms=TERMS | {"strategy": strategy, "architecture": architecture}, **fields,
    )  # fmt: skip
    return explain(decode(DecisionMade, encode(made)), 14.2)


BEST = "pusher's own time 10.0 s was the best of those present"
FAST = "motivation reached the threshold after 0.3 s at the fast rate"
TOOK = "pusher took barrel-1 at 14.2 s"
BY_HAND = {"architecture": "alliance"}
WORKED = {"active_for": 12.0, "pace": "working"}
ENDED = "patience with lifter, which had been on it for 12.0 s, had ended after 10.0 s"


@pytest.mark.parametrize(
    ("cause", "changed", "said"),
    [
        (
            Cause.FREE,
            {"other": None},
            f"pusher started barrel-1 at 14.2 s: nobody had been heard on it; {BEST}; {FAST}",
        ),
        (Cause.SILENCE, {}, f"{TOOK}: lifter silent for 1.1 s (tau 1.0 s); {BEST}; {FAST}"),
        (Cause.SILENCE, BY_HAND, f"{TOOK}: lifter silent for 1.1 s (tau 1.0 s); {FAST}"),
        (
            Cause.SILENCE,
            {"own_time": None},
            f"{TOOK}: lifter silent for 1.1 s (tau 1.0 s); pusher did not know its own time yet; {FAST}",
        ),
        (
            Cause.SILENCE,
            {"best_time": 7.0, "category": 2, "boredom": 1.2},
            (
                f"{TOOK}: lifter silent for 1.1 s (tau 1.0 s); pusher's own time 10.0 s, where the best of those "
                f"present was 7.0 s; it was bored enough to take what is not its own first choice (boredom 1.2 of 1.0); {FAST}"
            ),
        ),
        (
            Cause.SILENCE,
            {"pace": "random", "grown_for": 0.0},
            f"{TOOK}: lifter silent for 1.1 s (tau 1.0 s); {BEST}; its motivation grows by chance in the active learning phase",
        ),
        (Cause.RELEASED, {}, f"{TOOK}: lifter had left it: heard, but not on it for 2.0 s (tau 1.0 s); {BEST}; {FAST}"),
        (Cause.IMPATIENCE, {"strategy": "I"}, f"{TOOK}: {ENDED} (pusher's own time, strategy I); {BEST}; {FAST}"),
        (Cause.IMPATIENCE, {}, f"{TOOK}: {ENDED} (pusher's own time, strategy II); {BEST}; {FAST}"),
        (
            Cause.IMPATIENCE,
            {"strategy": "III"},
            f"{TOOK}: {ENDED} (lifter's time as pusher knows it, strategy III); {BEST}; {FAST}",
        ),
        (Cause.IMPATIENCE, BY_HAND, f"{TOOK}: {ENDED} (set by hand); {FAST}"),
        (
            Cause.IMPATIENCE,
            {"grown_for": 4.0},
            (
                f"{TOOK}: {ENDED} (pusher's own time, strategy II); {BEST}; "
                "motivation reached the threshold after 4.0 s, the last of it at the fast rate"
            ),
        ),
        (
            Cause.IMPATIENCE,
            {"pace": "slow", "rate": 0.1, "grown_for": 10.5},
            (
                f"{TOOK}: {ENDED} (pusher's own time, strategy II); {BEST}; "
                "motivation reached the threshold after 10.5 s at the slow rate"
            ),
        ),
        (
            Cause.CONTENDER,
            WORKED,
            (
                "pusher yielded barrel-1 to lifter at 14.2 s: pusher had been on it for 12.0 s, longer than psi 10.0 s "
                "(the best time of those present, strategy II); lifter was heard on it 2.0 s before"
            ),
        ),
        (
            Cause.CONTENDER,
            WORKED | {"strategy": "I"},
            (
                "pusher yielded barrel-1 to lifter at 14.2 s: pusher had been on it for 12.0 s, longer than psi 10.0 s "
                "(pusher's own time, strategy I); lifter was heard on it 2.0 s before"
            ),
        ),
        (
            Cause.CONTENDER,
            WORKED | {"strategy": "III"},
            (
                "pusher yielded barrel-1 to lifter at 14.2 s: pusher had been on it for 12.0 s, longer than psi 10.0 s "
                "(pusher's own time, strategy III); lifter was heard on it 2.0 s before"
            ),
        ),
        (
            Cause.CONTENDER,
            WORKED | BY_HAND,
            (
                "pusher yielded barrel-1 to lifter at 14.2 s: pusher had been on it for 12.0 s, longer than psi 10.0 s "
                "(set by hand); lifter was heard on it 2.0 s before"
            ),
        ),
        (
            Cause.COLLISION,
            {"active_for": 0.2, "started": 99.7},
            (
                "pusher yielded barrel-1 to lifter at 14.2 s: both had started it within 0.1 s of each other "
                "(a collision is up to 0.4 s); lifter expected 7.0 s and pusher 10.0 s"
            ),
        ),
        (
            Cause.COLLISION,
            {"active_for": 0.2, "started": 99.7, "expected": 7.0},
            (
                "pusher yielded barrel-1 to lifter at 14.2 s: both had started it within 0.1 s of each other "
                "(a collision is up to 0.4 s); both expected 7.0 s, and lifter comes first by name"
            ),
        ),
        (
            Cause.NO_SUCCESS,
            {"active_for": 20.1, "other": None},
            (
                "pusher gave up barrel-1 at 14.2 s: no success after 20.1 s on it, longer than lambda 20.0 s "
                "(2 times its own time 10.0 s)"
            ),
        ),
        (
            Cause.NO_SUCCESS,
            {"active_for": 20.1, "other": None} | BY_HAND,
            "pusher gave up barrel-1 at 14.2 s: no success after 20.1 s on it, longer than lambda 20.0 s (set by hand)",
        ),
        (
            Cause.SENSED,
            {"active_for": 9.4},
            "pusher finished barrel-1 at 14.2 s: it is complete, after 9.4 s on it (10.0 s expected)",
        ),
        (
            Cause.INAPPLICABLE,
            WORKED,
            "pusher dropped barrel-1 at 14.2 s: it does not apply just now, after 12.0 s on it",
        ),
        (Cause.BODY_FAILED, WORKED, "pusher dropped barrel-1 at 14.2 s: its own code failed, after 12.0 s on it"),
        (Cause.NEW_TRIAL, WORKED, "pusher dropped barrel-1 at 14.2 s: the next trial begins"),
        (
            Cause.RESET,
            {},
            "pusher dropped barrel-1 at 14.2 s: lifter was first heard on it (reset_on_active read literally)",
        ),
        (
            Cause.NOT_BEST,
            WORKED | {"best_time": 7.0},
            (
                "pusher dropped barrel-1 at 14.2 s: a teammate was expected to do it better (influence_on_active read "
                "literally); pusher's own time 10.0 s, where the best of those present was 7.0 s"
            ),
        ),
        (
            Cause.SUPPRESSED,
            WORKED,
            "pusher dropped barrel-1 at 14.2 s: another task of pusher was active (one_active read literally)",
        ),
        ("wall", {}, "pusher decided to dance barrel-1 at 14.2 s: wall"),
    ],
)
def test_a_decision_is_one_sentence_made_from_its_factors(
    cause: Cause | str, changed: dict[str, Any], said: str
) -> None:
    assert sentence(cause, **changed) == said


@pytest.mark.parametrize("strategy", [strategy.name for strategy in Strategy])
@pytest.mark.parametrize("cause", sorted(set(Cause) - {Cause.IMPATIENCE, Cause.CONTENDER, Cause.NO_SUCCESS}))
def test_the_strategy_is_told_only_where_it_made_a_difference(cause: Cause, strategy: str) -> None:
    assert sentence(cause, strategy=strategy) == sentence(cause, strategy="II")


NOTHING = dict.fromkeys([*FACTORS, *LIFTER], None)
NONSENSE = {name: ["\x1b[2J", True, 1e308, -5, ""][place % 5] for place, name in enumerate([*FACTORS, *LIFTER])}


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("behind", [NOTHING, NONSENSE])
def test_what_is_missing_or_made_up_is_left_out(cause: Cause, behind: dict[str, Any]) -> None:
    said = sentence(cause, strategy="\x1b", **{**behind, "expected": 1.0})
    assert said.startswith("pusher ")
    assert "at 14.2 s: " in said
    assert "None" not in said
    assert said.isprintable()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"sensory_feedback": 0, "learned_robot_influence": 0}, "the task is out of reach"),
        (
            {"activity_suppression": 0, "impatience_reset": 0},
            "it is on another task; a teammate has just been heard on it",
        ),
        (
            {"learned_robot_influence": 0, "best_time": 7.0},
            "it leaves the task to others until it is bored (its own time 10.0 s, the best of those present 7.0 s)",
        ),
        (
            {"pace": "slow", "motivation": 0.25},
            "a teammate is on it, so its motivation grows at the slow rate and is at 0.25",
        ),
        ({"pace": "waiting", "motivation": 0.0}, "it waits for its teammates to be heard first and is at 0.00"),
    ],
)
def test_why_a_robot_is_not_on_a_task_follows_from_its_motivation(changed: dict[str, Any], said: str) -> None:
    told = unmoved("pusher", "crate-9", FACTORS | changed, "is out of reach")
    assert told == f"pusher is not on crate-9 now: {said}"


STUCK = """
name: stuck
tasks: {a: {}}
robots:
  left: {tasks: {a: 4}}
  right: {tasks: {a: 6}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.3}
faults: [{at: 1, robot: left, kind: stuck}]
"""


def simulated(mission: Mission) -> list[Happened]:
    simulator = Simulator(mission)
    happened: list[Happened] = []
    simulator.follow(lambda told: happened.extend(happened_in(told, simulator.world.elapsed)))
    simulator.run()
    return happened


def test_impatience_and_yielding_tell_what_was_waited_for() -> None:
    decisions = [one for one in simulated(parse_mission(STUCK, "stuck.yaml")) if one.made is not None]
    assert [tell(one) for one in decisions[1:]] == [
        (
            "right took a at 6.5 s: patience with left, which had been on it for 6.0 s, had ended after 6.0 s (right's own "
            "time, strategy II); right's own time 6.0 s, where the best of those present was 4.0 s; it was bored enough to "
            "take what is not its own first choice (boredom 17.8 of 1.0); motivation reached the threshold after 6.0 s, the "
            "last of it at the fast rate"
        ),
        (
            "left yielded a to right at 6.6 s: left had been on it for 6.1 s, longer than psi 4.0 s (the best time of those "
            "present, strategy II); right was heard on it 0.1 s before"
        ),
    ]


def test_a_simulated_mission_is_told_from_its_beginning_to_its_end() -> None:
    mission = load_mission(MISSIONS / "material_handling.yaml")
    happened = simulated(mission)
    told = [tell(one) for one in happened]
    assert told[:5] == [
        *(f"at 0.0 s: {robot} is there" for robot in mission.robots),
        "at 0.0 s: trial 1 begins (adaptive learning)",
    ]
    assert (
        "carrier took crate-2 at 15.1 s: lifter silent for 1.3 s (tau 1.0 s); carrier's own time 12.0 s was the best of those "
        "present; motivation reached the threshold after 2.6 s, the last of it at the fast rate"
    ) in told
    assert told[-1].startswith("at 26.0 s: complete after 26.0")
    decisions = [one for one in happened if one.made is not None]
    assert {one.kind for one in decisions} == {"activate", "sense_complete"}
    assert all(f" at {one.at:.1f} s: " in tell(one) and "None" not in tell(one) for one in decisions)
