"""What a robot reports of the faults that it hears through."""

import asyncio

import pytest

from lalliance_agents import Robot
from lalliance_agents.agent.reports import MOST_DROPS
from lalliance_agents.agent.runtime import MOST_TEAMMATES
from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.faulty import MOST_EFFECTS
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import WORLD, Key, Keys, Kind
from lalliance_agents.wire.messages import (
    LONGEST,
    MAX_PAYLOAD,
    Blindness,
    Drop,
    Effect,
    LinkReport,
    LinkRule,
    Message,
    Reception,
    encode,
)

PAIR = """
name: pair
tasks: {a: {}}
robots:
  left: {tasks: {a: 2}}
  right: {tasks: {a: 6}}
knowledge: given
"""

LOSSY = LinkRule(fault="1-link", senders=["right"], receivers=["left"], loss=0.5)


@pytest.mark.virtual_time
async def test_every_report_tells_what_faults_did_and_the_last_one_too() -> None:
    """The rules are there when the robot joins; it hears of their end like everybody."""
    hub, keys = MemoryHub(), Keys("pair")
    reports: list[LinkReport] = []

    def report(_: Key, message: Message) -> None:
        assert isinstance(message, LinkReport)
        reports.append(message)

    async with MemoryBus(hub) as bus, MemoryBus(hub) as others:
        now = asyncio.get_running_loop().time
        world, right = (Messenger(others, keys, name, 1, now) for name in (WORLD, "right"))
        await right.listen(keys.build(Kind.LINK), report)
        rules = keys.build(Kind.CHAOS_RULES)
        blind = [Blindness(fault="2-blind", robot="left")]
        await world.offer(
            rules, lambda _: [Sample(rules, world.compose(Kind.CHAOS_RULES, seed=7, rules=[LOSSY], blind=blind))]
        )
        running = asyncio.create_task(Robot(parse_mission(PAIR, "test.yaml"), "left", bus=bus, incarnation=1).run())
        await asyncio.sleep(0.01)
        world.send(Kind.SENSE_ROBOT, key_robot="left", mission="running", trial=1, learning="adaptive")
        for _ in range(100):
            right.send(Kind.HEARTBEAT, trial=1)
        sensed = {"trial": 1, "learning": "adaptive", "applicable": True, "complete": False, "progress": 0.0}
        world.send(Kind.SENSE_TASK, key_task="a", **sensed)
        await asyncio.sleep(3.0)
        world.send(Kind.CHAOS_RULES, seed=7, rules=[], blind=[])
        right.send(Kind.HEARTBEAT, trial=1)
        world.send(Kind.SENSE_ROBOT, key_robot="left", mission="complete", trial=1, learning="adaptive")
        assert await running == "complete"
        await asyncio.sleep(0.01)
        assert [one.pattern for one in hub._subscriptions if one.owner is bus] == []
    settled = [one for one in reports if one.received > 0]
    lost = settled[0].dropped["link fault"]
    assert 30 < lost < 70
    for one in settled:
        assert sorted((each.fault, each.sender, each.count) for each in one.effects) == [
            ("1-link", "right", lost),
            ("2-blind", "@world", 1),
        ]
        assert one.dropped == {"link fault": lost, "blind": 1}
    assert [one.final for one in settled] == [False] * (len(settled) - 1) + [True]
    assert settled[-2].teammates["right"].received == 100 - lost
    assert settled[-1].teammates["right"].received == 101 - lost


def test_the_largest_report_fits_into_a_message() -> None:
    """With as many teammates and effects as are told apart, all with the longest names."""
    names = [f"{number:064}" for number in range(MOST_TEAMMATES)]
    largest = LinkReport(
        sender=names[0],
        incarnation=2**63 - 1,
        seq=2**63 - 1,
        at=LONGEST,
        sent=2**63 - 1,
        received=2**63 - 1,
        dropped={f"{number:020}": 2**63 - 1 for number in range(20)},
        teammates={name: Reception(received=2**32, silence=1.5, lapses=2**16, lost_for=1.5) for name in names},
        effects=[Effect(fault=f"{number:020}", sender="@others", count=2**32) for number in range(MOST_EFFECTS)]
        + [Effect(fault=f"{number:020}", sender=names[0], count=2**32) for number in range(MOST_EFFECTS)],
        drops=[Drop(sender=names[0], reason="x" * 20, count=2**32) for _ in range(MOST_DROPS)],
        ticks=2**63 - 1,
        missed=2**63 - 1,
    )
    assert len(encode(largest)) <= MAX_PAYLOAD
