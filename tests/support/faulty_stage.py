"""A robot `right` that hears through faults, alone on a memory bus with all who speak to it; to be run in virtual time."""

import asyncio
from typing import Any

from lalliance_agents.bus.base import Registration, Sample
from lalliance_agents.bus.faulty import FaultyBus
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import Blindness, LinkRule, decode_at

KEYS = Keys("m")
RULES = KEYS.build(Kind.CHAOS_RULES)

LATE = {"delay": "constant", "delay_by": 1.0, "delay_to": 1.0}


def rule(fault: str = "1-link", senders: str = "left", receivers: str = "right", **fields: Any) -> LinkRule:
    return LinkRule(fault=fault, senders=[senders], receivers=[receivers], **fields)


def blind(robot: str = "right", delay: float | None = None) -> Blindness:
    return Blindness(fault="2-blind", robot=robot, delay=delay)


class Stage:
    """A robot `right` behind faults, with the world, `left` and what else speaks to it."""

    def __init__(self, speed: float = 1.0) -> None:
        self.hub = MemoryHub()
        self.others = MemoryBus(self.hub)
        self.clock = MissionClock(speed)
        self.inner = MemoryBus(self.hub)
        self.bus = FaultyBus(self.inner, KEYS, "right", self.clock)
        self.world = self.voice(WORLD)
        self.left = self.voice("left")
        self.log: list[tuple[float, str]] = []

    def voice(self, name: str, incarnation: int = 1) -> Messenger:
        return Messenger(self.others, KEYS, name, incarnation, self.clock.now)

    def hear(self, sample: Sample) -> None:
        """Write down when a sample came, from whom or of which task, and its number."""
        try:
            key = KEYS.parse(sample.key)
            text = f"{key.robot or key.task} {decode_at(key, sample.payload).seq}"
        except Exception:
            text = f"{sample.payload!r}"
        self.log.append((round(self.clock.now(), 6), text))

    async def obey(self, *rules: LinkRule, blind: Blindness | None = None, seed: int = 7) -> None:
        """Have these rules in force."""
        if not self.inner_hears(RULES):
            await self.bus.obey(timeout=1.0)
        self.put_in_force(*rules, blind=blind, seed=seed)
        await self.pause(0.0)

    def inner_hears(self, key: str) -> bool:
        return any(one.pattern == key for one in self.hub._subscriptions)

    def put_in_force(
        self, *rules: LinkRule, blind: Blindness | None = None, seed: int = 7, by: Messenger | None = None
    ) -> None:
        (by or self.world).send(Kind.CHAOS_RULES, seed=seed, rules=list(rules), blind=[blind] if blind else [])

    async def listen(self, *patterns: str) -> list[Registration]:
        return [await self.bus.subscribe(pattern, self.hear) for pattern in patterns or [KEYS.build(Kind.HEARTBEAT)]]

    def hear_lazily(self, sample: Sample) -> None:
        """The same with the instant at which it came."""
        self.hear(sample)
        self.log[-1] = (round(self.clock.at(sample.came), 6), self.log[-1][1])

    async def listen_lazily(self, *patterns: str) -> list[Registration]:
        return [
            await self.bus.subscribe(pattern, self.hear_lazily, lazy=True)
            for pattern in patterns or [KEYS.build(Kind.HEARTBEAT)]
        ]

    def beat(self, count: int = 1, by: Messenger | None = None) -> None:
        for _ in range(count):
            (by or self.left).send(Kind.HEARTBEAT, trial=1)

    def sense(self, task: str = "a") -> None:
        self.world.send(Kind.SENSE_TASK, key_task=task, **TASK)

    async def pause(self, seconds: float) -> None:
        """Let mission time pass."""
        await self.clock.sleep_until(self.clock.now() + seconds)
        for _ in range(3):
            await asyncio.sleep(0)

    def take_log(self) -> list[tuple[float, str]]:
        taken, self.log = self.log, []
        return taken

    def effects(self) -> dict[tuple[str, str], int]:
        return {(one.fault, one.sender): one.count for one in self.bus.effects()}


TASK = {"trial": 1, "learning": "active", "applicable": True, "complete": False, "progress": 0.0}
