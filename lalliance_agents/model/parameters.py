"""The parameters of L-ALLIANCE: one frozen record, each field with its default, unit and meaning.

A mission file names only what it changes. What depends on another value (boredom on `max_delay`, the collision window on
`broadcast_rate`) is left `None` and follows that value through the properties in the lower half. Checks that need one
record alone are made here when it is built; checks between robots are made where the whole mission is known.

`Erratum` lists the places where the Appendix, taken literally, does not work. Each can be read literally or mended; the
mended reading is the default, but for `SECOND_PATIENCE`.
"""

from enum import IntEnum, StrEnum
from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, WithJsonSchema, model_validator

#: Slack of every comparison of two instants or two times, in seconds (erratum 7).
SLACK = 1e-9

#: How much before a change it foresees a robot wants to be woken, in seconds: far more than rounding, far less than a step.
EARLY = 1e-6

Strategy = IntEnum("Strategy", "I II III")
Strategy.__doc__ = """Who is trusted (Table 1): I distrust teammates, II let the best robot win, III fighting chance."""


class Ordering(IntEnum):
    """In which order a robot prefers free tasks (section 3.3.3 and the Appendix)."""

    DERIVED = 1
    MODIFIED_SHORTEST_FIRST = 2
    MODIFIED_RANDOM = 3
    LONGEST_FIRST = 4


class Learning(StrEnum):
    """The control phase (section 3.3.2): exploring on a training mission, or working on a live one."""

    ACTIVE = "active"
    ADAPTIVE = "adaptive"


class Architecture(StrEnum):
    """L-ALLIANCE, or its predecessor ALLIANCE with parameters set by hand and nothing learned."""

    L_ALLIANCE = "l-alliance"
    ALLIANCE = "alliance"


class Reading(StrEnum):
    """How a doubtful place of the Appendix is read."""

    LITERAL = "literal"
    MENDED = "mended"


class Erratum(StrEnum):
    """Places where the Appendix, taken literally, does not work; each can be read literally or mended."""

    # Below, for each place: the literal text -> the mended reading.

    #: 1. The learned influence also gates the active set -> only inactive sets.
    INFLUENCE_ON_ACTIVE = "influence_on_active"
    #: 2. The impatience reset also strikes the active set -> only inactive sets.
    RESET_ON_ACTIVE = "reset_on_active"
    #: 3. The robot itself is not among those present -> it is, in every minimum.
    SELF_PRESENCE = "self_presence"
    #: 4. Idle robots send nothing -> heartbeats, and motivation waits for the roster or one tau.
    IDLE_HEARTBEAT = "idle_heartbeat"
    #: 5. Several sets may activate in one step -> at most one is active.
    ONE_ACTIVE = "one_active"
    #: 6. Learning impatience looks back to the start -> one tau.
    LEARNING_WINDOW = "learning_window"
    #: 7. Windows are open at both ends -> (t1, t2], with slack.
    WINDOW_ENDS = "window_ends"
    #: 8. The minimum of the slow rates is over all robots once one qualifies -> over those that qualify.
    SLOWEST_OF_WHOM = "slowest_of_whom"
    #: 9. A robot with one behaviour set gets bored while working -> boredom is 0 while a set is active.
    BOREDOM_AT_WORK = "boredom_at_work"
    #: 10. Unknown times are undefined, and so is what is computed from them -> they are replaced or left out.
    UNKNOWN_TIMES = "unknown_times"
    #: 11. Nothing limits an attempt without contender -> lambda is a multiple of the own time.
    GIVE_UP_RULE = "give_up_rule"
    #: 12. Strategy I has no formula (the literal reading refuses it) -> own time (Table 1).
    STRATEGY_ONE = "strategy_one"
    #: 13. A failed attempt leaves no trace -> it raises the task time until enough real samples follow.
    FAILED_ATTEMPTS = "failed_attempts"
    #: 14. Whoever is on the task at its end is credited -> only an attempt that was the task's first.
    CREDIT = "credit"
    #: 15. Two robots that start together both go on -> the one expected to be slower yields at once.
    COLLISION = "collision"
    #: 16. A second attempt gets no patience (the default) -> patience counts from the current attempt.
    SECOND_PATIENCE = "second_patience"
    #: 17. A teammate at work on what the robot cannot do is not heard, and so not present -> it is heard, as if idle.
    HEARD_ELSEWHERE = "heard_elsewhere"

    @property
    def default(self) -> Reading:
        """The reading in force where a mission says nothing."""
        return Reading.LITERAL if self is Erratum.SECOND_PATIENCE else Reading.MENDED


def _by_name(kind: type[IntEnum]) -> Any:
    """An annotation that reads and writes members of `kind` by their name in lower case (`II` stays as it is)."""
    names = {(member.name if kind is Strategy else member.name.lower()): member for member in kind}

    def parse(value: object) -> object:
        if isinstance(value, kind):
            return value
        if isinstance(value, str) and value in names:
            return names[value]
        raise ValueError(f"expected one of {', '.join(names)}")

    spelled = {member: name for name, member in names.items()}
    return (
        BeforeValidator(parse),
        PlainSerializer(spelled.__getitem__, return_type=str),
        WithJsonSchema({"type": "string", "enum": list(names)}),
    )


StrategyField = Annotated[Strategy, *_by_name(Strategy)]
OrderingField = Annotated[Ordering, *_by_name(Ordering)]
#: Largest number that a mission may give for a time, a rate or a level: larger ones lose their fractions.
LARGEST = 1e9
Positive = Annotated[float, Field(gt=0, le=LARGEST, strict=True, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST, strict=True, allow_inf_nan=False)]


