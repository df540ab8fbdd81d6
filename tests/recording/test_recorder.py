"""When a recording ends, and that all that was seen until then is in it."""

import asyncio
import contextlib
import os
import resource
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import pytest
from recording.made_up import KEYS, MISSION, TEXT

from lalliance_agents.bus.base import Delivery
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import WORLD, Kind
from lalliance_agents.wire.messages import Status, encode
from mission_control.recording.format import Ending
from mission_control.recording.reader import sightings
from mission_control.recording.recorder import ABANDONED, LEFT, LINGER, OVER, STOPPED, Recorder
from mission_control.recording.writer import RecordingError, RecordingWriter

pytestmark = pytest.mark.virtual_time

STATUS = KEYS.build(Kind.STATUS)
ALIVE = KEYS.build(Kind.ALIVE, robot="lifter")


def status(mission: str) -> bytes:
    header = {"sender": WORLD, "incarnation": 1, "seq": 1, "at": 1.0}
    rest = {"trial": 1, "trials": 1, "learning": "adaptive", "elapsed": 1.0, "tasks": {}, "robots": {}}
    return encode(Status(**header, mission=mission, **rest))  # type: ignore[arg-type]


class Stage:
    """A recorder at work, and a robot on the same bus."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "a.mcap"
        self._hub = MemoryHub()

    async def __aenter__(self) -> Self:
        self.robot = MemoryBus(self._hub)
        self._bus = MemoryBus(self._hub)
        self.writer = RecordingWriter(self.path, MISSION, TEXT)
        listens = asyncio.Event()
        self.recorder = Recorder(self._bus, MISSION, self.writer, MissionClock(), listens.set)
        self.running = asyncio.create_task(self.recorder.run())
        await listens.wait()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._bus.close()
        await self.robot.close()
        self.writer.__exit__(None, None, None)

    def say(self, payload: bytes) -> None:
        self.robot.put(STATUS, payload, Delivery.STATE)

    async def ends(self) -> tuple[str, float]:
        """Why it ends, and in how many seconds from now."""
        loop = asyncio.get_running_loop()
        before = loop.time()
        ending = await self.running
        return ending.reason, round(loop.time() - before, 1)


async def test_it_ends_when_the_mission_is_over_and_all_have_left(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        present = await stage.robot.announce_presence(ALIVE)
        stage.say(status("running"))
        await asyncio.sleep(60.0)
        stage.say(status("complete"))
        await asyncio.sleep(1.0)
        assert not stage.running.done()
        await present.close()
        reason, after = await stage.ends()
        assert (reason, 0.3 <= after <= 0.5) == (OVER, True)
    assert [(one.key, one.payload, one.gone) for one in sightings(stage.path)] == [
        (ALIVE, b"", False),
        (STATUS, status("running"), False),
        (STATUS, status("complete"), False),
        (ALIVE, b"", True),
    ]


async def test_who_does_not_leave_is_not_waited_for(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        await stage.robot.announce_presence(ALIVE)
        stage.say(status("failed"))
        reason, after = await stage.ends()
        assert (reason, LINGER <= after <= LINGER + 0.2) == (OVER, True)


async def test_it_ends_when_everybody_has_left_and_all_is_silent(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        await asyncio.sleep(1000.0)  # before anybody comes, it waits
        present = await stage.robot.announce_presence(ALIVE)
        await asyncio.sleep(1.0)
        await present.close()
        await asyncio.sleep(9.0)
        stage.say(b"the world is still there")
        reason, after = await stage.ends()
        assert (reason, ABANDONED <= after <= ABANDONED + 0.2) == (LEFT, True)


async def test_told_to_end_it_waits_for_the_last_words(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        stage.say(status("running"))
        stage.recorder.stop()
        await asyncio.sleep(0.2)
        stage.say(b"last words")
        assert (await stage.ends())[0] == STOPPED
    assert [one.payload for one in sightings(stage.path)] == [status("running"), b"last words"]


async def test_cancelled_it_has_all_that_was_seen_until_then(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        for number in range(300):
            stage.say(b"%d" % number)
        await asyncio.sleep(0.0)
        stage.running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await stage.running
        assert stage.writer.ending == Ending(STOPPED, 0)
        seen = stage.writer.written
    payloads = [one.payload for one in sightings(stage.path)]
    assert payloads == [b"%d" % number for number in range(seen)]
    assert seen > 0


async def test_a_full_disk_is_told_in_a_sentence_and_leaves_what_went_before(tmp_path: Path) -> None:
    with contextlib.ExitStack() as limited:
        async with Stage(tmp_path) as stage:
            stage.say(b"one")
            await asyncio.sleep(0.5)
            stage.writer.flush()
            limited.enter_context(limited_files(stage.path.stat().st_size + 50))
            stage.say(os.urandom(10_000))
            with pytest.raises(
                RecordingError, match=r"a\.mcap: the recording cannot be written any more \(File too la"
            ):
                await stage.running
    told: list[str] = []
    assert [one.payload for one in sightings(stage.path, told.append)] == [b"one"]
    assert "it breaks off in the middle of a record" in told[0]


@contextlib.contextmanager
def limited_files(size: int) -> Iterator[None]:
    """No file of this process can grow beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
