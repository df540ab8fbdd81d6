"""The messages: msgpack maps with a header, each checked completely when it is decoded.

The header says which version of this schema the sender speaks, who it is, which life of it this is (`incarnation`: a
restarted robot is not its ghost), and where in that life (`seq`). `at` is the sender's own mission time and informative:
nothing compares the clocks of two machines. Fields that a receiver does not know are ignored, so that fields can be added;
any other change is a new version. Whatever bytes come in, `decode` returns a checked message or raises `MessageError`, whose
text is one short line; telling what is wrong with a large message takes hardly longer than reading a right one, and what a
message claims to hold takes no room before it is there.
"""

from collections.abc import Callable
from typing import Annotated, Any, Literal, TypeVar

import msgpack
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import NAME_PATTERN, SENDER_PATTERN, Key, Kind

VERSION: Literal[1] = 1

#: Larger messages are dropped unread, in bytes: room for the report on a thousand teammates.
MAX_PAYLOAD = 160 * 1024

Name = Annotated[str, Field(pattern=NAME_PATTERN)]
Sender = Annotated[str, Field(pattern=SENDER_PATTERN)]
Count = Annotated[int, Field(ge=0, lt=2**63)]
#: The longest time that can be said, in seconds.
LONGEST = 1e12
Seconds = Annotated[float, Field(ge=0, le=LONGEST)]
#: Letters that a word may have.
LONGEST_WORD = 40
Word = Annotated[str, Field(max_length=LONGEST_WORD)]
#: Letters that a line of text may have.
LONGEST_LINE = 500
#: Letters that a fault in a command may have.
LONGEST_FAULT = 2000
Line = Annotated[str, Field(max_length=LONGEST_LINE)]
#: Belongs to every list and every map in a message: to spell out all the faults of a large one takes very long.
FIRST_FAULT = Field(fail_fast=True)
Scalars = Annotated[dict[str, str | int | float | bool | None], FIRST_FAULT]


class Message(BaseModel):
    """The header that every message begins with."""

    model_config = ConfigDict(
        frozen=True, strict=True, extra="ignore", allow_inf_nan=False, use_attribute_docstrings=True
    )

    v: Literal[1] = VERSION
    sender: Sender
    incarnation: Count
    seq: Count
    at: Seconds


class Activity(Message):
    """A robot is on a task."""

    task: Name
    trial: Count
    active_for: Seconds
    """How long its set has been active, in seconds."""
    expected: Seconds
    """The time that it expects to need, in seconds."""


class Heartbeat(Message):
    """A robot is there, and idle."""

    trial: Count


class Hello(Message):
    """The tasks a robot can do; used only to choose whom to listen to."""

    tasks: Annotated[list[Name], FIRST_FAULT]


class Action(Message):
    """What a robot's body works on."""

    task: Name | None
    trial: Count
    fewest: Count
    """The smallest number of samples that its monitors hold of any teammate it knows for any task they share."""


class TaskState(Message):
    """Sensory feedback on one task."""

    trial: Count
    learning: Literal["active", "adaptive"]
    applicable: bool
    complete: bool
    progress: Annotated[float, Field(ge=0, le=1)]


class BodyState(Message):
    """What a robot can sense of itself, and of the mission."""

    mission: Literal["waiting", "running", "complete", "failed"]
    trial: Count
    learning: Literal["active", "adaptive"]
    elapsed: Seconds | None = None
    """Time since the trial began, in seconds; informative."""
    failures: Annotated[list[str], FIRST_FAULT] = []


class DecisionMade(Message):
    """One decision with everything behind it; see `lalliance_agents.model.events.Decision`."""

    verb: Word
    task: Name
    cause: Word
    other: Name | None
    active_for: Seconds
    trial: Count
    elapsed: Seconds | None = None
    """Time since the trial began, in seconds, as the world told the robot; None if nobody did."""
    grown_for: Seconds = 0.0
    """Activate: how long the motivation had grown from 0, in seconds; 0 where it does not grow steadily."""
    expected: Seconds = 0.0
    """The time that the robot announced to need, in seconds."""
    factors: Scalars
    teammates: Annotated[list[Scalars], FIRST_FAULT]
    terms: Scalars = {}
    """The parameters that decide what the factors lead to."""


