"""What the greenhouse is to do, and what becomes of it when robots fail."""

from pathlib import Path

import pytest
from beds import DryingBeds

from mission_control.missions import load
from world_server.environments.base import Work

MISSION = Path(__file__).with_name("greenhouse.yaml")


def test_a_bed_dries_while_nobody_waters_it():
    beds = DryingBeds(load(MISSION, for_team=False), seed=1)
    beds.step(1.0, {"sprinkler": Work("north-bed")})
    assert beds.sense()["north-bed"].progress == pytest.approx(0.5)
    beds.step(4.0, {})
    assert beds.sense()["north-bed"].progress == pytest.approx(0.3)
    [done] = beds.step(8.0, {"sprinkler": Work("north-bed")})
    assert (done.task, done.by, done.after) == ("north-bed", ("sprinkler",), pytest.approx(1.4))


@pytest.mark.lalliance(engine="both", speed=1)
def test_the_rover_takes_over_what_a_dead_sprinkler_leaves(lalliance_mission):
    mission = lalliance_mission(MISSION)
    mission.wait_for("activate", robot="sprinkler")
    mission.inject(kind="crash", robot="sprinkler")
    mission.wait_for("takeover", robot="rover", task="north-bed", cause="silence")
    mission.finish()


@pytest.mark.lalliance(engine="real", speed=1)
def test_a_pump_that_draws_air_costs_an_attempt_and_nothing_else(lalliance_mission):
    mission = lalliance_mission(MISSION)
    mission.wait_for("drop", robot="rover", cause="body_failed")
    mission.wait_for("remark", text="pump open")
    mission.finish()
