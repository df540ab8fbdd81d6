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
from mcap.reader import make_reader
from recording.made_up import KEYS, MISSION, TEXT, event
from rich.console import Console

from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import WORLD, Kind
from lalliance_agents.wire.messages import Status, encode
from mission_control.recording.convert import convert
from mission_control.recording.format import GAP, Ending, gap_metadata
from mission_control.recording.reader import Recording, information, sightings
from mission_control.recording.recorder import (
    ABANDONED,
    CUT_OFF,
    LEFT,
    LINGER,
    OVER,
    STOPPED,
    UNREACHED,
    Recorder,
    told,
)
from mission_control.recording.shown import show
from mission_control.recording.writer import RecordingError, RecordingWriter
from mission_control.watch.gaps import DOWN
from mission_control.watch.onlooker import HOLD

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
        self.hub = MemoryHub()

    async def __aenter__(self) -> Self:
        self.robot = MemoryBus(self.hub)
        self._bus = MemoryBus(self.hub)
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


async def test_a_router_that_ends_with_its_mission_makes_no_gap(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        await stage.robot.announce_presence(ALIVE)
        stage.say(status("complete"))
        await asyncio.sleep(1.0)
        stage.hub.go_down()
        reason, after = await stage.ends()
        assert (reason, after < 1.0) == (OVER, True)
        assert told(stage.writer).endswith("; nothing was dropped")
    assert information(stage.path).gaps == ()


async def test_it_ends_when_everybody_has_left_and_all_is_silent(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        await asyncio.sleep(1000.0)  # before anybody comes, it waits
        present = await stage.robot.announce_presence(ALIVE)
        await asyncio.sleep(1.0)
        await present.close()
        await asyncio.sleep(9.0)
        stage.say(b"the world is still there")
        reason, after = await stage.ends()
        # The word ended a silence: it waited for answers of then before it came into the file.
        assert (reason, ABANDONED + HOLD <= after <= ABANDONED + HOLD + 0.2) == (LEFT, True)


async def test_told_to_end_it_waits_for_the_last_words(tmp_path: Path) -> None:
    async with Stage(tmp_path) as stage:
        stage.say(status("running"))
        stage.recorder.stop()
        await asyncio.sleep(0.2)
        stage.say(b"last words")
        assert (await stage.ends())[0] == STOPPED
    assert [one.payload for one in sightings(stage.path)] == [status("running"), b"last words"]


async def test_a_time_in_which_nothing_could_be_heard_stands_in_the_file_and_changes_no_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    remembered = Sample(KEYS.build(Kind.EVENT), event(1, "lifter is there"))
    async with Stage(tmp_path) as stage:
        await stage.robot.answer(KEYS.build(Kind.CHAOS_RULES), lambda _: [Sample(KEYS.build(Kind.CHAOS_RULES), b"")])
        await stage.robot.announce_presence(ALIVE)
        stage.say(status("running"))
        await asyncio.sleep(1.0)
        stage.hub.go_down()
        await stage.robot.answer(KEYS.build(Kind.EVENT), lambda _: [remembered])
        await asyncio.sleep(30.0)  # longer than it would wait for a mission that everybody has left
        stage.hub.come_back()
        await asyncio.sleep(1.0)
        stage.hub.go_down()
        reason, after = await stage.ends()
        assert (reason, UNREACHED - 1.5 <= after <= UNREACHED + 0.2) == (CUT_OFF, True)
        assert "nothing was dropped, but nothing was heard 2 times, for" in told(stage.writer)
    keys = [one.key for one in sightings(stage.path)]
    assert keys.count(ALIVE) == 4
    assert keys.count(remembered.key) == 1
    found = Recording(stage.path)
    assert found.summarized() == found.counted() == information(stage.path)
    counted = found.counted()
    assert counted.messages == len(keys)
    first, last = counted.gaps
    assert (first.why, first.answered, first.recovered, last.answered) == (DOWN, True, 1, False)
    convert(stage.path, tmp_path / "json.mcap")
    with (tmp_path / "json.mcap").open("rb") as file:
        kept = [record.metadata for record in make_reader(file).iter_metadata() if record.name == GAP]
    assert kept == [gap_metadata(gap) for gap in counted.gaps]
    show(counted, Console(width=200))
    shown = capsys.readouterr().out
    assert f"UTC: {first}" in shown
    assert f"UTC: {last}" in shown


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
    broken: list[str] = []
    assert [one.payload for one in sightings(stage.path, broken.append)] == [b"one"]
    assert "it breaks off in the middle of a record" in broken[0]


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
