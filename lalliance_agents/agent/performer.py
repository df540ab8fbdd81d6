"""The body: runs the behaviour set that the mind activated, one at a time.

A set that is stopped is cancelled, and the next one begins only when it has cleaned up after itself; one that does not come
to an end within a limit is left behind with a warning, so that a stuck set cannot hold the robot for ever.
"""

import asyncio
import logging
from collections.abc import Callable

from lalliance_agents.agent.behavior import BehaviorSet

_log = logging.getLogger(__name__)

#: How long a cancelled behaviour set may take to clean up, in real seconds.
CLEAN_UP_LIMIT = 2.0


class Performer:
    """Runs behaviour sets.

    Args:
        on_failure: called with the set when its `perform` raised.
        on_return: called with the set when its `perform` returned.
    """

    def __init__(self, on_failure: Callable[[BehaviorSet], None], on_return: Callable[[BehaviorSet], None]) -> None:
        self._on_failure = on_failure
        self._on_return = on_return
        self._running: dict[str, asyncio.Task[None]] = {}
        self._ending: set[asyncio.Task[None]] = set()

    @property
    def task(self) -> str | None:
        """The task whose set was started last and not stopped, if any."""
        return next(reversed(self._running), None)

    def start(self, one: BehaviorSet) -> None:
        """Perform `one` once all sets that were stopped have ended."""
        ending = set(self._ending)
        self._running[one.task] = asyncio.create_task(self._perform(one, ending), name=f"perform {one.task}")

    def stop(self, task: str) -> None:
        """Cancel the set of `task`."""
        running = self._running.pop(task, None)
        if running is not None:
            running.cancel()
            self._ending.add(running)
            running.add_done_callback(self._ending.discard)

    async def _perform(self, one: BehaviorSet, before: set[asyncio.Task[None]]) -> None:
        if before:
            _, late = await asyncio.wait(before, timeout=CLEAN_UP_LIMIT)
            if late:
                _log.warning("a behaviour set did not end within %g s of being cancelled; going on", CLEAN_UP_LIMIT)
        try:
            await one.perform()
        except Exception:
            _log.exception("%r failed", one)
            self._on_failure(one)
        else:
            one.returned = True
            self._on_return(one)

    async def close(self) -> None:
        """Cancel what runs and wait for it to clean up, within the limit."""
        for task in list(self._running):
            self.stop(task)
        if self._ending:
            await asyncio.wait(set(self._ending), timeout=CLEAN_UP_LIMIT)