class Motivations(Message):
    """All motivations of a robot, each with its factors."""

    active: Annotated[list[Name], FIRST_FAULT]
    sets: Annotated[dict[Name, Scalars], FIRST_FAULT]


class Reception(BaseModel):
    """What came from one teammate."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    received: Count
    silence: Seconds | None = None
    """Time since the last message, in seconds."""
    lapses: Count = 0
    """How often the teammate was found silent for tau in this trial."""
    lost_for: Seconds | None = None
    """How long ago that was noticed, in seconds; None while the teammate is heard."""


class Effect(BaseModel):
    """What one fault did to the messages that came from one teammate, or from the world."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore")

    fault: Word
    sender: Sender
    count: Count
    """Messages that were lost, delayed, doubled, reordered or held back."""


class Drop(BaseModel):
    """Messages of one sender that were not used, for one reason."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore")

    sender: Sender
    reason: Word
    count: Count


class LinkReport(Message):
    """What a robot sent and received, and whether it kept its control period."""

    sent: Count
    received: Count
    dropped: Annotated[dict[str, Count], FIRST_FAULT]
    """Messages not used, by reason."""
    drops: Annotated[list[Drop], FIRST_FAULT] = []
    """Those of them that are dropped whatever faults there are, by sender and reason."""
    teammates: Annotated[dict[Name, Reception], FIRST_FAULT]
    effects: Annotated[list[Effect], FIRST_FAULT] = []
    """What faults did to messages on their arrival here."""
    ticks: Count
    missed: Count
    """Control periods that passed without a control step since the mission began."""
    final: bool = False


class Event(Message):
    """Something happened in the world."""

    kind: Word
    robot: Name | None = None
    task: Name | None = None
    elapsed: Seconds
    """Time since the trial began, in seconds."""
    trial: Count
    text: Line
    details: Scalars = {}


class Status(Message):
    """How the mission stands."""

    mission: Literal["waiting", "running", "complete", "failed"]
    trial: Count
    trials: Count
    learning: Literal["active", "adaptive"]
    elapsed: Seconds
    tasks: Annotated[dict[Name, Scalars], FIRST_FAULT]
    robots: Annotated[dict[Name, Scalars], FIRST_FAULT]


Globs = Annotated[list[Annotated[str, Field(max_length=64)]], FIRST_FAULT]
Share = Annotated[float, Field(ge=0, le=1)]


class LinkRule(BaseModel):
    """A link rule in force; `lalliance_agents.faults` has the forms in which people write it."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    fault: Word
    """The fault that it belongs to."""
    senders: Globs
    receivers: Globs
    cut: bool = False
    loss: Share = 0.0
    """Probability of loss; where there are bursts, outside of them."""
    burst_loss: Share = 0.0
    burst_enter: Share = 0.0
    """Probability that a burst begins with a message; 0: there are no bursts."""
    burst_leave: Share = 1.0
    delay: Literal["none", "constant", "uniform", "lognormal"] = "none"
    delay_by: Seconds = 0.0
    delay_to: Seconds = 0.0
    """Constant: the delay, twice; uniform: shortest and longest; lognormal: median, and sigma of the logarithm."""
    duplicate: Share = 0.0
    reorder: Share = 0.0
    held: Seconds = 0.0


class Blindness(BaseModel):
    """A robot whose sensory feedback is held back."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    fault: Word
    robot: Name
    delay: Seconds | None = None
    """How late it comes, in seconds; None: not at all."""


class ChaosRules(Message):
    """All that is in force of faults made where messages arrive."""

    seed: Count
    rules: Annotated[list[LinkRule], FIRST_FAULT] = []
    blind: Annotated[list[Blindness], FIRST_FAULT] = []


class ChaosCommand(Message):
    """What an operator asks of the world."""

    verb: Literal["inject", "heal", "status"]
    fault: str = Field(default="", max_length=LONGEST_FAULT)
    """inject: the fault as JSON, in the fields of a mission file; `at` is the present instant."""
    lasts: Seconds | None = None
    """inject: how long it is in force, in seconds; None: what the fault itself says."""
    name: Word = ""
    """heal: which fault; empty: all."""


class ChaosAnswer(Message):
    """What the world says to a command."""

    done: bool
    text: Line
    faults: Annotated[list[Scalars], FIRST_FAULT] = []
    """Every fault of the mission, in the words of the summary."""


class DeedDone(Message):
    """An order of the world was carried out at a process."""

    number: Count
    """The order's."""


