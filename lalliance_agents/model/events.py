"""What goes into the model and what comes out of it.

Events are what a robot perceives; commands are what its body and its radio are to do. All are small frozen records; the
driver (the asyncio agent or the simulator) makes the first and performs the second. Instants are the robot's own mission
time, lengths are in seconds.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from lalliance_agents.model.parameters import Learning, Parameters


@dataclass(frozen=True, slots=True)
class TrialStarted:
    """A trial of the mission begins: everything is forgotten but what the monitors have learned."""

    learning: Learning


@dataclass(frozen=True, slots=True)
class RosterKnown:
    """The teammates that share a task with this robot and are expected to be heard at the start."""

    robots: frozenset[str]


@dataclass(frozen=True, slots=True)
class Sensed:
    """Sensory feedback on one task."""

    task: str
    applicable: bool
    complete: bool


@dataclass(frozen=True, slots=True)
class Heard:
    """A message of a teammate: on `task` since `active_for` seconds, or idle."""

    robot: str
    task: str | None = None
    active_for: float = 0.0
    expected: float = 0.0
    """The time that the teammate itself expects to need for the task, in seconds."""


@dataclass(frozen=True, slots=True)
class BodyFailed:
    """The robot's own code for `task` ended with an error: a failed attempt."""

    task: str


Event = TrialStarted | RosterKnown | Sensed | Heard | BodyFailed


class Verb(StrEnum):
    """What a robot decided about a behaviour set."""

    ACTIVATE = "activate"
    YIELD = "yield"
    GIVE_UP = "give_up"
    COMPLETE = "complete"
    DROP = "drop"


class Cause(StrEnum):
    """Why it decided so."""

    FREE = "free"  # activate: no teammate was known to have been on the task
    SILENCE = "silence"  # activate: the teammate that was on it is silent for more than tau
    IMPATIENCE = "impatience"  # activate: a teammate is still on it, and patience has ended
    RELEASED = "released"  # activate: the teammate that was on it is heard elsewhere
    CONTENDER = "contender"  # yield: active for more than psi, and a contender is heard
    COLLISION = "collision"  # yield: a teammate started at the same time and expects to be faster
    NO_SUCCESS = "no_success"  # give up: active for more than lambda
    SENSED = "sensed"  # complete: sensory feedback says so
    INAPPLICABLE = "inapplicable"  # drop: sensory feedback says the set does not apply just now
    BODY_FAILED = "body_failed"  # drop: the robot's own code ended with an error
    NEW_TRIAL = "new_trial"  # drop: the next trial began
    RESET = "reset"  # drop: erratum 2, literal
    NOT_BEST = "not_best"  # drop: erratum 1, literal
    SUPPRESSED = "suppressed"  # drop: erratum 5, literal

    @property
    def verb(self) -> Verb:
        """What is decided for this cause."""
        return Verb.ACTIVATE if self in OCCASIONS else _VERBS.get(self, Verb.DROP)

    @property
    def is_blameless(self) -> bool:
        """Whether an attempt that ends for this cause has not failed."""
        return self in _BLAMELESS


#: Why a set starts: the first where no teammate was heard on the task in this trial.
OCCASIONS = (Cause.FREE, Cause.IMPATIENCE, Cause.RELEASED, Cause.SILENCE)

#: Why a set stops by itself: of several reasons the first counts.
REASONS_TO_STOP = (
    Cause.SENSED,
    Cause.INAPPLICABLE,
    Cause.BODY_FAILED,
    Cause.COLLISION,
    Cause.CONTENDER,
    Cause.NO_SUCCESS,
    Cause.RESET,
    Cause.NOT_BEST,
    Cause.SUPPRESSED,
)

_VERBS = {
    Cause.SENSED: Verb.COMPLETE,
    Cause.COLLISION: Verb.YIELD,
    Cause.CONTENDER: Verb.YIELD,
    Cause.NO_SUCCESS: Verb.GIVE_UP,
}

_BLAMELESS = {Cause.COLLISION, Cause.INAPPLICABLE, Cause.NEW_TRIAL, Cause.NOT_BEST, Cause.SUPPRESSED}


