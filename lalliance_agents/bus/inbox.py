"""What every bus does with what arrives: queue it, hand it to the loop in batches, call the handlers one by one.

Anything may be pushed from any thread; handlers run only inside the event loop, in the order of the pushes, at most `BATCH`
per turn of the loop, so that a flood cannot starve the other tasks. The queue is bounded: when it is full the oldest
message is dropped and counted, but never an inlet's that must `keep` all (a presence lost would stay wrong for ever).
What a handler raises is logged once per inlet and kind of exception. Nothing here knows which bus it serves.
"""

import asyncio
import logging
import math
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from lalliance_agents.bus.base import Answer, Bus, Sample
from lalliance_agents.bus.patterns import check_key, matches
from lalliance_agents.wire.messages import MAX_PAYLOAD

#: Messages handled in one turn of the loop.
BATCH = 256
#: Messages that may wait; beyond it the oldest are dropped. At the largest payload this is 512 MiB.
CAPACITY = 4096
#: When messages throng, the loop takes what came in so many seconds at once.
REST = 0.001
#: Who collects often waits no longer than this for the next collection, in seconds.
LONGEST_REST = 0.05

Raw = TypeVar("Raw")

_logger = logging.getLogger(__name__)


class Inlet(Generic[Raw]):
    """One registration's way from the inbox to its handler; `Raw` is a message as the bus at hand represents it.

    Attributes:
        is_open: false once the registration is taken back; messages still queued are then discarded.
        keep: whether its messages survive a flood.
        lazy: whether its messages wait until the loop is awake for others, or collects.
    """

    def __init__(
        self,
        name: str,
        accept: Callable[[Raw], object],
        *,
        discard: Callable[[Raw], object] | None = None,
        keep: bool = False,
        lazy: bool = False,
    ) -> None:
        self.is_open = True
        self.keep = keep
        self.lazy = lazy
        self._name = name
        self._accept = accept
        self._discard = discard
        self._reported: set[type[Exception]] = set()

    def __repr__(self) -> str:
        return f"<inlet {self._name}, {'open' if self.is_open else 'closed'}>"

    def deliver(self, raw: Raw) -> None:
        """Have the message handled; only in the loop."""
        if not self.is_open:
            self.discard(raw)
            return
        try:
            self._accept(raw)
        except Exception as error:  # a handler's failure is its own, never the bus's
            self._report(error)

    def discard(self, raw: Raw) -> None:
        """Let go of a message that will not be handled; in any thread."""
        if self._discard is not None:
            self._discard(raw)

    def _report(self, error: Exception) -> None:
        if type(error) not in self._reported:
            self._reported.add(type(error))
            _logger.error(
                "The handler of %s raised %s; the same again will not be logged.",
                self._name,
                type(error).__name__,
                exc_info=error,
            )


_Queued = tuple[Inlet[Any], Any]


