"""A word on standard error while the bus of whoever looks on is down, so that silence is not taken for peace."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Protocol

from mission_control.shell import warn

#: How long a bus may be down before that is told, in real seconds: a router that is started again takes less.
TOLD_AFTER = 2.0
#: It is told again whenever it has lasted so many times as long.
_AGAIN = 4.0
_LOOK_PERIOD = 0.2


class Looking(Protocol):
    """Whoever looks on."""

    @property
    def away_for(self) -> float | None:
        """How long the bus has been down, in real seconds; None if it is up."""


@contextlib.asynccontextmanager
async def told_of_absence(onlooker: Looking, endpoint: str) -> AsyncIterator[None]:
    """Tell that the router at `endpoint` is not reached, and that it is again, for as long as the context lasts."""
    telling = asyncio.create_task(_tell(onlooker, endpoint))
    try:
        yield
    finally:
        telling.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await telling


async def _tell(onlooker: Looking, endpoint: str) -> None:
    due = TOLD_AFTER
    while True:
        await asyncio.sleep(_LOOK_PERIOD)
        away_for = onlooker.away_for
        if away_for is None:
            if due > TOLD_AFTER:
                warn(f"the bus at {endpoint} is reached again")
            due = TOLD_AFTER
        elif away_for >= due:
            warn(f"{words(away_for)} at {endpoint}; waiting for it")
            due *= _AGAIN


def words(away_for: float) -> str:
    """That the bus is down for so long."""
    return f"the bus has not been reached for {away_for:.0f} s"