class Pace(StrEnum):
    """Which rate a motivation grows with."""

    FAST = "fast"  # delta_fast: nobody is on the task, or patience has ended
    SLOW = "slow"  # delta_slow: a teammate on the task holds this robot back
    RANDOM = "random"  # the active learning phase
    WAITING = "waiting"  # erratum 4: the roster has not been heard yet
    WORKING = "working"  # the set is active
    UNDEFINED = "undefined"  # erratum 10, literal: a task time is not known


class Factors(NamedTuple):
    """What produced one motivation at one instant."""

    motivation: float
    pace: Pace
    rate: float
    """Growth, in motivation per second."""
    delay: float
    """theta / delta_fast, in seconds."""
    category: int
    own_time: float
    """task_time_i(i, j, t), in seconds."""
    best_time: float
    """The least task time of the robots present, in seconds; infinite if none is known."""
    boredom: float
    sensory_feedback: int
    activity_suppression: int
    impatience_reset: int
    """In the active learning phase: `learning_impatience`."""
    acquiescence: int
    learned_robot_influence: int
    psi: float
    lambda_: float

    @property
    def is_open(self) -> bool:
        """Whether no factor of the product is 0."""
        return (
            self.sensory_feedback == 1
            and self.activity_suppression == 1
            and self.impatience_reset == 1
            and self.acquiescence == 1
            and self.learned_robot_influence == 1
        )

    def having(self, motivation: float) -> "Factors":
        """The same factors with the motivation that they produced."""
        return Factors._make((motivation, *self[1:]))


class Teammate(NamedTuple):
    """What was known, at a decision, of one teammate that had been heard on the task."""

    robot: str
    first_heard: float
    last_heard: float
    lapsed_at: float | None
    """When the robot noticed that it is not heard on the task any more; None if it is."""
    present: bool
    """Whether it was heard at all within tau."""
    patience: float
    """phi_ij(k, t), in seconds."""
    task_time: float | None
    """task_time_i(k, j, t), in seconds; None if unknown."""
    silent_for: float
    """Since when it was not heard at all, in seconds."""
    started: float
    """When its latest attempt began, by its own account."""
    expected: float
    """The time that it announced to need, in seconds."""


class Terms(NamedTuple):
    """The parameters that decide what the factors lead to, so that a decision can be understood by itself."""

    architecture: str
    strategy: str
    threshold: float
    """theta."""
    silence_timeout: float
    """tau, in seconds."""
    boredom_threshold: float
    give_up_factor: float
    collision_window: float
    """In seconds."""

    @classmethod
    def of(cls, parameters: Parameters) -> "Terms":
        """Those of a robot with `parameters`."""
        return cls(
            parameters.architecture.value,
            parameters.strategy.name,
            parameters.threshold,
            parameters.silence_timeout,
            parameters.boredom_threshold,
            parameters.give_up_factor,
            parameters.effective_collision_window,
        )


@dataclass(frozen=True, slots=True)
class Decision:
    """One decision and everything behind it."""

    at: float
    verb: Verb
    task: str
    cause: Cause
    factors: Factors
    teammates: tuple[Teammate, ...]
    """Those heard on the task in this trial, the last one heard first."""
    terms: Terms
    active_for: float = 0.0
    """How long the set had been active, in seconds."""
    other: str | None = None
    """The teammate that the cause speaks of: taken over from, or yielded to."""
    grown_for: float = 0.0
    """Activate: how long the motivation has grown from 0, in seconds; 0 where it does not grow steadily."""
    expected: float = 0.0
    """The time that the robot announces to need for this attempt, in seconds."""


@dataclass(frozen=True, slots=True)
class Activate:
    """Start to perform the behaviour set of `decision.task`."""

    decision: Decision


@dataclass(frozen=True, slots=True)
class Deactivate:
    """Stop performing the behaviour set of `decision.task`."""

    decision: Decision


@dataclass(frozen=True, slots=True)
class Announce:
    """Broadcast the current activity, or a heartbeat if `task` is None."""

    task: str | None
    active_for: float = 0.0
    expected: float = 0.0


Command = Activate | Deactivate | Announce
