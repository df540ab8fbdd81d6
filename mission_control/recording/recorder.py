"""Fills a recording from a bus, until the mission is over or somebody says that it is enough.

What was seen is handed to the system twice a second also when little comes. A mission is over when the world has said so and
everybody has left, or some time after; or when everybody has left and nothing was said for a while, as after a crash of all.
While the bus is down nobody can be seen to be there, so that is waited for longer. Each time in which nothing could be heard
stands in the file.
"""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from lalliance_agents.bus.base import Bus
from lalliance_agents.bus.credentials import Credentials
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.config import Mission
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import Keys, Kind
from lalliance_agents.wire.messages import Status
from mission_control.recording.format import Ending
from mission_control.recording.writer import RecordingError, RecordingWriter
from mission_control.watch.gaps import Gap
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import Sighting, read

#: How long to go on once the world has said that the mission is over, in real seconds.
LINGER = 5.0
#: A mission of which nobody is left is over when nothing was said for so long, in real seconds.
ABANDONED = 10.0
#: How long a bus that is down is waited for, in real seconds.
UNREACHED = 60.0
#: At the end, how long nothing may come before nothing more is expected, and how long to wait for that, in real seconds.
QUIET = 0.3
LAST_WORDS = 3.0

_LOOK_PERIOD = 0.1

OVER = "the mission is over"
LEFT = "nobody was left in the mission"
CUT_OFF = "the bus was not reached any more"
STOPPED = "the recorder was told to end"


class Recorder:
    """Records one mission.

    Args:
        bus: an open bus; the recorder does not close it.
        mission: the mission.
        writer: the recording; the recorder does not end it, but says in it how it ended.
        clock: gives the instants of what is seen.
        ready: called once nothing that is said will be missed.
    """

    def __init__(
        self, bus: Bus, mission: Mission, writer: RecordingWriter, clock: MissionClock, ready: Callable[[], None]
    ) -> None:
        self._ready = ready
        self._writer = writer
        self._gaps: list[Gap] = []
        self._onlooker = Onlooker(bus, mission.name, clock, motivations=True, notice=self._gaps.append)
        self._keys = Keys(mission.name)
        self._status_key = self._keys.build(Kind.STATUS)
        self._loop = asyncio.get_running_loop()
        #: Anybody can make up robots; those of the mission and whoever holds their processes are waited for.
        self._awaited = {self._keys.build(Kind.ALIVE, robot=robot) for robot in mission.robots}
        self._awaited.add(self._keys.build(Kind.LAUNCHER))
        self._present: set[str] = set()
        self._has_begun = False
        self._over_since: float | None = None
        self._last = self._loop.time()
        self._stopping: float | None = None

    @property
    def dropped(self) -> int:
        """Messages that came, or would have come, and are not in the file."""
        return self._onlooker.dropped + self._writer.refused

    @property
    def away_for(self) -> float | None:
        """How long the bus has been down, in real seconds; None if it is up."""
        return self._onlooker.away_for

    def stop(self) -> None:
        """Have the recording end as soon as nothing more comes."""
        self._stopping = self._loop.time()

    async def run(self) -> Ending:
        """Record to the end; how it came. Cancelled, the recording has all that was seen until then.

        Raises:
            RecordingError: the file cannot be written.
        """
        reason = STOPPED
        taking: asyncio.Task[None] | None = None
        try:
            async with self._onlooker:
                self._ready()
                taking = asyncio.create_task(self._take_all())
                reason = await self._wait(taking)
                ended = self._loop.time()
            if reason is OVER:  # a router that ends with its mission makes no gap
                self._gaps[:] = [gap for gap in self._gaps if gap.until.real < ended]
        finally:
            try:
                if taking is not None:
                    await taking  # what still waits, and then the end
                self._write_gaps()
            finally:
                self._writer.ending = Ending(reason, self.dropped)
        return self._writer.ending

    async def _wait(self, taking: "asyncio.Task[None]") -> str:
        """Have the file written on until there is a reason to end it."""
        while (reason := self._reason()) is None:
            await asyncio.wait({taking}, timeout=_LOOK_PERIOD)
            if taking.done():
                taking.result()
            self._write_gaps()
            self._writer.flush_if_due()
        return reason

    def _write_gaps(self) -> None:
        while self._gaps:
            self._writer.add_gap(self._gaps.pop(0))

    async def _take_all(self) -> None:
        async for sighting in self._onlooker:
            self._last = self._loop.time()
            self._note(sighting)
            self._writer.add(sighting)

    def _note(self, sighting: Sighting) -> None:
        """Who is there, and whether the mission is over."""
        if sighting.key == self._status_key:
            with contextlib.suppress(MessageError):
                _, status = read(sighting, self._keys)
                is_over = isinstance(status, Status) and status.mission in {"complete", "failed"}
                self._over_since = (self._over_since or self._last) if is_over else None
        elif sighting.gone:
            self._present.discard(sighting.key)
        elif sighting.key in self._awaited:
            self._present.add(sighting.key)
            self._has_begun = True

    def _reason(self) -> str | None:
        now = self._loop.time()
        quiet = min(now - self._last, self._onlooker.quiet_for)
        if self._stopping is not None:
            done = quiet >= QUIET or now - self._stopping >= LAST_WORDS
            return (OVER if self._over_since else STOPPED) if done else None
        if self._over_since is not None:
            done = now - self._over_since >= LINGER or (not self._present and quiet >= QUIET)
            return OVER if done else None
        if not self._has_begun or self._present:
            return None
        if self.away_for is not None:
            return CUT_OFF if self.away_for >= UNREACHED else None
        return LEFT if quiet >= ABANDONED else None


@contextlib.asynccontextmanager
async def recording(
    writer: RecordingWriter,
    mission: Mission,
    endpoint: str,
    *,
    credentials: Credentials | None,
    clock: MissionClock,
    say: Callable[[str], None],
) -> AsyncIterator[None]:
    """Record all that is said on the bus within the context, and the last words after it.

    Args:
        writer: the recording.
        mission: the mission.
        endpoint: its router, which must be there.
        credentials: what to show to it.
        clock: gives the instants of what is seen.
        say: told when the file cannot be written any more: what is recorded is not disturbed by that.

    Raises:
        BusError: no router answers at `endpoint`.
    """
    async with await open_bus(endpoint, credentials=credentials) as bus:
        listens = asyncio.Event()
        recorder = Recorder(bus, mission, writer, clock, listens.set)
        running = asyncio.create_task(recorder.run())
        running.add_done_callback(lambda done: _tell_failure(done, say))
        listening = asyncio.create_task(listens.wait())
        try:
            await asyncio.wait({running, listening}, return_when=asyncio.FIRST_COMPLETED)
            yield
        finally:
            listening.cancel()
            recorder.stop()
            with contextlib.suppress(RecordingError):
                await running


def _tell_failure(done: "asyncio.Task[Ending]", say: Callable[[str], None]) -> None:
    if not done.cancelled() and (error := done.exception()) is not None:
        say(str(error))


def told(writer: RecordingWriter) -> str:
    """What became of a recording, in a sentence."""
    dropped = writer.ending.dropped
    lost = f"{dropped:,} that came too fast, or on made-up keys, are not in it" if dropped else "nothing was dropped"
    if writer.gaps:
        lost += f", but nothing was heard {_count(writer.gaps, 'time')}, for {writer.missing:.1f} s altogether"
    return f"{_count(writer.written, 'message')} on {_count(writer.keys, 'key')} recorded in {writer.path}; {lost}"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"
