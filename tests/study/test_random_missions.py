"""The generator of campaigns: always a mission, always the same one, and in time all that a mission can be."""

from collections import Counter

import pytest
from pydantic_core import PydanticCustomError

from lalliance_agents.config import Mission
from lalliance_agents.faults import LinkFault, as_globs
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.model.parameters import Architecture, Ordering, Reading, Strategy
from lalliance_study.campaign import kinds_of
from lalliance_study.promises import promise, sound
from lalliance_study.random_missions import MOST_ROBOTS, MOST_TASKS, WIDEST, draw_mission, mission_of, text_of
from world_server import environments

MANY = 1200


@pytest.fixture(scope="module")
def missions() -> list[Mission]:
    return [draw_mission(11, number)[1] for number in range(MANY)]


def test_what_is_drawn_is_a_mission_also_when_it_is_written_to_a_file_and_read() -> None:
    for number in range(250):
        document, mission = draw_mission(5, number)
        read = parse_mission(text_of(document), f"{number}.yaml")
        environments.check_options(read)
        assert read.model_dump() == mission.model_dump() == mission_of(document).model_dump()
        assert mission.name == f"campaign-5-{number}"


def test_a_mission_depends_on_seed_and_number_alone() -> None:
    forwards = [draw_mission(3, number)[0] for number in range(8)]
    backwards = [draw_mission(3, number)[0] for number in reversed(range(8))][::-1]
    assert forwards == backwards
    assert len({text_of(document) for document in forwards}) == 8
    assert draw_mission(4, 0)[0] != forwards[0]


def test_the_first_mission_of_all_is_known() -> None:
    """A failure is repeated by its number on any machine, so that what a number means must not change by accident."""
    document, _ = draw_mission(0, 0)
    assert (len(document["tasks"]), len(document["robots"]), document["seed"]) == (1, 2, 166555585)


def test_sizes_are_mostly_small_and_reach_their_limits(missions: list[Mission]) -> None:
    robots = sorted(len(mission.robots) for mission in missions)
    tasks = sorted(len(mission.tasks) for mission in missions)
    assert (robots[0], tasks[0]) == (2, 1)
    assert 0.8 * MOST_ROBOTS < robots[-1] <= MOST_ROBOTS
    assert 0.8 * MOST_TASKS < tasks[-1] <= MOST_TASKS
    assert sum(robots) < 5 * MANY
    assert sum(tasks) < 5 * MANY
    widest = max(len(mission.able(task)) for mission in missions for task in mission.tasks)
    assert WIDEST <= widest <= WIDEST + 3


def test_every_kind_of_fault_occurs(missions: list[Mission]) -> None:
    kinds = Counter(kind for mission in missions for fault in mission.faults for kind in kinds_of(fault))
    links = {f"link {name}" for name in ("loss", "bursts", "delay", "duplicate", "reorder", "cut")}
    robots = {"crash", "crash, restarted", "hang", "stuck", "stuck at a task", "slow", "mute", "deaf"}
    assert kinds.keys() == links | robots | {"blind", "blind, late senses", "partition"}
    assert min(kinds.values()) > 20
    rules = [fault for mission in missions for fault in mission.faults if isinstance(fault, LinkFault)]
    assert any(fault.link.both for fault in rules)
    assert any("*" in glob and glob != "*" for fault in rules for glob in as_globs(fault.link.senders))
    assert any(fault.end == float("inf") for fault in rules)


def test_no_rule_delays_by_nothing() -> None:
    """Such a rule can never fire; seed 1004 had drawn one in 20,000 missions."""
    document, _ = draw_mission(1004, 6430)
    assert 0.001 in [fault.get("delay") for fault in document["faults"]]


def test_all_that_a_mission_can_say_is_said(missions: list[Mission]) -> None:
    own = [mission.parameters_of(robot) for mission in missions for robot in mission.robots]
    assert {one.strategy for one in own} == set(Strategy)
    assert {one.ordering for one in own} == set(Ordering)
    assert {one.architecture for one in own} == set(Architecture)
    assert {reading for one in own for reading in one.readings.values()} == set(Reading)
    assert {mission.environment.kind for mission in missions} == {"task_pool", "box_pushing"}
    assert {mission.knowledge for mission in missions} == {"none", "given"}
    assert {mission.live.learning.value for mission in missions} == {"active", "adaptive"}
    for told in (
        lambda mission: mission.environment.options.get("noise"),
        lambda mission: any(task.after for task in mission.tasks.values()),
        lambda mission: any(task.arrives for task in mission.tasks.values()),
        lambda mission: any(robot.joins for robot in mission.robots.values()),
        lambda mission: any(robot.parameters for robot in mission.robots.values()),
        lambda mission: any(phase.until for phase in mission.phases),
        lambda mission: mission.parameters.by_hand_tasks,
        lambda mission: not mission.faults,
    ):
        assert 5 < sum(bool(told(mission)) for mission in missions) < MANY - 5


def test_most_missions_are_promised_to_complete_and_some_are_not(missions: list[Mission]) -> None:
    why = Counter(promise(mission).why for mission in missions)
    assert 0.75 * MANY < why["all progress"] + why["failures teach"] < 0.97 * MANY
    assert {"failures teach", "a task keeps no sound robot"} <= why.keys()
    for mission in missions:
        promised = promise(mission).seconds
        assert promised is None or (
            promised <= mission.deadline and all(sound(mission, task) for task in mission.tasks)
        )


def test_what_is_no_mission_of_its_environment_is_refused() -> None:
    document, _ = draw_mission(0, 0)
    with pytest.raises(PydanticCustomError, match="two ends"):
        mission_of({**document, "environment": {"kind": "box_pushing"}})
