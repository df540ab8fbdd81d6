"""What a robot of a mission is born with, whoever drives it: its tasks, its chance, its mind and what that knows already."""

import random
from collections.abc import Mapping

from lalliance_agents.config import Mission
from lalliance_agents.model.events import RosterKnown
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.monitor import Record


def tasks_of(mission: Mission, robot: str) -> list[str]:
    """The tasks that `robot` can do, in the mission's order, which breaks ties."""
    return [task for task in mission.tasks if task in mission.robots[robot].tasks]


def chance_of(mission: Mission, robot: str, incarnation: int) -> random.Random:
    """Where all that `robot` draws in one of its lives comes from."""
    return random.Random(f"{mission.seed}/{robot}/{incarnation}")


def given_times(mission: Mission, robot: str) -> dict[str, dict[str, Record]]:
    """What the mission itself gives the robot to know: task -> robot -> record; nothing unless `knowledge: given`."""
    if mission.knowledge != "given":
        return {}
    return {
        task: {mate: Record((mission.robots[mate].tasks[task],)) for mate in mission.able(task)}
        for task in tasks_of(mission, robot)
    }


def new_mind(
    mission: Mission,
    robot: str,
    chance: random.Random,
    *,
    now: float,
    learned: Mapping[str, Mapping[str, Record]] | None = None,
) -> Mind:
    """A mind that knows what it is given and what it has learned before.

    Args:
        mission: the mission.
        robot: which robot of it.
        chance: where its randomness comes from.
        now: the instant of its birth, in seconds of its own mission time.
        learned: what was learned in earlier lives: task -> robot -> record.
    """
    mind = Mind(robot, tasks_of(mission, robot), mission.parameters_of(robot), now=now, draw=chance.random)
    known = given_times(mission, robot)
    for task, records in (learned or {}).items():
        if task in mission.robots[robot].tasks:
            known.setdefault(task, {}).update(records)
    mind.knowledge.restore(known)
    return mind


def roster(mission: Mission, robot: str) -> RosterKnown:
    """The teammates that the robot expects to hear at the start."""
    return RosterKnown(frozenset(mate for mate in mission.teammates(robot) if mission.robots[mate].joins == 0.0))
