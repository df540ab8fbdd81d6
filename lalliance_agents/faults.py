"""Faults as a mission file spells them, and as they are injected into a running mission: of robots, and of links.

A robot's fault changes what its body, its radio or its process does. A link's fault is a rule over the messages that robots
hear of one another; it names pairs of robots by globs (`*`, `?`). Each is in force from `at` until `until`, in seconds after
the live trial's start; without `until`, for good. What can be judged of one fault alone is judged by its record; what
depends on the team and on other faults, in `fault_checks`.
"""

import math
from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from lalliance_agents.errors import exact
from lalliance_agents.model.parameters import NotNegative, Positive, Record
from lalliance_agents.wire.keys import NAME_PATTERN

#: How long a crashed robot stays away if it is to be started again and nothing is said of when, in seconds.
RESTART_AFTER = 5.0

GLOB_PATTERN = r"^[A-Za-z0-9_*?-]{1,64}$"

Name = Annotated[str, Field(pattern=NAME_PATTERN)]
Glob = Annotated[str, Field(pattern=GLOB_PATTERN)]
Globs = Glob | Annotated[tuple[Glob, ...], Field(min_length=1)]
Probability = Annotated[float, Field(ge=0, le=1, strict=True, allow_inf_nan=False)]


class _Timed(Record):
    """A fault with a beginning and perhaps an end."""

    at: NotNegative
    """When it begins, in seconds after the live trial's start."""
    until: Positive | None = None
    """When it ends, in seconds after the live trial's start; default: never."""

    @model_validator(mode="after")
    def _check_until(self) -> Self:
        if self.until is not None and self.until <= self.at:
            raise ValueError(f"until {exact(self.until)} s must come after at {exact(self.at)} s")
        return self

    @property
    def end(self) -> float:
        """When it ends, in seconds after the live trial's start; infinite: never."""
        return math.inf if self.until is None else self.until

    def overlaps(self, other: "Fault") -> bool:
        """Whether both are in force at some instant."""
        return self.at < other.end and other.at < self.end


class Crash(_Timed):
    """A robot's process is killed (SIGKILL)."""

    kind: Literal["crash"]
    """`crash`."""
    robot: Name
    """Whose process."""
    restart: bool = False
    """Whether the process is started again at `until`, with a new incarnation and the learned times it had stored."""

    @model_validator(mode="after")
    def _check_restart(self) -> Self:
        if self.until is not None and not self.restart:
            raise ValueError(f"until {self.until:g} needs restart: true, a crashed robot does not return by itself")
        return self

    @property
    def end(self) -> float:
        """When the process is started again, in seconds after the live trial's start; infinite: never."""
        if not self.restart:
            return math.inf
        return self.at + RESTART_AFTER if self.until is None else self.until


class Hang(_Timed):
    """A robot's process is stopped (SIGSTOP), and continued at `until`."""

    kind: Literal["hang"]
    """`hang`."""
    robot: Name
    """Whose process."""


class Stuck(_Timed):
    """A robot's body makes no progress, while the robot goes on talking and hearing."""

    kind: Literal["stuck"]
    """`stuck`."""
    robot: Name
    """Whose body."""
    task: Name | None = None
    """The one task at which it is stuck; default: at every task."""


class Slow(_Timed):
    """A robot's body works more slowly."""

    kind: Literal["slow"]
    """`slow`."""
    robot: Name
    """Whose body."""
    factor: Annotated[float, Field(gt=1, le=1e6, strict=True, allow_inf_nan=False)]
    """By how much longer it takes."""


class RadioFault(_Timed):
    """A robot is not heard by its teammates (mute), or does not hear them (deaf)."""

    kind: Literal["mute", "deaf"]
    """`mute` or `deaf`."""
    robot: Name
    """Whose radio."""


class Blind(_Timed):
    """A robot's sensory feedback on tasks does not come, or comes late."""

    kind: Literal["blind"]
    """`blind`."""
    robot: Name
    """Whose senses."""
    delay: Positive | None = None
    """How late it comes, in seconds; default: it is held back until the fault ends."""


class Bursts(Record):
    """Loss in bursts: a Gilbert-Elliott chain that takes one step with each message of the link."""

    enter: Annotated[float, Field(gt=0, le=1, strict=True, allow_inf_nan=False)]
    """Probability that a burst begins with the next message."""
    leave: Annotated[float, Field(gt=0, le=1, strict=True, allow_inf_nan=False)]
    """Probability that a burst ends with the next message; 1/leave is its mean length in messages."""
    good: Probability = 0.0
    """Probability of loss outside of bursts."""
    bad: Probability = 1.0
    """Probability of loss in a burst."""


