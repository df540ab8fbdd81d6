"""L-ALLIANCE for teams of different robots: fault-tolerant, learning task allocation without a coordinator.

For code of one's own: subclass `BehaviorSet` (or, without a world server, `AutonomousBehaviorSet`) and hand it to `Robot`,
or name a factory of behaviour sets in the mission file. The names are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lalliance_agents.agent.behavior import AutonomousBehaviorSet, BehaviorSet, TaskSense
    from lalliance_agents.agent.runtime import Robot

__all__ = ["AutonomousBehaviorSet", "BehaviorSet", "Robot", "TaskSense"]

_HOMES = {
    "AutonomousBehaviorSet": "lalliance_agents.agent.behavior",
    "BehaviorSet": "lalliance_agents.agent.behavior",
    "Robot": "lalliance_agents.agent.runtime",
    "TaskSense": "lalliance_agents.agent.behavior",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
