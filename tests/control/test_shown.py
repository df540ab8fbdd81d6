"""What a run shows of its mission: all that happened, once and in its order, also what its router did not carry."""

import asyncio
import io
from pathlib import Path

import pytest
from rich.console import Console
from support.team import Team

from lalliance_agents.bus.base import Delivery
from lalliance_agents.bus.memory import MemoryBus
from lalliance_agents.wire.messages import Event
from mission_control.launch import Beginning, Launcher, Plan
from mission_control.live import Lines

pytestmark = pytest.mark.virtual_time

SMALL = """
name: small
tasks: {a: {}, b: {}, c: {}}
robots:
  left: {tasks: {a: 6, b: 9, c: 7}}
  right: {tasks: {a: 9, b: 6, c: 9}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.4}
"""


@pytest.mark.parametrize("away", [None, (4.0, 9.0)])
async def test_a_run_shows_what_happened_while_its_router_was_away(
    away: tuple[float, float] | None, tmp_path: Path
) -> None:
    shown = io.StringIO()
    team = Team(SMALL)
    view = Lines("small", Console(file=shown, width=200))
    plan = Plan(
        tmp_path / "small.yaml", team.mission, tmp_path / "journal", Beginning(first=()), listen="tcp/127.0.0.1:1"
    )
    async with team, MemoryBus(team.hub) as bus, MemoryBus(team.hub) as intruder:
        launcher = Launcher(plan, view)
        async with launcher._shown(bus):
            running = asyncio.create_task(team.run())
            if away is not None:
                since, until = away
                await asyncio.sleep(since)
                team.hub.go_down()
                await asyncio.sleep(until - since)
                team.hub.come_back()
            for key in ("lalliance/small/decision/no name", "lalliance/small/decision/mallory"):
                intruder.put(key, b"\xc1", Delivery.STATE)
            await running
    told = [line.strip().split(" s  ") for line in shown.getvalue().splitlines()]
    lines = [text for _, text in told]
    events = [message.text for _, message in team.messages if isinstance(message, Event)]
    assert "mallory" not in shown.getvalue()
    for text in ("right starts b", "b completed by right", "c completed by left", "complete after"):
        assert sum(line.startswith(text) for line in lines) == 1
    instants = [float(at) for at, _ in told]
    assert instants == sorted(instants)
    assert [line for line in lines if "gone" in line] == ([] if away is None else ["left is gone", "right is gone"])
    assert not any("gone" in event for event in events)
