"""One behaviour set's motivation as it grows: a ramp, and what the set is doing.

The Appendix adds the impatience of each step to the motivation of the step before. As long as the rate stays the same
that sum is a straight line, so a set holds the value at which its present rate began, that instant, and the rate; its
value at any later step follows without having taken the steps between. A driver that skips steps in which nothing
changes gets the same numbers, to the last bit, as one that takes them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from lalliance_agents.model.events import Factors


@dataclass(slots=True)
class Expectation:
    """What a robot expects of a task, as long as nobody comes or goes, starts or ceases, and nothing is learned."""

    learned: int
    """The version of the knowledge behind it."""
    present: Sequence[str]
    """The teammates present."""
    contended: bool
    """Whether a teammate is on the task."""
    own_time: float
    """task_time_i(i, j, t), in seconds."""
    best_time: float
    """The least task time of the robots present, in seconds."""
    category: int
    fast: float
    """delta_fast, in motivation per second."""
    psi: float
    lambda_: float
    held: dict[str, tuple[float, float]] = field(default_factory=dict)
    """phi in seconds and delta_slow, of each teammate that was asked for."""


@dataclass(slots=True)
class Motivation:
    """The state of one behaviour set a_ij. Instants are the robot's own, rates per second."""

    task: str
    draw: float
    """A number in [0, 1), fixed for the trial: the place of the task in a random order."""
    base: float = 0.0
    since: float = 0.0
    rate: float = 0.0
    rose_at: float = 0.0
    """The step from which on it has last grown from 0."""
    active_since: float | None = None
    expected: float = 0.0
    """The own time announced for the current attempt, in seconds (erratum 15)."""
    applicable: bool = False
    complete: bool = False
    body_failed: bool = False
    expectation: Expectation | None = None
    """What was last expected of the task."""
    factors: Factors | None = None
    """What produced the motivation at the last step."""

    def value(self, now: float) -> float:
        """m_ij(now)."""
        return self.base + self.rate * (now - self.since)

    def grow(self, rate: float, before: float) -> None:
        """Grow at `rate` from the step `before` on."""
        if rate != self.rate:
            if self.base == self.rate == 0.0:
                self.rose_at = before
            self.base, self.since, self.rate = self.value(before), before, rate

    def hold(self, value: float, now: float) -> None:
        """Stay at `value`."""
        self.base, self.since, self.rate = value, now, 0.0

    def keep_down(self, now: float) -> None:
        """Be 0, as another set is active or the behaviour does not apply; the other factors are not looked at."""
        self.hold(0.0, now)
        self.factors = None

    def activate(self, now: float, expected: float) -> None:
        """Become the robot's active set; the value is kept while it is."""
        self.active_since = now
        self.expected = expected
        self.hold(self.value(now), now)

    def deactivate(self, now: float) -> None:
        """Cease to be active, and begin anew from 0."""
        self.active_since = None
        self.body_failed = False
        self.hold(0.0, now)

    def active_for(self, now: float) -> float:
        """How long the set has been active, in seconds; 0 if it is not."""
        return 0.0 if self.active_since is None else now - self.active_since

    @property
    def active(self) -> bool:
        """Whether the set is active."""
        return self.active_since is not None

    @property
    def sensory_feedback(self) -> int:
        """sensory_feedback_ij(t): 1 where the behaviour applies."""
        return 1 if self.applicable and not self.complete else 0
