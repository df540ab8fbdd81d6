"""What an environment is: the part of the world that knows tasks and how work on them advances.

An environment is pure. It is stepped with the length of time that passed and with what each working body does, and it is
asked what the tasks look like. It knows nothing of messages, failures or learning: a failed body simply does not appear
among the actions, and a slow one appears with a smaller pace. One instance lives for one trial.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from lalliance_agents.config import Mission


@dataclass(frozen=True, slots=True)
class Work:
    """What one body does during a step."""

    task: str
    pace: float = 1.0
    """1 is the robot's own speed; a slowed body works with less."""


@dataclass(frozen=True, slots=True)
class TaskView:
    """What can be sensed of one task."""

    complete: bool
    applicable: bool
    """Whether work on it makes sense just now: it has arrived, its prerequisites are done, nothing blocks it."""
    progress: float
    """Share of the work that is done, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Completion:
    """A task that was finished during a step."""

    task: str
    by: tuple[str, ...]
    """The robots whose work finished it, in order of name."""
    after: float
    """Time from the step's beginning to the end of the task, in seconds, 0 <= after <= dt."""


class Environment(Protocol):
    """The tasks of one trial."""

    def __init__(self, mission: Mission, *, seed: int) -> None:
        """Set up a fresh trial; all randomness comes from `seed`."""

    def step(self, dt: float, actions: Mapping[str, Work]) -> Sequence[Completion]:
        """Let `dt` seconds pass while each robot in `actions` works; completions in order of `after`.

        The result does not depend on how a span of time is cut into steps, but for rounding, as long as the actions stay
        the same: what ends within a step ends exactly there, and what becomes possible by that is worked on from there.
        """

    def sense(self) -> Mapping[str, TaskView]:
        """What every task of the mission looks like now."""

    def attempt_ended(self, robot: str, task: str) -> None:
        """`robot` stopped working on the incomplete `task`; where work restarts, its part is lost."""
