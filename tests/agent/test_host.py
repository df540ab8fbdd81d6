"""Robots that live in one process: each is a robot of its own, and the bus is asked once for what several of them want."""

import asyncio
from collections import Counter

import pytest

from lalliance_agents.agent.host import Host
from lalliance_agents.bus.base import Delivery, Handler, Registration, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.shared import SharedBus
from lalliance_agents.errors import MissionError
from lalliance_agents.mission_file import parse_mission
from world_server.server import WorldServer

pytestmark = pytest.mark.virtual_time

MISSION = """
name: hosted
tasks: {a: {}, b: {}, c: {}, d: {}}
robots:
  one: {tasks: {a: 4, b: 9}}
  two: {tasks: {a: 9, b: 4}}
  three: {tasks: {c: 5, d: 6}}
  four: {tasks: {c: 7, d: 5}}
knowledge: given
parameters: {min_delay: 0.1, max_delay: 0.3, silence_timeout: 1.0}
faults:
  - {at: 1, until: 4, link: {from: three, to: four}, loss: 1.0}
"""


class Counting(MemoryBus):
    """Counts what it is asked for."""

    def __init__(self, hub: MemoryHub) -> None:
        super().__init__(hub)
        self.patterns: Counter[str] = Counter()
        self.lazy_patterns: Counter[str] = Counter()
        self.questions: Counter[str] = Counter()

    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> Registration:  # type: ignore[override]
        (self.lazy_patterns if lazy else self.patterns)[pattern] += 1
        return await super().subscribe(pattern, handler, lazy=lazy)

    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109
        self.questions[pattern] += 1
        return await super().query(pattern, payload, timeout=timeout)


async def test_hosted_robots_finish_a_mission_each_under_its_name_and_with_its_own_faults() -> None:
    mission = parse_mission(MISSION, "test.yaml")
    hub = MemoryHub()
    bus = Counting(hub)
    async with MemoryBus(hub) as world_bus, Host(mission, bus) as host:
        for number, name in enumerate(mission.robots):
            host.take_in(name, incarnation=number + 1)
        with pytest.raises(MissionError, match="has no robot 'five'"):
            host.take_in("five")
        world = asyncio.create_task(WorldServer(mission, bus=world_bus, incarnation=1).run())
        outcomes = await host.run()
        summary = await world
    assert outcomes == ["complete"] * 4
    assert {task: story["by"] for task, story in summary["tasks"].items()} == {
        "a": ["one"], "b": ["two"], "c": ["three"], "d": ["four"]
    }  # fmt: skip
    assert summary["makespan"] < 8
    [fault] = summary["faults"]
    assert fault["fired"]
    assert fault["count"] > 10
    kinds = ("heartbeat/*", "activity/*/*", "hello/*")
    assert bus.lazy_patterns == {f"lalliance/hosted/{kind}": 1 for kind in kinds}
    kinds = ("sense/task/*", "sense/robot/*", "@chaos/rules")
    assert bus.patterns == {f"lalliance/hosted/{kind}": 1 for kind in kinds}
    assert bus.questions["lalliance/hosted/hello/*"] == bus.questions["lalliance/hosted/sense/task/*"] == 1


async def test_a_robot_that_fails_ends_the_others_of_its_process() -> None:
    mission = parse_mission(MISSION, "test.yaml")
    async with Host(mission, MemoryBus(MemoryHub())) as host:
        robots = [host.take_in(name) for name in ("one", "two")]

        def fail(now: float) -> None:
            raise OSError(f"no room at {now}")

        robots[0]._tick = fail  # type: ignore[method-assign]
        with pytest.raises(OSError, match="no room"):
            await host.run()
        assert len(asyncio.all_tasks()) == 1


