"""What an environment is: the part of the world that knows tasks and how work on them advances.

An environment is pure. It is stepped with the length of time that passed and with what each working body does, and it is
asked what the tasks look like. It knows nothing of messages, failures or learning: a failed body simply does not appear
among the actions, and a slow one appears with a smaller pace. One instance lives for one trial.

Steps are also the only way an environment hears of attempts. A robot that works on the same task in two steps that follow
each other is on one attempt; one that was missing from a step, or worked on something else in it, starts a new attempt.
A step may last 0 seconds: it tells of an interruption that began and ended between two other steps.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from lalliance_agents.config import Mission
from lalliance_agents.model.parameters import SLACK, Record


@dataclass(frozen=True, slots=True)
class Work:
    """What one body does during a step."""

    task: str
    pace: float = 1.0
    """1 is the robot's own speed; a slowed body works with less, a stuck one with 0."""

    def __post_init__(self) -> None:
        if not 0 <= self.pace < math.inf:
            raise ValueError(f"pace {self.pace!r} must be a finite number of 0 or more")


class TaskView(NamedTuple):
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


class Environment(ABC):
    """The tasks of one trial."""

    Options: ClassVar[type[Record]] = Record
    """What a mission may say of this environment besides its `kind`; a subclass names its own record."""

    @classmethod
    def check(cls, mission: Mission) -> None:
        """Refuse a mission that this environment cannot be built from; called once, before any instance is made.

        A subclass adds what it asks of the whole mission.

        Raises:
            pydantic.ValidationError: an option is wrong; places are counted from `environment`, as fields of `Options`.
            pydantic_core.PydanticCustomError: another part of the mission does not fit (`misplaced`); its path is counted
                from the mission's root.
        """
        cls.Options.model_validate(mission.environment.options)

    @abstractmethod
    def __init__(self, mission: Mission, *, seed: int) -> None:
        """Set up a fresh trial of a `mission` that passed `check`; all randomness comes from `seed`."""

    @abstractmethod
    def step(self, dt: float, actions: Mapping[str, Work]) -> Sequence[Completion]:
        """Let `dt` seconds pass while each robot in `actions` works; completions in order of `after`.

        The result does not depend on how a span of time is cut into steps, but for rounding, as long as the actions stay
        the same: what ends within a step ends exactly there, and what becomes possible by that is worked on from there.
        A robot that works on a task it cannot do, or on one that is complete or not applicable, achieves nothing.

        Raises:
            ValueError: `dt` is negative or not finite.
        """

    @abstractmethod
    def next_change(self, actions: Mapping[str, Work]) -> float:
        """How long until a task is completed or becomes (not) applicable if `actions` stay the same, in seconds.

        Counted from when they are taken up, which itself can change what is applicable. At most that long, where the
        environment has other reasons to look again; `math.inf` if nothing will change. This is a question only: no
        attempt begins or ends by it.
        """

    @abstractmethod
    def sense(self) -> Mapping[str, TaskView]:
        """What every task of the mission looks like now, in the mission's order."""

    @property
    def is_complete(self) -> bool:
        """Whether every task is complete."""
        return all(view.complete for view in self.sense().values())


class EventDriven(Environment):
    """An environment in which all rates are constant between events, so that a step goes from event to event.

    What is due within `SLACK` seconds happens now: rounding can neither leave a task nearly finished for ever nor finish
    it noticeably early. A subclass promises that `_settle` uses up everything due so soon, and that a finite number of
    events follow from one set of actions; then a step ends.
    """

    def step(self, dt: float, actions: Mapping[str, Work]) -> list[Completion]:
        """See `Environment.step`."""
        if not 0 <= dt < math.inf:
            raise ValueError(f"dt {dt!r} must be a finite number of seconds, 0 or more")
        self._take_up(actions)
        completions: list[Completion] = []
        passed = 0.0
        while (wait := self.next_change(actions)) <= dt - passed + SLACK:
            wait = min(wait, dt - passed)
            self._advance(wait)
            passed = min(passed + wait, dt)
            completions += [Completion(task, by, passed) for task, by in self._settle()]
        self._advance(dt - passed)
        return completions

    @abstractmethod
    def _take_up(self, actions: Mapping[str, Work]) -> None:
        """Let `actions` be in force from now on."""

    @abstractmethod
    def _advance(self, dt: float) -> None:
        """Move everything by `dt` seconds, in which no event lies."""

    @abstractmethod
    def _settle(self) -> list[tuple[str, tuple[str, ...]]]:
        """Let all events happen that are due within `SLACK` seconds; the tasks completed, each with its finishers."""
