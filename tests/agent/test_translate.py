"""Between wire and model: a literal log of both directions, and numbers that the wire cannot carry."""

import math

import pytest

from lalliance_agents.agent import translate
from lalliance_agents.model.events import Announce, Cause, Decision, Factors, Heard, Pace, Sensed, Teammate, Terms, Verb
from lalliance_agents.model.parameters import Learning, Parameters
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import Activity, DecisionMade, Heartbeat, TaskState, decode, encode

FACTORS = Factors(1.0, Pace.FAST, math.inf, 0.5, 2, 8.0, math.inf, math.nan, 1, 0, 1, 1, 1, 16.0, -math.inf)
MATE = Teammate("right", 1.0, 9.5, None, True, math.inf, None, 0.5, 0.9, 8.0)
TERMS = Terms.of(Parameters())


def test_what_a_teammate_says_becomes_an_event() -> None:
    header = {"sender": "right", "incarnation": 1, "seq": 1, "at": 99.0, "trial": 1}
    activity = Activity(**header, task="a", active_for=2.5, expected=8.0)
    assert translate.heard(activity) == Heard("right", "a", 2.5, 8.0)
    assert translate.heard(Heartbeat(**header)) == Heard("right", None, 0.0, 0.0)


def test_what_the_world_says_becomes_sensory_feedback() -> None:
    state = TaskState(
        sender="@world", incarnation=1, seq=1, at=0.0, trial=1, learning="active", applicable=True, complete=False, progress=0.5
    )  # fmt: skip
    sense = translate.sense(state)
    assert (sense.applicable, sense.complete, sense.progress) == (True, False, 0.5)
    assert translate.sensed("a", applicable=True, complete=True) == Sensed("a", applicable=False, complete=True)
    assert translate.sensed("a", applicable=True, complete=False) == Sensed("a", applicable=True, complete=False)
    assert translate.learning("active") is Learning.ACTIVE


def test_a_decision_becomes_a_message_in_which_what_is_not_finite_is_nothing() -> None:
    made = Decision(10.0, Verb.ACTIVATE, "a", Cause.IMPATIENCE, FACTORS, (MATE,), TERMS, -1e-12, "right", 0.5, 8.0)
    fields = translate.decision(made, 3, 7.5)
    assert fields == {
        "verb": "activate", "task": "a", "cause": "impatience", "other": "right", "active_for": 0.0, "trial": 3,
        "elapsed": 7.5, "grown_for": 0.5, "expected": 8.0,
        "factors": {
            "motivation": 1.0, "pace": "fast", "rate": None, "delay": 0.5, "category": 2, "own_time": 8.0,
            "best_time": None, "boredom": None, "sensory_feedback": 1, "activity_suppression": 0, "impatience_reset": 1,
            "acquiescence": 1, "learned_robot_influence": 1, "psi": 16.0, "lambda": None,
        },
        "teammates": [
            {"robot": "right", "first_heard": 1.0, "last_heard": 9.5, "lapsed_at": None, "present": True,
             "patience": None, "task_time": None, "silent_for": 0.5, "started": 0.9, "expected": 8.0},
        ],
        "terms": {
            "architecture": "l-alliance", "strategy": "II", "threshold": 1.0, "silence_timeout": 1.0,
            "boredom_threshold": 1.0, "give_up_factor": 2.0, "collision_window": 0.4,
        },
    }  # fmt: skip
    message = DecisionMade(sender="left", incarnation=1, seq=1, at=10.0, **fields)
    assert decode(DecisionMade, encode(message)) == message


@pytest.mark.parametrize(
    ("length", "told"),
    [(0.0, 0.0), (-1e-9, 0.0), (8.5, 8.5), (1e12, 1e12), (1e300, 1e12), (math.inf, 1e12), (math.nan, 1e12)],
)
def test_no_length_of_time_keeps_an_announcement_from_being_sent(length: float, told: float) -> None:
    kind, fields = translate.announcement(Announce("a", active_for=length, expected=length), 2)
    assert (kind, fields) == (Kind.ACTIVITY, {"task": "a", "trial": 2, "active_for": told, "expected": told})
    assert encode(Activity(sender="left", incarnation=1, seq=1, at=0.0, **fields))
    assert translate.announcement(Announce(None), 2) == (Kind.HEARTBEAT, {"trial": 2})