async def test_a_shared_subscription_serves_each_until_it_leaves_and_ends_with_the_last() -> None:
    hub = MemoryHub()
    inner = Counting(hub)
    heard: list[tuple[str, bytes]] = []
    async with SharedBus(inner) as bus, MemoryBus(hub) as other:
        first = await bus.subscribe("m/*", lambda sample: heard.append(("first", sample.payload)))

        def second(sample: Sample) -> None:
            heard.append(("second", sample.payload))
            raise ValueError("a handler's failure is its own")

        leaving = await bus.subscribe("m/*", second)
        await bus.subscribe("m/*", lambda sample: heard.append(("third", sample.payload)))
        assert inner.patterns == {"m/*": 1}
        other.put("m/k", b"1", Delivery.STATE)
        await asyncio.sleep(0.01)
        assert heard == [("first", b"1"), ("second", b"1"), ("third", b"1")]
        await leaving.close()
        await leaving.close()
        await first.close()
        other.put("m/k", b"2", Delivery.STATE)
        await asyncio.sleep(0.01)
        assert heard[3:] == [("third", b"2")]
    heard.clear()
    async with SharedBus(Counting(hub)) as bus, MemoryBus(hub) as other:
        only = await bus.subscribe("m/*", lambda sample: heard.append(("only", sample.payload)))
        publication = await other.publication("m/k", Delivery.STATE)
        assert publication.has_listeners
        await only.close()
        assert not publication.has_listeners


async def test_lazy_and_other_subscribers_of_the_same_share_nothing_but_the_bus() -> None:
    hub = MemoryHub()
    inner = Counting(hub)
    heard: list[tuple[str, str, float]] = []
    async with SharedBus(inner) as bus, MemoryBus(hub) as other:
        bus.widen(["m/w/*"], lazy=True)
        for pattern in ("m/k", "m/w/k"):
            await bus.subscribe(pattern, lambda sample: heard.append(("eager", sample.key, 0.0)))
            for name in ("one", "two"):
                await bus.subscribe(
                    pattern, lambda sample, name=name: heard.append((name, sample.key, sample.came)), lazy=True
                )
        assert (inner.patterns, inner.lazy_patterns) == ({"m/k": 1, "m/w/k": 1}, {"m/k": 1, "m/w/*": 1})
        for key in ("m/k", "m/w/k"):
            await asyncio.sleep(1)
            other.put(key, b"", Delivery.STATE)
        assert heard == [("eager", "m/k", 0.0), ("one", "m/k", 1.0), ("two", "m/k", 1.0)]
        await asyncio.sleep(1)
        assert heard[3:] == [("eager", "m/w/k", 0.0), ("one", "m/w/k", 2.0), ("two", "m/w/k", 2.0)]
        other.put("m/w/l", b"", Delivery.STATE)
        await asyncio.sleep(1)
        assert bus.collect()
        assert len(heard) == 6


async def test_what_a_wide_subscription_brings_goes_to_those_who_asked_for_it_and_to_nobody_else() -> None:
    hub = MemoryHub()
    inner = Counting(hub)
    heard: dict[str, list[str]] = {
        "m/a/*": [],
        "m/*/k": [],
        "m/a/k": [],
        "m/@c/*": [],
        "m/*/*": [],
        "m/**": [],
        "m/k": [],
    }
    async with SharedBus(inner) as bus, MemoryBus(hub) as other:
        bus.widen(["m/*/*"])
        for pattern, keys in heard.items():
            await bus.subscribe(pattern, lambda sample, keys=keys: keys.append(sample.key))
        assert inner.patterns == {"m/*/*": 1, "m/@c/*": 1, "m/**": 1, "m/k": 1}
        for key in ("m/a/k", "m/b/k", "m/a/l", "m/b/l", "m/@c/k", "m/k", "m/a/k"):
            other.put(key, b"", Delivery.STATE)
        await asyncio.sleep(0.01)
    assert heard == {
        "m/a/*": ["m/a/k", "m/a/l", "m/a/k"],
        "m/*/k": ["m/a/k", "m/b/k", "m/a/k"],
        "m/a/k": ["m/a/k", "m/a/k"],
        "m/@c/*": ["m/@c/k"],
        "m/*/*": ["m/a/k", "m/b/k", "m/a/l", "m/b/l", "m/a/k"],
        "m/**": ["m/a/k", "m/b/k", "m/a/l", "m/b/l", "m/k", "m/a/k"],
        "m/k": ["m/k"],
    }
