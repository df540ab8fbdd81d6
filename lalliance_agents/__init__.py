"""L-ALLIANCE for teams of different robots: fault-tolerant, learning task allocation without a coordinator.

For code of one's own: subclass `BehaviorSet` (or, without a world server, `AutonomousBehaviorSet`) and hand it to `Robot`,
or name a factory of behaviour sets in the mission file.
"""

from lalliance_agents.agent.behavior import AutonomousBehaviorSet, BehaviorSet, TaskSense
from lalliance_agents.agent.runtime import Robot

__all__ = ["AutonomousBehaviorSet", "BehaviorSet", "Robot", "TaskSense"]