class Inbox:
    """The queue between whoever receives and the event loop.

    While there is room, a push takes no lock: each step on a deque is one that no other thread can come between. Taking out
    is locked, once a batch, as messages must leave in order.

    Threads that push and the loop hold Python's lock in turns. A loop that is woken by each message takes the lock from the
    thread that has just pushed it, finds nothing more and falls asleep, and most of the time goes into these changes. So when
    messages come faster than about two in a millisecond, the loop rests for one and then takes all that came. A lazy inlet's
    messages do not wake it at all, unless they would fill a batch.

    Args:
        wake: has a function called once in the loop: `loop.call_soon_threadsafe`, or `loop.call_soon` without threads.
        loop: the loop, if it is to rest when messages throng.

    Attributes:
        dropped_overflow: messages dropped because the queue was full.
        dropped_oversize: messages dropped because they were larger than `MAX_PAYLOAD`.
    """

    def __init__(
        self, wake: Callable[[Callable[[], None]], object], loop: asyncio.AbstractEventLoop | None = None
    ) -> None:
        self.dropped_overflow = 0
        self.dropped_oversize = 0
        self._wake = wake
        self._lock = threading.Lock()
        self._waiting: deque[_Queued] = deque()
        # Older than all that waits: the batch at hand, and what must be kept but reached the old end of a full queue.
        self._ahead: deque[_Queued] = deque()
        self._woken = False
        self._delivers = False
        self._closed = False
        self._loop = loop
        self._rests = False
        self._emptied = self._next_collection = -math.inf
        # Messages since the queue was last empty.
        self._found = 0

    def __len__(self) -> int:
        return len(self._waiting) + len(self._ahead)

    def admits(self, size: int) -> bool:
        """Whether a payload of `size` bytes is accepted; one that is not is counted. In any thread."""
        if size <= MAX_PAYLOAD:
            return True
        with self._lock:
            self.dropped_oversize += 1
        return False

    def push(self, inlet: Inlet[Raw], raw: Raw) -> None:
        """Queue a message; in any thread."""
        self._waiting.append((inlet, raw))
        if len(self._waiting) > CAPACITY:
            self._make_room()
        if self._closed:  # asked last, so that nothing stays that came while it closed
            self.close()
        elif not self._woken and (not inlet.lazy or len(self._waiting) >= BATCH):
            self._woken = True  # two threads may both wake it: a turn too many, and no harm
            self._wake_up()

    def collect(self) -> bool:
        """Deliver what waits, as far as it is a batch; only in the loop. False inside a handler, where it does nothing.

        Where many collect, this comes at most as often as the loop would be woken, and leaves others as much time as it took.
        But one that was held up itself, as a stopped process is, must not make the next ones wait for as long.
        """
        if self._delivers:
            return False
        if len(self) > 0 and not self._collected_just_now():
            began = self._time()
            try:
                self._deliver_batch()
            finally:
                ended = self._time()
                self._next_collection = ended + min(max(ended - began, REST), LONGEST_REST)
                if len(self) > 0 and not self._woken:
                    self._woken = True
                    self._wake_up()
        return True

    def _collected_just_now(self) -> bool:
        return self._loop is not None and self._loop.time() < self._next_collection

    def _time(self) -> float:
        return 0.0 if self._loop is None else self._loop.time()

    def close(self) -> None:
        """Discard all that waits and all that comes; a second call does nothing."""
        self._closed = True
        with self._lock:
            left = [queue.popleft() for queue in (self._ahead, self._waiting) for _ in range(len(queue))]
        for inlet, raw in left:
            inlet.discard(raw)

    def _make_room(self) -> None:
        with self._lock:
            if len(self._waiting) <= CAPACITY:
                return
            oldest = self._waiting.popleft()
            if oldest[0].keep:
                self._ahead.append(oldest)
                return
            self.dropped_overflow += 1
        oldest[0].discard(oldest[1])

    def _wake_up(self) -> None:
        try:
            self._wake(self._drain)
        except RuntimeError:  # the loop is closed: nobody will ever read this
            self.close()

    def _drain(self) -> None:
        try:
            self._deliver_batch()
        finally:
            self._go_on()

    def _deliver_batch(self) -> None:
        self._take_batch()
        ahead = self._ahead
        self._delivers = True
        try:
            for _ in range(BATCH):
                if not ahead:
                    break
                inlet, raw = ahead.popleft()
                inlet.deliver(raw)
        finally:
            self._delivers = False

    def _go_on(self) -> None:
        """Have the loop woken again: at once if something waits, after a rest if messages throng, else by the next push."""
        if len(self) > 0:
            self._wake_up()
        elif self._loop is not None and self._throng(self._loop.time()):
            self._loop.call_later(REST, self._drain)
        else:
            self._woken = False
            if len(self) > 0:  # it came since
                self._woken = True
                self._wake_up()

    def _throng(self, now: float) -> bool:
        """Whether so many messages come that each of them would find the loop just asleep."""
        self._rests = now - self._emptied < REST / 2 or (self._rests and self._found > 1)
        self._emptied, self._found = now, 0
        return self._rests

    def _take_batch(self) -> None:
        with self._lock:
            if not self._closed:
                count = min(BATCH - len(self._ahead), len(self._waiting))
                self._ahead.extend([self._waiting.popleft() for _ in range(count)])
                self._found += count


class QueuedBus(Bus):
    """A bus whose samples wait in an inbox for the event loop."""

    _inbox: Inbox

    def collect(self) -> bool:
        """Have what came until now handled; of a flood only a part. False inside a handler, where it does nothing."""
        return self._inbox.collect()

    @property
    def dropped_overflow(self) -> int:
        """Messages dropped on arrival because too many were waiting for the loop."""
        return self._inbox.dropped_overflow

    @property
    def dropped_oversize(self) -> int:
        """Messages dropped on arrival because they were larger than `MAX_PAYLOAD`."""
        return self._inbox.dropped_oversize


class Inquiry:
    """The replies to one query, gathered until the last has come or the time is over. Lives in one event loop.

    Attributes:
        replies: those that came, at most the newest `CAPACITY`; may be appended to in any thread.
    """

    def __init__(self) -> None:
        self.replies: deque[Sample] = deque(maxlen=CAPACITY)
        self._complete = asyncio.Event()

    def finish(self) -> None:
        """No further reply will come; only in the loop."""
        self._complete.set()

    async def result(self, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - the bus's own limit, not a cancellation
        """All replies that came until the last one, or within `timeout` seconds."""
        try:
            async with asyncio.timeout(timeout):
                await self._complete.wait()
        except TimeoutError:
            pass
        return list(self.replies)


def answers(handler: Answer, ask: Sample) -> list[Sample]:
    """What `handler` answers to `ask`, checked before the first of it is sent.

    Raises:
        ValueError: if an answer's key is not a key, or not one that was asked for.
    """
    samples = handler(ask)
    for sample in samples:
        check_key(sample.key)
        if not matches(ask.key, sample.key):
            raise ValueError(f"the answer {sample.key!r} is not what was asked for: {ask.key!r}")
    return samples


def check_timeout(timeout: float) -> None:
    """Accept a time to wait for replies, in seconds.

    Raises:
        ValueError: if `timeout` is negative, not a number, or longer than a day.
    """
    if not 0 <= timeout <= 86400:
        raise ValueError(f"a timeout of {timeout} s: expected 0 to 86400")