BODY_OF: dict[Kind, type[Message]] = {
    Kind.ACTIVITY: Activity,
    Kind.HEARTBEAT: Heartbeat,
    Kind.HELLO: Hello,
    Kind.ACTION: Action,
    Kind.SENSE_TASK: TaskState,
    Kind.SENSE_ROBOT: BodyState,
    Kind.DECISION: DecisionMade,
    Kind.MOTIVATION: Motivations,
    Kind.LINK: LinkReport,
    Kind.EVENT: Event,
    Kind.STATUS: Status,
    Kind.CHAOS_RULES: ChaosRules,
    Kind.CHAOS_COMMAND: ChaosCommand,
    Kind.CHAOS_DEED: DeedDone,
}

M = TypeVar("M", bound=Message)
#: Decodes what came on a key, as `decode_at` does.
Decoder = Callable[[Key, bytes], Message]


def encode(message: Message) -> bytes:
    """Pack a message."""
    packed: bytes = msgpack.packb(message.model_dump())
    return packed


def decode(kind: type[M], payload: bytes) -> M:
    """Unpack and check a message.

    Raises:
        MessageError: the payload is too large, no msgpack, of another version, or not a valid `kind`; nothing else.
    """
    if len(payload) > MAX_PAYLOAD:
        raise MessageError("size", f"{len(payload)} bytes, more than {MAX_PAYLOAD}")
    document = _unpack(payload)
    if not isinstance(document, dict):
        raise MessageError("form", "not a map")
    if document.get("v") != VERSION:
        raise MessageError("version", f"not version {VERSION}")
    try:
        return kind.model_validate(document)
    except ValidationError as error:
        raise MessageError("content", _first_fault(error)) from None


def _first_fault(error: ValidationError) -> str:
    first = error.errors(include_url=False, include_input=False)[0]
    # A place can hold any text that came as a key of a map, and each letter of it can take ten when it is spelled out.
    where = ".".join(str(part) for part in first["loc"])[:80]
    return f"{(where if where.isprintable() else repr(where))[:80]}: {first['type']}"


#: Up to this size, in bytes, the worst that a payload can claim is a megabyte.
_SHORT = 512


def _unpack(payload: bytes) -> Any:
    try:
        if len(payload) > _SHORT:
            _walk(payload)
        return msgpack.unpackb(payload)
    except Exception as error:
        raise MessageError("msgpack", type(error).__name__) from None


def _walk(payload: bytes) -> None:
    """Go through a document and keep nothing, so that only a whole one is unpacked.

    For a list msgpack makes room as soon as its length is claimed: a thousand lists in one another, each of a length that
    the payload might just hold, cost up to a gigabyte. In a whole document all lengths together fit into the payload. What is
    short cannot claim as much, and most messages are.
    """
    walker = msgpack.Unpacker(read_size=1)
    walker.feed(payload)
    walker.skip()


def decode_at(key: Key, payload: bytes) -> Message:
    """Decode what came on `key`, and hold its sender and task against the key.

    Raises:
        MessageError: it does not decode, or somebody speaks for another.
    """
    body = BODY_OF.get(key.kind)
    if body is None:
        raise MessageError("key", f"{key.kind.name} carries no message")
    message = decode(body, payload)
    if message.sender != key.speaker:
        raise MessageError("sender", f"{message.sender} on a key of {key.speaker}")
    if isinstance(message, Activity) and message.task != key.task:
        raise MessageError("task", f"{message.task} on a key of {key.task}")
    return message
