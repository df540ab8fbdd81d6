"""Between the wire and the model: messages become events, decisions become messages. The only place that knows both."""

import math
from typing import Any

from lalliance_agents.agent.behavior import TaskSense
from lalliance_agents.model.events import Announce, Decision, Factors, Heard, Sensed, Teammate, Terms
from lalliance_agents.model.parameters import Learning
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import LONGEST, Activity, Heartbeat, Scalars, TaskState


def heard(message: Activity | Heartbeat) -> Heard:
    """What a teammate's message says to the mind."""
    if isinstance(message, Activity):
        return Heard(message.sender, message.task, message.active_for, message.expected)
    return Heard(message.sender)


def sense(state: TaskState) -> TaskSense:
    """What the world says of a task."""
    return TaskSense(state.applicable, state.complete, state.progress)


def sensed(task: str, applicable: bool, complete: bool) -> Sensed:
    """What the mind is told of a task."""
    return Sensed(task, applicable=applicable and not complete, complete=complete)


def learning(word: str) -> Learning:
    """The control phase that the world named."""
    return Learning(word)


def announcement(command: Announce, trial: int) -> tuple[Kind, dict[str, Any]]:
    """The kind and the fields of the message that announces the current activity."""
    if command.task is None:
        return Kind.HEARTBEAT, {"trial": trial}
    return Kind.ACTIVITY, {
        "task": command.task,
        "trial": trial,
        "active_for": _seconds(command.active_for),
        "expected": _seconds(command.expected),
    }


def decision(made: Decision, trial: int, elapsed: float | None) -> dict[str, Any]:
    """The fields of the message that reports a decision, made `elapsed` seconds after the trial began, if that is known."""
    return {
        "verb": made.verb.value,
        "task": made.task,
        "cause": made.cause.value,
        "other": made.other,
        "active_for": _seconds(made.active_for),
        "trial": trial,
        "elapsed": None if elapsed is None else _seconds(elapsed),
        "grown_for": _seconds(made.grown_for),
        "expected": _seconds(made.expected),
        "factors": scalars(made.factors),
        "teammates": [scalars(mate) for mate in made.teammates],
        "terms": scalars(made.terms),
    }


def _seconds(length: float) -> float:
    """A length of time as the wire can carry it; one that is not known counts as the longest, in seconds."""
    return max(0.0, length) if length <= LONGEST else LONGEST


def scalars(record: Factors | Teammate | Terms) -> Scalars:
    """A record's fields as plain values; a number that is not finite becomes None."""
    return {name.rstrip("_"): _plain(value) for name, value in record._asdict().items()}


def _plain(value: Any) -> str | int | float | bool | None:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, str) else value
