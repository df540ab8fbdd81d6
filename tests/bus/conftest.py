"""The buses under test: an in-memory hub, bare, shared and through faults that hit nothing, and a router with real sessions.

A `Team` makes participants and closes what a test leaves open. `mortal` is a participant that announces a presence and can
be killed without a goodbye: on the real bus that is a process of its own. Nothing here sleeps for a fixed time; `eventually`
polls what no event reports.
"""

import asyncio
import signal
import sys
import threading
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack
from typing import Any, Self

import pytest

from lalliance_agents.bus.base import Bus, Delivery
from lalliance_agents.bus.faulty import FaultyBus
from lalliance_agents.bus.link import LinkRules
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.router import free_endpoint, open_router
from lalliance_agents.bus.shared import SharedBus
from lalliance_agents.bus.wrapped import WrappedBus
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import Keys
from lalliance_agents.wire.messages import LinkRule

PATIENCE = 20.0

#: Published by `linked` until it is heard; an `Ear` does not keep it.
READY = b"ready?"

MORTAL = """
import asyncio, sys
from lalliance_agents.bus.zenoh_bus import open_bus

async def main():
    async with await open_bus(sys.argv[1]) as bus:
        await bus.announce_presence(sys.argv[2])
        await asyncio.Event().wait()

asyncio.run(main())
"""

ROUTER = """
import asyncio, sys
from lalliance_agents.bus.router import open_router

async def main():
    async with await open_router(sys.argv[1]):
        print("listening", flush=True)
        await asyncio.Event().wait()

asyncio.run(main())
"""


