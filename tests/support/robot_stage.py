"""A robot at run time, alone with a world and teammates that the test plays; to be run in virtual time."""

import asyncio
from types import TracebackType
from typing import Any, Self

from lalliance_agents import BehaviorSet, Robot
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.config import Mission
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import DecisionMade, Message

PAIR = """
name: pair
tasks: {a: {}, b: {}}
robots:
  left: {tasks: {a: 2, b: 6}}
  right: {tasks: {a: 6, b: 2}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.5}
"""


def mission(text: str = PAIR) -> Mission:
    return parse_mission(text, "test.yaml")


class SlowBus(MemoryBus):
    """A memory bus on which a declaration takes a turn of the loop, as on a real one."""

    async def subscribe(self, *given: Any, **options: Any) -> Any:
        await asyncio.sleep(0)
        return await super().subscribe(*given, **options)

    async def announce_presence(self, key: str) -> Any:
        await asyncio.sleep(0)
        return await super().announce_presence(key)


class Stage:
    """One robot of a mission on a bus, with the rest of the world played by the test."""

    def __init__(self, *behaviors: BehaviorSet, **more: Any) -> None:
        self.hub = MemoryHub()
        self.mission = more.pop("mission", None) or mission()
        self.keys = Keys(self.mission.name)
        self.bus = SlowBus(self.hub)
        self.robot = Robot(self.mission, "left", bus=self.bus, behaviors=behaviors, incarnation=1, **more)
        self.messages: list[Message] = []
        self.present: list[tuple[str, bool]] = []
        self._own = MemoryBus(self.hub)
        self.world = self.voice(WORLD)
        self.task: asyncio.Task[str]

    def voice(self, name: str) -> Messenger:
        return Messenger(self._own, self.keys, name, 1, asyncio.get_running_loop().time)

    async def __aenter__(self) -> Self:
        ear = self.voice("@ear")
        for kind in (Kind.ACTIVITY, Kind.HEARTBEAT, Kind.HELLO, Kind.ACTION, Kind.DECISION, Kind.LINK):
            await ear.listen(self.keys.build(kind), lambda _, message: self.messages.append(message))
        await self._own.watch_presence(
            self.keys.build(Kind.ALIVE), lambda key, present: self.present.append((key.rsplit("/", 1)[-1], present))
        )
        self.task = asyncio.create_task(self.robot.run())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.task.cancel()
        await asyncio.wait({self.task})
        await self.bus.close()
        await self._own.close()

    def sense(self, task: str, trial: int = 1, **fields: Any) -> None:
        """The world says that `task` can be worked on, unless said otherwise."""
        fields = {"learning": "adaptive", "applicable": True, "complete": False, "progress": 0.0} | fields
        self.world.send(Kind.SENSE_TASK, key_task=task, trial=trial, **fields)

    def say(self, stage: str, trial: int = 1) -> None:
        """The world says how the mission stands."""
        self.world.send(Kind.SENSE_ROBOT, key_robot="left", mission=stage, trial=trial, learning="adaptive")

    async def begin(self) -> None:
        """The mission begins as soon as the robot has joined, which takes no time on this bus."""
        await asyncio.sleep(0.001)
        self.say("running")

    def decisions(self) -> list[tuple[str, str, int]]:
        return [(m.verb, m.task, m.trial) for m in self.messages if isinstance(m, DecisionMade)]


class Logged(BehaviorSet):
    """Always applicable by its own sensing; logs what it does."""

    def __init__(self, task: str, *, returns_after: float | None = None) -> None:
        super().__init__(task)
        self.log: list[str] = []
        self.began = asyncio.Event()
        self._returns_after = returns_after

    def applicable(self) -> bool:
        return True

    def complete(self) -> bool:
        return self.returned

    async def perform(self) -> None:
        self.log.append("begins")
        self.began.set()
        try:
            await asyncio.sleep(1e6 if self._returns_after is None else self._returns_after)
        finally:
            self.log.append("ends")
