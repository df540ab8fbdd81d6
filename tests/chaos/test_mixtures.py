"""Everything at once: links as bad as they get, robots that crash and hang meanwhile, and the bus itself gone for a while."""

from typing import Any

import pytest
from support.bounds import attempts

from lalliance_testing.launch import Launch

TEAM = """
name: storm
tasks: {t1: {}, t2: {}, t3: {}, t4: {}, t5: {}, t6: {after: [t1]}, t7: {arrives: 6}}
robots:
  r1: {tasks: {t1: 6, t6: 5, t3: 8}}
  r2: {tasks: {t2: 6, t7: 5, t1: 9}}
  r3: {tasks: {t3: 5, t2: 9, t5: 9}}
  r4: {tasks: {t4: 5, t6: 7, t1: 9, t2: 9}}
  r5: {tasks: {t5: 5, t7: 7, t3: 9, t4: 9, t6: 9}}
knowledge: given
parameters: {strategy: II, silence_timeout: 2.0, min_delay: 0.1, max_delay: 0.4}
deadline: 120
seed: 7
faults:
"""
CRASHES = """
  - {at: 3, robot: r1, kind: crash}
  - {at: 4, robot: r2, kind: crash, restart: true, until: 12}
"""

STORMS = {
    "thirty percent lost, late by up to 0.4 s": "loss: 0.3, delay: {uniform: [0.05, 0.4]}",
    "sixty percent lost": "loss: 0.6",
    "half a second late, twice, and out of order": "delay: 0.5, duplicate: 0.2, reorder: 0.2",
    "bursts of two seconds": "loss: {enter: 0.03, leave: 0.1}",
}


@pytest.mark.lalliance(engine="both", speed=3)
@pytest.mark.parametrize("storm", STORMS)
def test_a_storm_two_crashes_and_a_hang_in_a_team_of_five_do_not_keep_a_mission_from_completing(
    lalliance_mission: Launch, storm: str
) -> None:
    rule = STORMS[storm]
    mission = lalliance_mission(f"{TEAM}{CRASHES}  - {{at: 0, link: {{}}, {rule}}}\n")
    mission.wait_for("gone", robot="r1")
    mission.wait_for("gone", robot="r2")
    hang = mission.inject(kind="hang", robot="r5", lasts=3)
    summary = mission.finish()
    for robot in ("r1", "r2"):
        [task] = lost_by(robot, summary)
        assert summary["tasks"][task]["by"] != ["r1"]
        assert {*attempts(summary, task)} > {robot}
    assert all(fault["fired"] for fault in summary["faults"])
    assert mission.faults()[hang]["state"] == "over"
    [rules] = [fault for fault in summary["faults"] if fault["kind"] == "link"]
    assert rules["count"] >= 50
    dropped = summary["messages"]["dropped"]
    assert (dropped.get("link fault", 0) > 0) == ("loss" in rule)
    assert dropped.get("stale", 0) > 0 or "delay" not in rule


def lost_by(robot: str, summary: dict[str, Any]) -> list[str]:
    """The tasks that a robot was on when it was lost."""
    return [
        task
        for task, record in summary["tasks"].items()
        if any((one["robot"], one["ended"]) == (robot, "lost") for one in record["attempts"])
    ]


@pytest.mark.lalliance(engine="real", speed=3)
def test_a_router_that_is_killed_during_loss_is_back_soon_and_the_mission_completes(lalliance_mission: Launch) -> None:
    mission = lalliance_mission(TEAM + "  - {at: 0, link: {}, loss: 0.3}\n")
    mission.wait_for("complete", task="t4")
    mission.kill_router()
    mission.wait_for("remark", text="the router ended (killed by SIGKILL); starting it again")
    summary = mission.finish()
    assert [fault["fired"] for fault in summary["faults"]] == [True]
    assert summary["messages"]["dropped"]["link fault"] > 0


@pytest.mark.lalliance(engine="real", speed=3)
def test_a_world_server_that_is_killed_during_loss_is_followed_by_one_that_goes_on(lalliance_mission: Launch) -> None:
    mission = lalliance_mission(TEAM + "  - {at: 0, link: {}, loss: 0.3}\n")
    before = mission.wait_for("complete", task="t4")
    mission.kill_world()
    mission.wait_for("remark", text="the world server ended (killed by SIGKILL); starting it again")
    summary = mission.finish()
    assert [fault["fired"] for fault in summary["faults"]] == [True]
    assert summary["tasks"]["t4"]["completed_at"] == pytest.approx(before.at, abs=0.1)
