"""What happens in a mission, in the words in which a test waits for it; the same from real processes and from the simulator.

What an operator hears becomes a `Happened`: the world's events, the robots' decisions, and remarks on processes. `Wanted`
says which of them a test waits for. Instants are seconds of mission time since the trial began.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields

from lalliance_agents.config import Mission, like
from lalliance_agents.errors import UserError
from lalliance_agents.model.events import Cause, Verb
from lalliance_agents.wire.messages import DecisionMade, Event
from mission_control.picture import describe
from world_server.world import Happening, Stage

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

_CAUSES = {*(cause.value for cause in Cause), Stage.COMPLETE.value, Stage.FAILED.value}
#: What the world calls a thing that has two sides: whether it begins or ends.
_TWO_SIDED = {"trial": ("trial", "trial_over"), "fault": ("fault", "fault_over")}


@dataclass(frozen=True, slots=True)
class Happened:
    """One event of a mission.

    Attributes:
        at: when, in seconds since the trial began; of the mission's clock, as exactly as the engine knows it.
        kind: one of `KINDS`.
        text: the whole of it in words.
        robot: whom it is about.
        task: the task it is about.
        cause: why.
        other: the teammate it is about.
        fault: the name of the fault.
    """

    at: float
    kind: str
    text: str
    robot: str | None = None
    task: str | None = None
    cause: str | None = None
    other: str | None = None
    fault: str | None = None

    def __str__(self) -> str:
        return f"{self.at:7.1f} s  {self.text}"


def of_event(event: Event | Happening) -> Happened | None:
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
    elif kind in {Stage.COMPLETE.value, Stage.FAILED.value} and event.task is None:
        kind, cause = "end", kind
    return Happened(event.elapsed, kind, event.text, event.robot, event.task, cause, other, fault)


def of_decision(made: DecisionMade, at: float) -> Happened:
    """What a robot has decided at the instant `at` of the world's time."""
    kind = "sense_complete" if made.verb == Verb.COMPLETE else made.verb
    return Happened(max(at, 0.0), kind, describe(made), made.sender, made.task, made.cause, made.other)


def _text(value: object) -> str | None:
    return None if value is None else str(value)


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a test waits for: a kind of event and what is to be true of it; None: anything.

    Attributes:
        text: what its text is to contain.
    """

    kind: str
    robot: str | None = None
    task: str | None = None
    cause: str | None = None
    other: str | None = None
    fault: str | None = None
    text: str | None = None

    @classmethod
    def of(cls, kind: str, facts: Mapping[str, str | None], mission: Mission) -> "Wanted":
        """What `kind` and `facts` ask for, checked against the mission.

        Raises:
            UserError: no such thing can happen in this mission.
        """
        known = [field.name for field in fields(cls) if field.name != "kind"]
        _check(kind, KINDS, "a kind of event")
        for name in facts:
            _check(name, known, "a fact of an event")
        for name in ("robot", "other"):
            _check(facts.get(name), mission.robots, "a robot of this mission")
        _check(facts.get("task"), mission.tasks, "a task of this mission")
        _check(facts.get("cause"), _CAUSES, "a cause")
        return cls(kind, **facts)

    def fits(self, event: Happened) -> bool:
        """Whether this is it."""
        return (
            event.kind == self.kind
            and all(wanted == getattr(event, name) for name, wanted in self._facts() if name != "text")
            and (self.text is None or self.text in event.text)
        )

    def _facts(self) -> Iterator[tuple[str, str]]:
        return ((name, value) for name, value in asdict(self).items() if name != "kind" and value is not None)

    def __str__(self) -> str:
        return " ".join([self.kind, *(f"{name}={value}" for name, value in self._facts())])


def _check(word: str | None, known: Mapping[str, object] | list[str] | set[str], what: str) -> None:
    if word is not None and word not in known:
        hint = like(word, known) or f"; expected one of {', '.join(sorted(known))}"
        raise UserError(f"{word!r} is not {what}{hint}")
