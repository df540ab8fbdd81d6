"""What a simulated mission can be told beyond its file: what robots know before, and what befalls them by the work they do.

A mission file schedules its faults by the clock. The study's are of another kind: a robot dies after so much work, and a body
gets stuck in the midst of an attempt, wherever that comes to lie in time. Neither has a place in a real run, so the world
knows nothing of them: they are made here by what any operator can do to a running mission, killing a process and injecting
or healing a fault.
"""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from lalliance_agents.agent.briefing import chance_of
from lalliance_agents.config import Mission
from lalliance_agents.faults import Stuck
from lalliance_agents.model.events import Verb
from lalliance_agents.model.monitor import Record
from world_server.failures import State
from world_server.world import World


class Trap(NamedTuple):
    """A task at which a robot's body gets stuck, in every attempt of the live trial, while the robot goes on talking."""

    after: float
    """Work of the attempt before it gets stuck, in seconds."""
    lasts: float = math.inf
    """For how long it is stuck then, in seconds; infinite: until the attempt ends."""


@dataclass(frozen=True, slots=True)
class Circumstances:
    """See the module; by default a mission is what its file says."""

    learned: Mapping[str, Mapping[str, Mapping[str, Record]]] = field(default_factory=dict)
    """What a robot has learned before: robot -> task -> whose time -> record."""
    lives: Mapping[str, float] = field(default_factory=dict)
    """How long a robot can be active in the live trial before its process ends, in seconds; robots not named live."""
    traps: Mapping[tuple[str, str], Trap] = field(default_factory=dict)
    """By robot and task."""
    chance_of: Callable[[Mission, str, int], random.Random] = chance_of
    """Where all that a robot draws in one of its lives comes from."""


class Mishaps:
    """Makes robots die and bodies get stuck.

    Args:
        circumstances: which.
        world: the mission's world.
        at: has something done at an instant; called with the instant, a priority, a function and its arguments.
        kill: ends the process of a robot now.
    """

    def __init__(
        self, circumstances: Circumstances, world: World, at: Callable[..., None], kill: Callable[[str], None]
    ) -> None:
        self._left = dict(circumstances.lives)
        self._traps = circumstances.traps
        self._world = world
        self._at = at
        self._kill = kill
        self._dies: dict[str, float] = {}
        self._bodies: dict[str, tuple[int, str | None]] = {}
        self._attempts: dict[str, int] = {}
        self._stuck: dict[str, str] = {}

    def decided(self, robot: str, verb: Verb, now: float) -> None:
        """A robot became active, or ceased to be."""
        if robot not in self._left or not self._world.live:
            return
        if verb is Verb.ACTIVATE:
            self._dies[robot] = now + self._left[robot]
            self._at(self._dies[robot], 0, self._die, robot, self._dies[robot])
        elif robot in self._dies:  # of several sets that stop together the first stops the clock (erratum 5, literal)
            self._left[robot] = self._dies.pop(robot) - now

    def _die(self, robot: str, planned: float) -> None:
        if self._dies.get(robot) == planned:
            self._kill(robot)

    def look(self, robot: str, now: float) -> None:
        """A body may have turned to something else."""
        if not self._traps:
            return
        world = self._world
        body = (world.trial, world.bodies[robot].task)
        if self._bodies.get(robot) == body:
            return
        self._bodies[robot] = body
        self._attempts[robot] = number = self._attempts.get(robot, 0) + 1
        self._free(robot, now)
        trap = self._traps.get((robot, body[1] or ""))
        if trap is not None and trap.after < math.inf and world.live:
            springs = now + trap.after
            self._at(springs, 0, self._spring, robot, number, trap.lasts, springs)

    def _spring(self, robot: str, number: int, lasts: float, now: float) -> None:
        world, task = self._world, self._world.bodies[robot].task
        world.advance(now)
        if self._attempts[robot] == number and task is not None and not world.over:
            fault = Stuck(kind="stuck", robot=robot, task=task, at=0.0)
            made = world.inject(fault, None if lasts == math.inf else lasts, now)
            self._stuck[robot] = made.partition(":")[0]

    def _free(self, robot: str, now: float) -> None:
        name = self._stuck.pop(robot, None)
        on = [entry.name for entry in self._world.failures.entries if entry.state is State.ON]
        if name in on and not self._world.over:
            self._world.heal(name, now)