class Process:
    """A Python process under a test's control."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self._process = process

    @classmethod
    async def start(cls, stack: AsyncExitStack, program: str, *arguments: str) -> Self:
        pipe = asyncio.subprocess.PIPE
        started = await asyncio.create_subprocess_exec(
            sys.executable, "-c", program, *arguments, stdin=pipe, stdout=pipe, stderr=pipe
        )
        process = cls(started)
        stack.push_async_callback(process.kill)
        return process

    async def first_line(self) -> str:
        assert self._process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            return (await self._process.stdout.readline()).decode().strip()

    def hang(self) -> None:
        self._process.send_signal(signal.SIGSTOP)

    async def kill(self) -> None:
        if self._process.returncode is None:
            self._process.kill()
            await self._process.communicate()

    async def finish(self, text: str = "") -> tuple[int | None, str, str]:
        """Write `text`; wait for the end: exit status, standard output and standard error."""
        async with asyncio.timeout(PATIENCE):
            out, err = await self._process.communicate(text.encode())
        return self._process.returncode, out.decode(), err.decode()


class MemoryTeam:
    def __init__(self, stack: AsyncExitStack) -> None:
        self._stack = stack
        self._hub = MemoryHub()

    async def bus(self) -> Bus:
        return await self._stack.enter_async_context(MemoryBus(self._hub))

    async def mortal(self, key: str) -> Callable[[], Awaitable[None]]:
        bus = MemoryBus(self._hub)
        await bus.announce_presence(key)

        async def kill() -> None:
            bus.kill()

        return kill


class OverMemory(WrappedBus):
    """Over a memory bus, and tells what that one dropped."""

    _inner: MemoryBus

    @property
    def dropped_overflow(self) -> int:
        return self._inner.dropped_overflow

    @property
    def dropped_oversize(self) -> int:
        return self._inner.dropped_oversize


class FaultyMemoryBus(OverMemory, FaultyBus):
    """A memory bus behind faults: on any pattern they look at what comes, and let it all through."""

    def __init__(self, inner: MemoryBus) -> None:
        super().__init__(inner, Keys("m"), "me", MissionClock())
        self._touchable = ["**"]
        self._links = LinkRules(0, [LinkRule(fault="f", senders=["nobody"], receivers=["me"], cut=True)])


class FaultyTeam(MemoryTeam):
    async def bus(self) -> Bus:
        return await self._stack.enter_async_context(FaultyMemoryBus(MemoryBus(self._hub)))


class SharedMemoryBus(OverMemory, SharedBus):
    """A memory bus that others could share, with some of what is subscribed to served by wider subscriptions."""

    def __init__(self, inner: MemoryBus) -> None:
        super().__init__(inner)
        self.widen(["m/*", "m/a/*", "m/@chaos/*"])


class SharedTeam(MemoryTeam):
    async def bus(self) -> Bus:
        return await self._stack.enter_async_context(SharedMemoryBus(MemoryBus(self._hub)))


class ZenohTeam:
    def __init__(self, stack: AsyncExitStack, endpoint: str) -> None:
        self._stack = stack
        self.endpoint = endpoint

    async def bus(self) -> Bus:
        return await self._stack.enter_async_context(await open_bus(self.endpoint, timeout=PATIENCE))

    async def mortal(self, key: str) -> Callable[[], Awaitable[None]]:
        return (await Process.start(self._stack, MORTAL, self.endpoint, key)).kill


class Ear:
    """A handler that remembers all but `READY`, and in which thread it was called."""

    def __init__(self):
        self.ready = set()
        self.samples = []
        self.threads = set()
        self._grown = asyncio.Event()

    def __call__(self, sample):
        if sample.payload == READY:
            self.ready.add(sample.key)
            return
        self.samples.append(sample)
        self.threads.add(threading.get_ident())
        self._grown.set()

    @property
    def payloads(self):
        return [sample.payload for sample in self.samples]

    async def until(self, payload):
        async with asyncio.timeout(PATIENCE):
            while all(sample.payload != payload for sample in reversed(self.samples)):
                self._grown.clear()
                await self._grown.wait()


class Watch:
    """A presence handler that remembers."""

    def __init__(self):
        self.news = []
        self.threads = set()
        self._grown = asyncio.Event()

    def __call__(self, key, present):
        self.news.append((key, present))
        self.threads.add(threading.get_ident())
        self._grown.set()

    async def until(self, *news):
        async with asyncio.timeout(PATIENCE):
            while tuple(self.news[-len(news) :]) != news:
                self._grown.clear()
                await self._grown.wait()


@pytest.fixture(params=["memory", "faulty", "shared", "zenoh"])
async def team(request: pytest.FixtureRequest) -> AsyncIterator[MemoryTeam | ZenohTeam]:
    async with AsyncExitStack() as stack:
        if request.param == "memory":
            yield MemoryTeam(stack)
        elif request.param == "faulty":
            yield FaultyTeam(stack)
        elif request.param == "shared":
            yield SharedTeam(stack)
        else:
            router = await stack.enter_async_context(await open_router(free_endpoint()))
            yield ZenohTeam(stack, router.endpoint)


@pytest.fixture
def eventually() -> Callable[[Callable[[], Any]], Awaitable[None]]:
    """Wait until a condition holds; the condition may be a coroutine function."""

    async def wait(condition: Callable[[], Any]) -> None:
        async with asyncio.timeout(PATIENCE):
            while True:
                holds = condition()
                if await holds if asyncio.iscoroutine(holds) else holds:
                    return
                await asyncio.sleep(0.005)

    return wait


@pytest.fixture
async def run_python() -> AsyncIterator[Callable[..., Awaitable[Process]]]:
    """Start a Python program, given as text, with arguments; killed when the test is over."""
    async with AsyncExitStack() as stack:
        yield lambda program, *arguments: Process.start(stack, program, *arguments)


@pytest.fixture
def run_router(run_python: Callable[..., Awaitable[Process]]) -> Callable[[str], Awaitable[Process]]:
    """Start a router in a process of its own; returns once it listens."""

    async def run(endpoint: str) -> Process:
        process = await run_python(ROUTER, endpoint)
        assert await process.first_line() == "listening"
        return process

    return run


@pytest.fixture
def linked(eventually):
    """Wait until what `bus` puts on `key` is heard by `ear`."""

    async def link(bus, key, ear):
        def heard():
            bus.put(key, READY, Delivery.STATE)
            return key in ear.ready

        await eventually(heard)

    return link


@pytest.fixture
def asked(eventually):
    """Ask until `count` answers come; return the payloads, sorted."""

    async def ask(bus, pattern, count, payload=b""):
        replies = []

        async def enough():
            replies[:] = await bus.query(pattern, payload, timeout=PATIENCE)
            return len(replies) == count

        await eventually(enough)
        return sorted((reply.key, reply.payload) for reply in replies)

    return ask


@pytest.fixture
def make_ear():
    return Ear


@pytest.fixture
def make_watch():
    return Watch
