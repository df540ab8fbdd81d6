"""A mission in Mesa (`benchmarks/mesa_team.py`) is the simulator's, so that their speeds can be compared."""

import pytest

from benchmarks.mesa_team import Team, compare
from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission
from lalliance_study.simulator import Simulator

FOUR = """
name: four
tasks: {a: {}, b: {}, c: {}, d: {after: [a]}, e: {}}
robots:
  one: {tasks: {a: 3, b: 5, d: 4}}
  two: {tasks: {b: 4, c: 6, e: 5}}
  three: {tasks: {a: 6, c: 4, d: 7, e: 3}}
  four: {tasks: {a: 5, b: 9, e: 4}}
"""


@pytest.mark.parametrize("more", ["", "knowledge: given", "environment: {hand_over: restart}", "deadline: 9"])
def test_agents_in_mesa_decide_what_robots_in_the_simulator_decide_at_the_same_instants(more: str) -> None:
    mission = parse_mission(FOUR + more, "four.yaml")
    team = Team(mission)
    assert compare(team, Simulator(mission)) is None
    assert len(team.decisions) >= 8


def test_a_difference_is_told() -> None:
    mission = parse_mission(FOUR, "four.yaml")
    team = Team(mission)
    team.robots["two"].mates.clear()
    difference = compare(team, Simulator(mission))
    assert difference is not None
    assert difference.startswith("Mesa: ")


def test_a_mission_with_a_fault_is_refused() -> None:
    mission = parse_mission(FOUR + "faults: [{at: 1, robot: one, kind: crash}]", "four.yaml")
    with pytest.raises(UserError, match="cannot run mission four: something befalls robots or bodies"):
        Team(mission)
