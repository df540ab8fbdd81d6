"""Mission time: the one clock of a process.

All logic is handed instants of mission time, in seconds since the process was born, or since the one was whose work it goes
on with. A mission may run faster than real time; then all its lengths shrink alike, on every machine, and only this file knows.
"""

import asyncio
from collections.abc import Callable


class MissionClock:
    """The event loop's monotonic clock times `speed`, beginning at `since`.

    Args:
        speed: mission seconds per real second, above 0.
        since: mission time as it is now, in seconds; more than 0 for who goes on where another process ended.
    """

    def __init__(self, speed: float = 1.0, *, since: float = 0.0) -> None:
        self._loop = asyncio.get_running_loop()
        self._speed = speed
        self._since = since
        self._born = self._loop.time()

    def now(self) -> float:
        """Mission time, in seconds."""
        return self.at(self._loop.time())

    def at(self, instant: float) -> float:
        """Mission time at an instant of the event loop's clock, in seconds."""
        return self._since + (instant - self._born) * self._speed

    def lasts(self, seconds: float) -> float:
        """How long a length of mission time takes, in real seconds."""
        return seconds / self._speed

    async def sleep_until(self, instant: float) -> None:
        """Wait until mission time `instant`; an instant that has passed still lets other tasks run."""
        await asyncio.sleep(max(self._real(instant) - self._loop.time(), 0.0))

    def call_at(self, instant: float, callback: Callable[[], None]) -> asyncio.TimerHandle:
        """Have `callback` called in the loop at mission time `instant`, give or take the rounding of a number."""
        return self._loop.call_at(self._real(instant), callback)

    def _real(self, instant: float) -> float:
        return self._born + self.lasts(instant - self._since)
