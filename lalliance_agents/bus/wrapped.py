"""A bus over another one: it hands all on, and whoever derives from it says what is different."""

from lalliance_agents.bus.base import (
    Answer,
    Bus,
    ConnectionHandler,
    Delivery,
    Handler,
    PresenceHandler,
    Publication,
    Registration,
    Sample,
)


class WrappedBus(Bus):
    """A bus that does what another one does; closing it closes that one.

    Args:
        inner: the bus that does the work.
    """

    def __init__(self, inner: Bus) -> None:
        self._inner = inner

    def put(self, key: str, payload: bytes, delivery: Delivery) -> None:
        """Publish without waiting; lost silently while the bus is down."""
        self._inner.put(key, payload, delivery)

    async def publication(self, key: str, delivery: Delivery) -> Publication:
        """Declare a key that will be published on often."""
        return await self._inner.publication(key, delivery)

    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> Registration:
        """Have `handler` called with each sample whose key matches `pattern`, from about now on."""
        return await self._inner.subscribe(pattern, handler, lazy=lazy)

    def collect(self) -> bool:
        """Have what came until now handled; of a flood only a part. False inside a handler, where it does nothing."""
        return self._inner.collect()

    async def answer(self, pattern: str, handler: Answer) -> Registration:
        """Answer queries that match `pattern` with the samples that `handler` returns."""
        return await self._inner.answer(pattern, handler)

    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - see Bus.query
        """Ask whoever answers `pattern`; all answers that came within `timeout` seconds, possibly none."""
        return await self._inner.query(pattern, payload, timeout=timeout)

    async def announce_presence(self, key: str) -> Registration:
        """Be present as `key` until closed or gone, however abruptly."""
        return await self._inner.announce_presence(key)

    async def watch_presence(self, pattern: str, handler: PresenceHandler) -> Registration:
        """Have `handler` called with (key, True) for each presence there is or comes, and (key, False) when it is gone."""
        return await self._inner.watch_presence(pattern, handler)

    async def watch_connection(self, handler: ConnectionHandler) -> Registration:
        """Have `handler` called with True if the bus is up, or once it is, with False when it goes down, and so on."""
        return await self._inner.watch_connection(handler)

    async def close(self) -> None:
        """Close the inner bus; a second call does nothing."""
        await self._inner.close()
