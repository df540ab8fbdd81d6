"""The bus as the rest of the project sees it: publish and subscribe, query and reply, presence.

Every handler is called in the event loop of the task that registered it, one sample at a time, in the order in which a
publisher sent (what was sent with different `Delivery` may overtake); never from another thread, never inside `put`. A
participant hears itself. To wake the loop for each message is most of what it costs; who looks at what came in regular
steps anyway subscribes lazily, and collects. A handler must not block; what it raises is logged and counts as its own
failure, never the bus's. Delivery is best effort on every bus: what is published while the bus is down is lost, without an
error, and a flood drops the oldest samples first. Patterns are key expressions: `*` is one chunk, `**` any number of
chunks, and a chunk that starts with `@` is matched by neither.

A key or pattern that is not one, or is too long, raises `ValueError` wherever it is given. After `close`, what is
published is ignored and queries have no answers, while a new declaration is a mistake: `RuntimeError`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import StrEnum
from types import TracebackType
from typing import NamedTuple, Protocol, Self

#: After this silence, in real seconds, a participant that hangs or is cut off counts as gone.
LEASE = 2.0


class Sample(NamedTuple):
    """One message as it arrived."""

    key: str
    payload: bytes
    came: float = 0.0
    """When it came, in seconds of the event loop's clock, if it was subscribed to lazily."""


class Delivery(StrEnum):
    """How much a message matters, from the most urgent down."""

    PRESENCE = "presence"  # activity and heartbeats: urgent, best effort, the newest wins
    STATE = "state"  # last values: reliable, refreshed by their owner
    TELEMETRY = "telemetry"  # what somebody may like to look at


Handler = Callable[[Sample], None]
Answer = Callable[[Sample], list[Sample]]
PresenceHandler = Callable[[str, bool], None]
ConnectionHandler = Callable[[bool], None]


class Registration(Protocol):
    """Something declared on a bus that can be taken back."""

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""


class Publication(Registration, Protocol):
    """The right to publish on one key, for what is sent often."""

    def put(self, payload: bytes) -> None:
        """Publish without waiting; lost silently while the bus is down."""

    @property
    def has_listeners(self) -> bool:
        """Whether somebody subscribes to this key just now, as far as is known."""


class Closing(ABC):
    """Something that is closed on leaving its context."""

    @abstractmethod
    async def close(self) -> None:
        """Close it; a second call does nothing."""

    async def __aenter__(self) -> Self:
        """Return it, open."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        await self.close()


class Bus(Closing):
    """One participant's connection. Leaving the context closes it and all that was declared on it."""

    @abstractmethod
    def put(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Publish without waiting; lost silently while the bus is down."""

    @abstractmethod
    async def publication(self, key: str, delivery: Delivery) -> Publication:
        """Declare a key that will be published on often."""

    @abstractmethod
    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> Registration:
        """Have `handler` called with each sample whose key matches `pattern`, from about now on.

        What is subscribed to lazily does not wake the loop: it waits until somebody collects, or the loop is awake for another
        sample, and comes in its turn between the others.
        """

    @abstractmethod
    def collect(self) -> bool:
        """Have what came until now handled; of a flood only a part. False inside a handler, where it does nothing."""

    @abstractmethod
    async def answer(self, pattern: str, handler: Answer) -> Registration:
        """Answer queries that match `pattern` with the samples that `handler` returns for the query's pattern and payload.

        An answer's key must be matched by the query's pattern; if one is not, the query gets no answer from here.
        """

    @abstractmethod
    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - the bus's own limit, not a cancellation
        """Ask whoever answers `pattern`; all answers that came within `timeout` seconds, possibly none."""

    @abstractmethod
    async def announce_presence(self, key: str) -> Registration:
        """Be present as `key` until closed or gone, however abruptly."""

    @abstractmethod
    async def watch_presence(self, pattern: str, handler: PresenceHandler) -> Registration:
        """Have `handler` called with (key, True) for each presence there is or comes, and (key, False) when it is gone.

        Several announcements of one key are one presence, gone with the last; a watcher that is itself one of the
        announcers may see it flicker meanwhile. While the bus is down, all are gone.
        """

    @abstractmethod
    async def watch_connection(self, handler: ConnectionHandler) -> Registration:
        """Have `handler` called with True if the bus is up, or once it is, with False when it goes down, and so on.

        What comes after its return is handed on after that was told. A bus that goes down without a word is noticed after
        the `LEASE`.
        """