class Record(BaseModel):
    """A frozen record that refuses fields it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class HandSet(Record):
    """The parameters of one behaviour set of ALLIANCE, set by hand because nothing is learned."""

    patience: Positive = 20.0
    """phi: how long a teammate's messages hold this robot back, in seconds."""
    slow_rate: Positive = 0.05
    """delta_slow: growth of the motivation while a teammate is on the task, in motivation per second."""
    fast_rate: Positive = 1.0
    """delta_fast: growth of the motivation while nobody is on the task, in motivation per second."""
    yield_time: Positive = 20.0
    """psi: activity after which the task is yielded to a contender, in seconds."""
    give_up_time: Positive = 40.0
    """lambda: activity after which the task is given up in any case, in seconds."""


class Parameters(Record):
    """All that shapes one robot's motivations. Times in seconds of mission time, rates per second."""

    architecture: Architecture = Architecture.L_ALLIANCE
    """`l-alliance`, or `alliance`: the same motivations with `by_hand` in the place of everything learned."""
    strategy: StrategyField = Strategy.II
    """Impatience and acquiescence after Table 1: I goes by the own time alone, II holds each robot to the best one's time,
    III gives each teammate the time that it needs."""
    ordering: OrderingField = Ordering.DERIVED
    """Which free tasks come first; `derived`: of those that the robot does best the longest, of the others the shortest."""
    threshold: Positive = 1.0
    """theta: a behaviour set activates when its motivation reaches this value, in motivation. Learned rates are shares of it,
    so that only the rates set `by_hand` feel a change."""
    broadcast_rate: Positive = 5.0
    """rho: how often a robot announces what it is on, in messages per second. More of them survive losses, and load the bus."""
    silence_timeout: Positive = 1.0
    """tau: silence after which a teammate is taken to have ceased, in seconds. Must exceed 2/rho. A longer one finds failures
    later, and is deceived less often by lost messages."""
    trials: Annotated[int, Field(ge=1, le=10_000)] = 10
    """mu: what a monitor keeps for each robot and task, in attempts. With fewer, what has changed is learned sooner."""
    min_delay: Positive = 0.2
    """Shortest delay before a free task is taken, in seconds."""
    max_delay: Positive = 1.0
    """Longest delay before a free task is taken, in seconds. A longer one keeps the order of preference apart from the chances
    of messages and steps, and has robots wait; 4 % of a task's time is about right."""
    boredom_threshold: Positive = 1.0
    """Boredom at which a robot stops leaving tasks to better teammates. With the default rate it changes nothing."""
    boredom_rate: Positive | None = None
    """Growth of boredom while no set is active, per second; default: boredom_threshold / (1.2 max_delay). A slower one waits
    longer for better teammates."""
    give_up_factor: Positive = 2.0
    """lambda as a multiple of the robot's own task time. With less, stuck robots leave sooner, and slow ones in vain."""
    failure_factor: Positive = 2.0
    """A failed attempt counts as this multiple of the time spent on it (erratum 13). With more, the robot leaves the task to
    others for longer."""
    collision_window: NotNegative | None = None
    """Starts closer than this are a collision (erratum 15), in seconds; default: 2/rho."""
    initial_task_time: Positive = 30.0
    """Own task time while nothing at all is known, in seconds."""
    by_hand: HandSet = HandSet()
    """ALLIANCE only: the parameters of each behaviour set not named in `by_hand_tasks`."""
    by_hand_tasks: dict[str, HandSet] = {}
    """ALLIANCE only: per task, the parameters of that behaviour set."""
    readings: dict[Erratum, Reading] = {}
    """Errata to be read otherwise than by default."""

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if self.max_delay < self.min_delay:
            raise ValueError(f"max_delay {self.max_delay:g} s is below min_delay {self.min_delay:g} s")
        bored_after = self.boredom_threshold / self.effective_boredom_rate
        if self.architecture is Architecture.L_ALLIANCE and bored_after <= self.max_delay:
            raise ValueError(
                f"boredom reaches its threshold after {bored_after:g} s, which must be longer than max_delay "
                f"{self.max_delay:g} s, or robots take tasks for which a teammate is better"
            )
        if self.silence_timeout <= 2 / self.broadcast_rate:
            raise ValueError(
                f"silence_timeout {self.silence_timeout:g} s must be longer than two broadcast periods, "
                f"2/broadcast_rate = {2 / self.broadcast_rate:g} s, or a single lost message looks like a failure"
            )
        if self.strategy is Strategy.I and self.is_literal(Erratum.STRATEGY_ONE):
            raise ValueError("strategy I has no formula in the Appendix: it needs strategy_one: mended")
        return self

    def is_literal(self, erratum: Erratum) -> bool:
        """Whether the doubtful place `erratum` is read as the Appendix says it."""
        return self.readings.get(erratum, erratum.default) is Reading.LITERAL

    def for_set(self, task: str) -> HandSet:
        """The parameters set by hand for the behaviour set of `task` (ALLIANCE)."""
        return self.by_hand_tasks.get(task, self.by_hand)

    @property
    def effective_boredom_rate(self) -> float:
        """Growth of boredom, per second."""
        if self.boredom_rate is not None:
            return self.boredom_rate
        return self.boredom_threshold / (1.2 * self.max_delay)

    @property
    def effective_collision_window(self) -> float:
        """Starts closer than this are a collision, in seconds."""
        return 2 / self.broadcast_rate if self.collision_window is None else self.collision_window

    @property
    def broadcast_period(self) -> float:
        """Time between two announcements, in seconds."""
        return 1 / self.broadcast_rate