def _check_order(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[1] < pair[0]:
        raise ValueError(f"the second number {exact(pair[1])} s is below the first one {exact(pair[0])} s")
    return pair


class UniformDelay(Record):
    """Delays drawn uniformly."""

    uniform: Annotated[tuple[NotNegative, NotNegative], AfterValidator(_check_order)]
    """Shortest and longest, in seconds."""


class LogNormal(Record):
    """A log-normal distribution of delays."""

    median: Positive
    """What half of the messages exceed, in seconds."""
    sigma: Annotated[float, Field(gt=0, le=5, strict=True, allow_inf_nan=False)]
    """Standard deviation of the logarithm."""


class LogNormalDelay(Record):
    """Delays with a long tail."""

    lognormal: LogNormal
    """The distribution."""


def _written(*, otherwise: str, plain: str = "", **fields: str) -> Discriminator:
    """Tells alternatives apart by a field that is written.

    Args:
        otherwise: the tag of the alternative where no field tells.
        plain: the tag of the alternative that is no mapping, if there is one.
        fields: field -> tag.
    """

    def tag(value: Any) -> str:
        if isinstance(value, dict | Record):
            written = value if isinstance(value, dict) else value.model_fields_set
            return next((tag for field, tag in fields.items() if field in written), otherwise)
        return plain or otherwise

    return Discriminator(tag)


# Tags in angle brackets cannot be taken for fields where an error tells its place.
Loss = Annotated[
    Annotated[Probability, Tag("<share>")] | Annotated[Bursts, Tag("<bursts>")],
    _written(otherwise="<bursts>", plain="<share>"),
]
Delay = Annotated[
    Annotated[NotNegative, Tag("<seconds>")]
    | Annotated[UniformDelay, Tag("<uniform>")]
    | Annotated[LogNormalDelay, Tag("<lognormal>")],
    _written(otherwise="<uniform>", plain="<seconds>", lognormal="<lognormal>"),
]


class Link(Record):
    """The directed links between pairs of robots."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True, serialize_by_alias=True)

    senders: Annotated[Globs, Field(alias="from")] = "*"
    """Senders: a name or a glob, or a list of them."""
    receivers: Annotated[Globs, Field(alias="to")] = "*"
    """Receivers: the same."""
    both: bool = False
    """Whether the rule also holds in the other direction."""


class LinkFault(_Timed):
    """A rule over what robots hear of one another: activity and heartbeats, where they arrive."""

    link: Link
    """Which links."""
    loss: Loss | None = None
    """Share of the messages that are lost, or bursts of loss."""
    delay: Delay | None = None
    """How late they come, in seconds: a number, `{uniform: [a, b]}` or `{lognormal: {median: m, sigma: s}}`."""
    duplicate: Probability | None = None
    """Share of the messages that come twice."""
    reorder: Probability | None = None
    """Share of the messages that are held back, so that later ones overtake them."""
    held: Positive = 0.5
    """How long a reordered message is held back, in seconds."""
    cut: bool = False
    """Whether nothing comes through: a one-way partition, or with `both` a two-way one."""

    @model_validator(mode="after")
    def _check_effect(self) -> Self:
        if not self.cut and not self.aspects():
            raise ValueError("the rule does nothing; expected loss, delay, duplicate, reorder or cut: true")
        return self

    def aspects(self) -> dict[str, Any]:
        """What the rule sets, by name; no two rules set the same aspect of one link at a time."""
        set_here = {name: getattr(self, name) for name in ("loss", "delay", "duplicate", "reorder")}
        return {name: value for name, value in set_here.items() if value is not None}

    def pairs(self) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
        """The globs of senders and receivers."""
        senders, receivers = as_globs(self.link.senders), as_globs(self.link.receivers)
        yield senders, receivers
        if self.link.both:
            yield receivers, senders


class Partition(_Timed):
    """The team falls apart into groups that do not hear one another."""

    partition: Annotated[tuple[Globs, ...], Field(min_length=2)]
    """The groups, each a list of names or globs. Who is in no group hears all and is heard by all."""

    def pairs(self) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
        """The globs of senders and receivers that are cut off from each other."""
        groups = [as_globs(group) for group in self.partition]
        for index, group in enumerate(groups):
            others = tuple(glob for at, other in enumerate(groups) if at != index for glob in other)
            yield group, others


RobotFault = Annotated[Crash | Hang | Stuck | Slow | RadioFault | Blind, Field(discriminator="kind")]
Fault = Crash | Hang | Stuck | Slow | RadioFault | Blind | LinkFault | Partition
AnyFault = Annotated[
    Annotated[RobotFault, Tag("<robot>")]
    | Annotated[LinkFault, Tag("<link>")]
    | Annotated[Partition, Tag("<partition>")],
    _written(otherwise="<robot>", kind="<robot>", link="<link>", partition="<partition>"),
]


def as_globs(globs: Globs) -> tuple[str, ...]:
    """A glob or several, always as several."""
    return (globs,) if isinstance(globs, str) else globs


def fits(name: str, globs: Iterable[str]) -> bool:
    """Whether a robot's name matches one of `globs`."""
    return any(fnmatchcase(name, glob) for glob in globs)


def kind_of(fault: Fault) -> str:
    """What a fault is called in one word: its kind, `link` or `partition`."""
    if isinstance(fault, LinkFault):
        return "link"
    return "partition" if isinstance(fault, Partition) else fault.kind


def robot_of(fault: Fault) -> str | None:
    """The robot whose fault it is; None for a fault of links."""
    return None if isinstance(fault, LinkFault | Partition) else fault.robot


def describe(fault: Fault) -> str:
    """A fault in a few words, without its times."""
    match fault:
        case LinkFault():
            arrow = "between" if fault.link.both else "from"
            ends = [" ".join(as_globs(globs)) for globs in (fault.link.senders, fault.link.receivers)]
            effects = [_effect(name, value) for name, value in fault.aspects().items()] + ["cut"] * fault.cut
            return f"{', '.join(effects)} {arrow} {ends[0]} {'and' if fault.link.both else 'to'} {ends[1]}"
        case Partition():
            return f"partition {' | '.join(' '.join(as_globs(group)) for group in fault.partition)}"
        case Slow():
            return f"slow of {fault.robot} by {fault.factor:g}"
        case Stuck() if fault.task is not None:
            return f"stuck of {fault.robot} at {fault.task}"
        case _:
            return f"{fault.kind} of {fault.robot}"


def _effect(name: str, value: Any) -> str:
    match value:
        case Bursts():
            return f"loss in bursts of {1 / value.leave:.3g} messages"
        case UniformDelay():
            return f"delay {value.uniform[0]:g} to {value.uniform[1]:g} s"
        case LogNormalDelay():
            return f"delay about {value.lognormal.median:g} s"
        case _:
            return f"{name} {value:g} s" if name == "delay" else f"{name} {value:.0%}"
