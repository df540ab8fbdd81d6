"""The pace of a replay: when an instant of the recording has come, at a rate, with pauses. It may be changed at any time."""

import asyncio


class Pace:
    """Goes on from 0, in seconds of the recording, as soon as it is made.

    Args:
        rate: seconds of the recording per real second.
        paused: whether to stand still at first.
    """

    def __init__(self, rate: float, *, paused: bool = False) -> None:
        self._loop = asyncio.get_running_loop()
        self._rate = rate
        self._changed = asyncio.Event()
        self._position = 0.0
        #: The loop's time at `_position`; None while it stands still.
        self._since = None if paused else self._loop.time()

    def __repr__(self) -> str:
        return f"<pace {self._rate:g}, {'paused' if self.paused else 'going'} at {self.position:.1f} s>"

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._since is None

    @property
    def position(self) -> float:
        """Which instant of the recording it is now, in seconds."""
        return (
            self._position if self._since is None else self._position + (self._loop.time() - self._since) * self._rate
        )

    def toggle(self) -> None:
        """Stand still, or go on again from there."""
        self._position = self.position
        self._since = self._loop.time() if self._since is None else None
        self._changed.set()

    async def wait_until(self, instant: float) -> None:
        """Wait until `instant` of the recording has come; one that has passed is not waited for, but in a pause."""
        while self.paused or self.position < instant:
            self._changed.clear()
            left = None if self.paused else (instant - self.position) / self._rate
            try:
                async with asyncio.timeout(left):
                    await self._changed.wait()
            except TimeoutError:
                return
