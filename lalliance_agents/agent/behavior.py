"""Behaviour sets: where a user's own code meets the robot.

A behaviour set is the robot's way of doing one task. The mind decides when it is active; while it is, `perform` runs as a
task of its own and is cancelled when the robot stops. Sensory feedback comes from the world server unless the set senses for
itself. Whatever a behaviour set raises is held against that attempt, never against the robot.
"""

import asyncio
import importlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from lalliance_agents.errors import BehaviorError


@dataclass(frozen=True, slots=True)
class TaskSense:
    """What is sensed of one task."""

    applicable: bool
    complete: bool
    progress: float
    """Share of the work that is done, 0 to 1."""


class BehaviorSet:
    """What a robot does about one task; subclass it with a `task` of your own.

    Without an override of `perform` the robot's body in the world server does the work; without one of `applicable` and
    `complete` the world server says how the task stands.
    """

    task: str

    def __init__(self, task: str | None = None) -> None:
        if task is not None:
            self.task = task
        self.sensed: TaskSense | None = None
        self.returned = False

    async def perform(self) -> None:
        """Do the task. Runs while the set is active; cancelled when the robot yields, gives up or is done.

        Returning says that there is nothing more to do; the set stays active until the task is sensed complete. An
        exception ends the attempt as failed.
        """
        await asyncio.Event().wait()

    def applicable(self) -> bool:
        """Sensory feedback: whether working on the task makes sense now. Asked at each control step; must not block."""
        return self.sensed is not None and self.sensed.applicable

    def complete(self) -> bool:
        """Sensory feedback: whether the task is done. Asked at each control step; must not block."""
        return self.sensed is not None and self.sensed.complete

    def __repr__(self) -> str:
        return f"<{type(self).__name__} for {getattr(self, 'task', '?')}>"


class AutonomousBehaviorSet(BehaviorSet):
    """A behaviour set for a team without a world server: applicable until `perform` has returned once."""

    def applicable(self) -> bool:
        """Whether `perform` has not returned yet."""
        return not self.returned

    def complete(self) -> bool:
        """Whether `perform` has returned."""
        return self.returned


def described(one: object) -> str:
    """`repr(one)`, or the name of its class where a user's `__repr__` fails."""
    try:
        return repr(one)
    except Exception:
        return f"<{type(one).__name__}>"


def _told(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


Factory = Callable[[], Iterable[BehaviorSet]]


def find_factory(place: str) -> Factory:
    """The factory at `package.module:factory`, found and not yet called.

    Raises:
        BehaviorError: there is none.
    """
    module_name, _, path = place.partition(":")
    try:
        found: Any = importlib.import_module(module_name)
        for name in path.split("."):
            found = getattr(found, name)
    except (Exception, SystemExit) as error:
        raise BehaviorError(
            f"behaviors {place!r} cannot be loaded: {_told(error)}; expected package.module:factory, "
            "importable from the current directory or the installed packages"
        ) from error
    if not callable(found):
        raise BehaviorError(
            f"behaviors {place!r} is {type(found).__name__}, expected a function that returns behaviour sets"
        )
    factory: Factory = found
    return factory


def load_behaviors(place: str) -> list[BehaviorSet]:
    """The behaviour sets that the factory at `package.module:factory` makes.

    Raises:
        BehaviorError: there is no such factory, or it does not return behaviour sets.
    """
    factory = find_factory(place)
    try:
        made: object = factory()
        sets = list(made) if isinstance(made, Iterable) else None
    except (Exception, SystemExit) as error:
        raise BehaviorError(f"behaviors {place!r} failed: {_told(error)}") from error
    if sets is None:
        raise BehaviorError(f"behaviors {place!r} returned {described(made)}, expected a list of behaviour sets")
    for one in sets:
        if not isinstance(one, BehaviorSet):
            raise BehaviorError(f"behaviors {place!r} returned {described(one)}, expected instances of BehaviorSet")
    return sets


def complete_repertoire(robot: str, tasks: Sequence[str], own: Iterable[BehaviorSet]) -> dict[str, BehaviorSet]:
    """One behaviour set per task of `robot`: its own where there is one, else the default.

    Raises:
        BehaviorError: two sets for one task, a set for a task the robot does not have in the mission, or something else
            than a set.
    """
    repertoire: dict[str, BehaviorSet] = {}
    for one in own:
        if not isinstance(one, BehaviorSet):
            raise BehaviorError(f"robot {robot} was given {described(one)}, expected instances of BehaviorSet")
        task: str = getattr(one, "task", "")
        if task not in tasks:
            raise BehaviorError(
                f"{described(one)} is for task {task!r}, which robot {robot} does not have; "
                f"expected one of {', '.join(tasks)}"
            )
        if task in repertoire:
            raise BehaviorError(f"robot {robot} has two behaviour sets for task {task!r}, expected one")
        if not hasattr(one, "returned"):
            raise BehaviorError(f"{described(one)} did not call super().__init__()")
        repertoire[task] = one
    return {task: repertoire.get(task) or BehaviorSet(task) for task in tasks}
