"""The robots' bodies: whose process is there, and what each of them works on.

A body works on what its robot last said, only while that is refreshed: a dead-man switch stops it otherwise, until its robot
acts again. Nothing is known here of how work advances, nor of faults.
"""

import math
from dataclasses import dataclass

from lalliance_agents.config import Mission
from lalliance_agents.wire.messages import Action

#: A body stops when its action was not refreshed for this long, in seconds.
DEAD_MAN = 2.5


@dataclass(slots=True)
class Body:
    """What the world knows of one robot."""

    present: bool = False
    task: str | None = None
    refreshed: float = -math.inf
    fewest: int = 0


class Bodies(dict[str, Body]):
    """The bodies of a team, by robot, in the mission's order.

    Args:
        mission: whose team.
    """

    def __init__(self, mission: Mission) -> None:
        super().__init__((robot, Body()) for robot in mission.robots)
        self._mission = mission

    def missing(self) -> list[str]:
        """The robots that should be there from the beginning, and are not."""
        return [robot for robot, body in self.items() if not body.present and self._mission.robots[robot].joins == 0]

    def there(self) -> list[str]:
        """The robots whose processes are there."""
        return [robot for robot, body in self.items() if body.present]

    def working(self) -> dict[str, str]:
        """What each body that works is on."""
        return {robot: body.task for robot, body in self.items() if body.task is not None and body.present}

    def full(self) -> bool:
        """Whether the monitors of every robot that is there hold all the samples they keep."""
        return all(self[robot].fewest >= self._mission.parameters_of(robot).trials for robot in self.there())

    def is_refresh(self, action: Action, trial: int, now: float) -> bool:
        """Whether an action at `now` only says once more what its robot's body works on in `trial`."""
        body = self.get(action.sender)
        if body is None:
            return False
        return (action.trial, action.task) == (trial, body.task) and now < body.refreshed + DEAD_MAN

    def refresh(self, robot: str, until: float) -> None:
        """What `robot` said last was refreshed, the last time at `until`, which may be yet to come."""
        if robot in self:
            self[robot].refreshed = max(self[robot].refreshed, until)

    def next_stop(self) -> float:
        """When the dead-man switch stops the first body, in seconds; infinite if none works."""
        return min([body.refreshed for body in self.values() if body.task is not None], default=math.inf) + DEAD_MAN

    def stop_dead(self, now: float) -> bool:
        """Stop the bodies whose action was not refreshed for too long; whether there were any."""
        dead = [body for body in self.values() if body.task is not None and now >= body.refreshed + DEAD_MAN]
        for body in dead:
            body.task = None
        return bool(dead)
