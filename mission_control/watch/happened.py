"""What happens in a mission, the same from a bus, from a recording and from the simulator.

The world's events and the robots' decisions become a `Happened`. Instants are seconds of mission time since the trial
began. Pure.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lalliance_agents.model.events import Verb
from lalliance_agents.wire.messages import DecisionMade, Event
from mission_control.watch.words import describe

if TYPE_CHECKING:
    from world_server.world import Happening

#: Each kind of event, and what it says.
KINDS: dict[str, str] = {
    "trial": "a trial begins",
    "trial_over": "a trial is complete, and another one follows",
    "end": "the mission has ended; cause: complete or failed",
    "complete": "a task is complete; robot: one that completed it",
    "takeover": "robot takes a task over from other; cause: silence, impatience or released",
    "present": "robot's process is there",
    "gone": "robot's process is not there any more",
    "fault": "a fault begins",
    "fault_over": "a fault is over",
    "warning": "the world finds something doubtful",
    "activate": "robot starts a task; cause: free, silence, impatience or released",
    "yield": "robot leaves a task to other; cause: contender or collision",
    "give_up": "robot gives a task up without success",
    "sense_complete": "robot senses that the task it is on is complete",
    "drop": "robot leaves a task that it cannot be on any more; cause: inapplicable, body_failed, new_trial, …",
    "remark": "something about a real process: what it printed, how it ended, that it is started again",
}

_VERBS = frozenset(Verb)
#: Letters of a name or a cause that are kept.
_LONGEST = 64
#: How a mission ends, in the words of its status.
_ENDINGS = frozenset({"complete", "failed"})
#: What the world calls a thing that has two sides: whether it begins or ends.
_TWO_SIDED = {"trial": ("trial", "trial_over"), "fault": ("fault", "fault_over")}


@dataclass(frozen=True, slots=True)
class Happened:
    """One event of a mission.

    Attributes:
        at: when, in seconds since the trial began; of the mission's clock, as exactly as the engine knows it.
        kind: one of `KINDS`, or `decision` if a robot calls its decision something else.
        text: the whole of it in words.
        robot: whom it is about.
        task: the task it is about.
        cause: why.
        other: the teammate it is about.
        fault: the name of the fault.
        trial: in which trial; 0 where that is not known.
        made: the whole of a decision.
    """

    at: float
    kind: str
    text: str
    robot: str | None = None
    task: str | None = None
    cause: str | None = None
    other: str | None = None
    fault: str | None = None
    trial: int = 0
    made: DecisionMade | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.at:7.1f} s  {self.text}"


def of_event(event: "Event | Happening") -> Happened | None:
    """What the world tells; None for its orders to whoever holds the processes, as they follow from what is told."""
    details = event.details
    kind, cause, other, fault = event.kind, None, None, None
    if kind == "order":
        return None
    if kind in _TWO_SIDED:
        kind = _TWO_SIDED[kind][0 if details.get("begins") else 1]
        fault = _text(details.get("name"))
    elif kind == "takeover":
        cause, other = _text(details.get("cause")), _text(details.get("from"))
    elif kind in _ENDINGS and event.task is None:
        kind, cause = "end", kind
    trial = event.trial if isinstance(event, Event) else 0
    return Happened(event.elapsed, kind, event.text, event.robot, event.task, cause, other, fault, trial)


def of_decision(made: DecisionMade, at: float) -> Happened:
    """What a robot has decided; where it does not know when, it was at the instant `at` of the world's time."""
    kind = "sense_complete" if made.verb == Verb.COMPLETE else made.verb if made.verb in _VERBS else "decision"
    at = max(at, 0.0) if made.elapsed is None else made.elapsed
    return Happened(
        at, kind, describe(made), made.sender, made.task, made.cause, made.other, trial=made.trial, made=made
    )


def happened_in(told: "Happening | DecisionMade", at: float) -> list[Happened]:
    """What an operator hears at the instant `at` of the world's time: one thing that happened, or none."""
    one = of_decision(told, at) if isinstance(told, DecisionMade) else of_event(told)
    return [] if one is None else [one]


def _text(value: object) -> str | None:
    return None if value is None else str(value)[:_LONGEST]
