"""Several robots in one process: one connection and one event loop, and each its own mind, name and incarnation.

Robots of one host hear one another over the bus, like everybody else. What they have in common is what costs: a process, a
session, a wake-up for what comes. A message that concerns several of them is decoded once. They also share their fate: what
ends the process ends all of them, and a behaviour set that blocks holds all of them up.
"""

import asyncio
from collections.abc import Iterable
from contextlib import AsyncExitStack
from functools import lru_cache
from types import TracebackType
from typing import Any, Self

from lalliance_agents.agent.runtime import Outcome, Robot
from lalliance_agents.bus.base import Bus
from lalliance_agents.bus.shared import SharedBus
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import Keys, Kind
from lalliance_agents.wire.messages import decode_at

#: Messages that are remembered decoded: all that robots of one host are answered when they join at the same time.
REMEMBERED = 4096


class Host:
    """Where robots live together; leaving it closes the bus.

    Args:
        mission: the mission of all of them.
        bus: an open bus.
    """

    def __init__(self, mission: Mission, bus: Bus) -> None:
        self._mission = mission
        self._bus = SharedBus(bus)
        self._decode = lru_cache(maxsize=REMEMBERED)(decode_at)
        self._members: list[Robot] = []
        self._stack = AsyncExitStack()

    def __repr__(self) -> str:
        return f"<host of {len(self._members)} robots of {self._mission.name}>"

    async def __aenter__(self) -> Self:
        await self._stack.enter_async_context(self._bus)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    def take_in(self, name: str, **options: Any) -> Robot:
        """Have a robot of the mission live here; `options` are those of `Robot`, but for the bus.

        Raises:
            BehaviorError: its behaviour sets do not fit the mission.
            MissionError: the mission has no robot of this name.
        """
        robot = Robot(self._mission, name, bus=self._bus, decode=self._decode, **options)
        self._members.append(robot)
        return robot

    async def run(self) -> list[Outcome]:
        """Let all live until the mission is over; how it ended for each. If one fails, all end with it."""
        self._widen()
        return await _all_or_none(asyncio.create_task(member.run(), name=member.name) for member in self._members)

    def _widen(self) -> None:
        """Hear everybody at once, if at least half of the team is to be heard by somebody here."""
        heard = {mate for member in self._members for mate in self._mission.teammates(member.name)}
        if 2 * len(heard) >= len(self._mission.robots):
            keys = Keys(self._mission.name)
            self._bus.widen(map(keys.build, (Kind.ACTIVITY, Kind.HEARTBEAT)), lazy=True)
            self._bus.widen(map(keys.build, (Kind.SENSE_TASK, Kind.SENSE_ROBOT)))


async def _all_or_none(tasks: Iterable[asyncio.Task[Outcome]]) -> list[Outcome]:
    running = list(tasks)
    try:
        return await asyncio.gather(*running)
    finally:
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
