"""A whole team in one event loop: world server and robots over the memory bus, to be run in virtual time."""

import asyncio
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from lalliance_agents import BehaviorSet, Robot
from lalliance_agents.agent.catalog import Catalog
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.clock import MissionClock
from lalliance_agents.config import Mission
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import Key, Keys, Kind
from lalliance_agents.wire.messages import Event, Message
from world_server.server import WorldServer


class Team:
    """Runs a mission in this event loop; crashes that the world orders are carried out on the memory bus.

    Args:
        mission: the mission, or its YAML text.
    """

    def __init__(self, mission: Mission | str) -> None:
        self.mission = parse_mission(mission, "test.yaml") if isinstance(mission, str) else mission
        self.hub = MemoryHub()
        self.keys = Keys(self.mission.name)
        self.robots: dict[str, Robot] = {}
        self.messages: list[tuple[Key, Message]] = []
        self.ended: dict[str, str] = {}
        self._buses: dict[str, MemoryBus] = {}
        self._running: dict[str, asyncio.Task[None]] = {}
        self._lives: dict[str, int] = {}
        self._watchers: list[tuple[Callable[[Key, Message], bool], asyncio.Event]] = []
        self._served: set[int] = set()
        self._background: set[asyncio.Task[None]] = set()
        self.factories: dict[str, Callable[[], Iterable[BehaviorSet]]] = {}
        self.learned: Path | None = None

    async def __aenter__(self) -> Self:
        self._bus = MemoryBus(self.hub)
        self._observer = Messenger(self._bus, self.keys, "observer", 1, MissionClock().now)
        for kind in Kind:
            if kind not in {Kind.MOTIVATION, Kind.ALIVE, Kind.CHAOS_RULES, Kind.CHAOS_COMMAND}:
                await self._observer.listen(self.keys.build(kind), self._observe)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for task in [*self._running.values(), *self._background]:
            task.cancel()
        await asyncio.gather(*self._running.values(), *self._background, return_exceptions=True)
        await self._observer.close()
        await self._bus.close()

    def _observe(self, key: Key, message: Message) -> None:
        self.messages.append((key, message))
        if isinstance(message, Event) and message.kind == "order" and message.details["number"] not in self._served:
            self._served.add(message.details["number"])
            assert message.robot is not None
            if message.details["deed"] == "kill":
                self.kill(message.robot)
            else:
                self.start(message.robot)
        for wanted, happened in self._watchers:
            if wanted(key, message):
                happened.set()

    async def wait_for(self, wanted: Callable[[Key, Message], bool], *, seconds: float = 600.0) -> None:
        """Wait until a message comes that is `wanted`."""
        happened = asyncio.Event()
        self._watchers.append((wanted, happened))
        async with asyncio.timeout(seconds):
            await happened.wait()

    def start(self, name: str) -> Robot:
        """Start a robot, in its next life."""
        self._lives[name] = self._lives.get(name, 0) + 1
        bus = self._buses[name] = MemoryBus(self.hub)
        catalog = None if self.learned is None else Catalog(self.learned, name)
        factory = self.factories.get(name, list)
        robot = Robot(
            self.mission,
            name,
            bus=bus,
            behaviors=factory(),
            catalog=catalog,
            incarnation=self._lives[name],
        )
        self.robots[name] = robot
        self._running[name] = asyncio.create_task(self._run(name, robot, bus))
        return robot

    async def _run(self, name: str, robot: Robot, bus: MemoryBus) -> None:
        async with bus:
            self.ended[name] = await robot.run()

    def kill(self, name: str) -> None:
        """End a robot as SIGKILL would: not another message leaves it."""
        self._buses[name].kill()
        self._running[name].cancel()

    def start_all(self) -> None:
        """Start all robots that are there from the beginning."""
        for name, spec in self.mission.robots.items():
            if spec.joins == 0 and name not in self.robots:
                self.start(name)

    async def serve(self, *, patience: float = 30.0) -> dict[str, Any]:
        """Run the world server to the mission's end; the summary."""
        async with MemoryBus(self.hub) as bus:
            return await WorldServer(self.mission, bus=bus, incarnation=1, patience=patience).run()

    async def run(self) -> dict[str, Any]:
        """Run the whole mission; the summary."""
        self.start_all()
        summary = await self.serve()
        await asyncio.wait([task for name, task in self._running.items() if name in self.robots], timeout=10.0)
        return summary
