"""A mission on an encrypted bus goes on while others try to take part in it, or to speak for those who do."""

import asyncio
import json
from pathlib import Path

import pytest
from support.processes import Processes
from support.secured import new_keys

from lalliance_agents.bus.base import Bus, Delivery
from lalliance_agents.bus.credentials import credentials_in
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import BusError
from lalliance_agents.wire.keys import OPERATOR, WORLD, Keys, Kind
from lalliance_agents.wire.messages import ChaosCommand, encode
from mission_control.recording.reader import sightings
from mission_control.watch.sighting import read

TEAM = """\
name: team
tasks: {a: {}, b: {}, c: {after: [a]}, d: {after: [b]}}
robots:
  r1: {tasks: {a: 5, b: 30, c: 5}}
  r2: {tasks: {a: 30, b: 5, d: 5}}
  r3: {tasks: {c: 30, d: 30}}
knowledge: given
parameters: {min_delay: 0.05, max_delay: 0.3}
deadline: 120
"""


async def test_a_mission_goes_on_while_others_meddle(processes: Processes, tmp_path: Path) -> None:
    (tmp_path / "team.yaml").write_text(TEAM)
    keys = new_keys(tmp_path / "keys", "r1", "r2", "r3")
    endpoint = free_endpoint("tls")
    command = ["run", "team.yaml", "--keys", keys, "--listen", endpoint, "--speed", "2", "--json", "--record", "a.mcap"]
    running = processes.start(*command)
    await asyncio.to_thread(wait_for_start, running)
    async with await open_bus(endpoint, credentials=credentials_in(keys, "r1")) as robot:
        meddling = asyncio.create_task(meddle(robot))
        with pytest.raises(BusError):
            await open_bus(endpoint.replace("tls/", "tcp/"), timeout=0.5)
        out, _ = await asyncio.to_thread(running.communicate, timeout=90)
        assert not meddling.done() or meddling.result()
        meddling.cancel()
    summary = json.loads(out)
    assert running.returncode == 0
    assert summary["complete"]
    # Each task was completed by who worked on it, none before its time, and nobody was made to look dead.
    assert {task["completed_at"] >= 5.0 for task in summary["tasks"].values()} == {True}
    assert "silence" not in {one["cause"] for one in summary["takeovers"]}
    assert summary["faults"] == []
    assert set(summary["messages"]["dropped"]) <= {"stale", "other trial"}
    # An operator may record, and what was forged is not in it.
    messages = [read(one, Keys("team"))[1] for one in sightings(tmp_path / "a.mcap")]
    assert {message.sender for message in messages if message is not None} >= {"r1", "r2", "r3", WORLD}
    assert 2**60 not in {message.incarnation for message in messages if message is not None}


def wait_for_start(running) -> None:
    """The events are on standard error, with --json."""
    for line in running.stderr:
        if "starts" in line:
            return
    raise AssertionError("the mission did not start")


async def meddle(robot: Bus) -> None:
    """With the certificate of r1: forge what others say, claim that all is done, and command faults."""
    keys, clock = Keys("team"), MissionClock()
    as_world = Messenger(robot, keys, WORLD, 2**60, clock.now)
    as_teammate = Messenger(robot, keys, "r2", 2**60, clock.now)
    as_operator = Messenger(robot, keys, OPERATOR, 2**60, clock.now)
    command = ChaosCommand(**as_operator.header(), verb="inject", fault='{"robot": "r3", "kind": "mute"}', lasts=None)
    done = {"trial": 1, "learning": "adaptive", "applicable": True, "complete": True, "progress": 1.0}
    while True:
        for task in ("a", "b", "c", "d"):
            as_world.send(Kind.SENSE_TASK, key_task=task, **done)
        for name in ("r1", "r2", "r3"):
            as_world.send(Kind.SENSE_ROBOT, key_robot=name, mission="complete", trial=1, learning="adaptive")
        as_teammate.send(Kind.ACTION, task=None, trial=1, fewest=0)
        robot.put(keys.build(Kind.HEARTBEAT, robot="r3"), b"garbage", Delivery.PRESENCE)
        assert await robot.query(keys.build(Kind.CHAOS_COMMAND), encode(command), timeout=0.2) == []
        await asyncio.sleep(0.02)
