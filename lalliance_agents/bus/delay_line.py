"""Samples on their way to handlers that are to get them later.

One timer waits for the first that is due. What is due at once is delivered in the order in which it came, and no more in one
turn of the loop than an inbox delivers. All that waits is limited, so that a flood of delayed samples cannot fill the memory.
"""

import asyncio
import heapq
from collections.abc import Callable

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.inbox import BATCH, Inlet

#: Size of all that waits, in bytes: of each sample the payload, and `OVERHEAD` for the rest. Some 28,000 announcements.
MOST_LATE = 2**24
OVERHEAD = 512


class DelayLine:
    """What waits to be delivered; instants are seconds of the event loop's clock.

    Args:
        ring: called when the first sample is due, with the instant until which it is to `deliver`.

    Attributes:
        delivers: whether a handler is being called.
    """

    def __init__(self, ring: Callable[[float], object]) -> None:
        self._loop = asyncio.get_running_loop()
        self.delivers = False
        self._ring = ring
        # A heap by due time; of two due at once the first that came, which is why they are numbered.
        self._waiting: list[tuple[float, int, Inlet[Sample], Sample]] = []
        self._pushed = 0
        self._size = 0
        self._timer: asyncio.TimerHandle | None = None

    def __len__(self) -> int:
        return len(self._waiting)

    def push(self, due: float, inlet: Inlet[Sample], sample: Sample) -> bool:
        """Have the sample delivered at `due`, as one that came then; whether there was room for it."""
        size = _size(sample)
        if self._size + size > MOST_LATE:
            return False
        self._size += size
        self._pushed += 1
        heapq.heappush(self._waiting, (due, self._pushed, inlet, sample))
        if self._waiting[0][1] == self._pushed:
            self._arm()
        return True

    def deliver(self, until: float) -> None:
        """Deliver what is due by `until`, but no more than an inbox does in one turn of the loop."""
        if not self._waiting or self._waiting[0][0] > until:
            return
        self.delivers = True
        try:
            for _ in range(BATCH):
                if not self._waiting or self._waiting[0][0] > until:
                    break
                due, _, inlet, sample = heapq.heappop(self._waiting)
                self._size -= _size(sample)
                inlet.deliver(sample._replace(came=due) if inlet.lazy else sample)
        finally:
            self.delivers = False
            self._arm()

    def discard(self, inlet: Inlet[Sample] | None = None) -> None:
        """Let go of what waits for `inlet`; without one, of all."""
        self._waiting = [] if inlet is None else [late for late in self._waiting if late[2] is not inlet]
        heapq.heapify(self._waiting)
        self._size = sum(_size(late[3]) for late in self._waiting)
        self._arm()

    def _arm(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.call_at(self._waiting[0][0], self._due) if self._waiting else None

    def _due(self) -> None:
        self._timer = None
        try:
            # A timer may come early by a rounding; the first is due all the same.
            self._ring(max(self._loop.time(), self._waiting[0][0]))
        finally:
            if self._timer is None:
                self._arm()


def _size(sample: Sample) -> int:
    return len(sample.payload) + OVERHEAD
