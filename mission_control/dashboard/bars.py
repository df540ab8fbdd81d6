"""Attempts as the timeline shows them. Pure."""

from dataclasses import dataclass, field
from typing import Any

from mission_control.watch.seen import Attempt

#: How attempts end, as the timeline shows it; how else: the robot left the task.
ENDS = {"sensed": "done", "lost": "lost", "body_failed": "lost"}
ENDED = {
    "sensed": "ended: the task is complete",
    "lost": "ended: the robot's process is gone",
    "contender": "ended: the robot yielded to a teammate",
    "collision": "ended: a teammate had started at the same time",
    "no_success": "ended: the robot gave up without success",
    "inapplicable": "ended: the task did not apply any more",
    "body_failed": "ended: the robot's own code failed",
    "new_trial": "ended with the trial",
    "over": "ended with the mission",
}


@dataclass(slots=True)
class Bar:
    """An attempt on the line of time."""

    number: int
    attempt: Attempt
    why: str | None = None
    """Why it began; None: not looked for yet."""
    version: int = 0
    shown: dict[str, Any] = field(default_factory=dict)
