"""What goes into a simulated run besides its mission, and what comes out of it: delays, the log, and who looks on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from lalliance_agents.model.events import Decision
from lalliance_agents.wire.messages import DecisionMade
from world_server.world import STEP, Happening


@dataclass(frozen=True, slots=True)
class Timing:
    """Delays of a real run, in seconds of mission time."""

    message_delay: float = 0.001
    """Of every message, before link rules."""
    world_step: float = STEP
    """Between two looks of the world server at its world."""
    start_up: float = 0.4
    """From the order to start a robot to its presence on the bus."""


class Line(NamedTuple):
    """One line of the event log."""

    at: float
    """Seconds since the simulation began."""
    who: str
    what: str
    task: str | None
    why: str
    other: str | None

    def __str__(self) -> str:
        other = f" {self.other}" if self.other else ""
        return f"{self.at:.6f} {self.who} {self.what}{f' {self.task}' if self.task else ''}: {self.why}{other}"


class Watcher(Protocol):
    """Whoever wants to know more of a run than its log tells."""

    def sensed(self, at: float, robot: str, task: str, applicable: bool, complete: bool) -> None:
        """A robot senses that a task stands otherwise than it knew."""

    def decided(self, robot: str, decision: Decision) -> None:
        """A robot has decided something, with all that is behind it."""


Follower = Callable[[Happening | DecisionMade], None]
"""Whoever hears what an operator of a real run does."""
