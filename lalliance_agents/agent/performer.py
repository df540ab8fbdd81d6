"""The body: runs the behaviour set that the mind activated, one at a time.

A set that is stopped is cancelled, and the next one begins only when it has cleaned up after itself; one that does not come
to an end within a limit is left behind with a warning, so that a stuck set cannot hold the robot for ever. What a set does
after it was stopped, return or fail, says nothing about its task any more.
"""

import asyncio
import inspect
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from lalliance_agents.agent.behavior import BehaviorSet, described

_log = logging.getLogger(__name__)

#: How long a cancelled behaviour set may take to clean up, in real seconds.
CLEAN_UP_LIMIT = 2.0


class Performer:
    """Runs behaviour sets.

    Args:
        on_failure: called with the set when its `perform` raised, unless it was stopped before.
        on_return: called with the set when its `perform` returned, unless it was stopped before.
    """

    def __init__(self, on_failure: Callable[[BehaviorSet], None], on_return: Callable[[BehaviorSet], None]) -> None:
        self._on_failure = on_failure
        self._on_return = on_return
        self._running: dict[str, asyncio.Task[None]] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self._told: set[tuple[str, type[BaseException]]] = set()
        # Not waited for any more, but kept: the event loop does not hold on to tasks.
        self._left_behind: set[asyncio.Task[None]] = set()

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
            running.add_done_callback(self._left_behind.discard)

    def stop_all(self) -> None:
        """Cancel every set."""
        for task in list(self._running):
            self.stop(task)

    async def _perform(self, one: BehaviorSet, before: set[asyncio.Task[None]]) -> None:
        await self._let_end(before)
        try:
            await _begun(one)
        except (Exception, SystemExit) as error:
            self._tell(one, error)
            if not _is_stopped():
                self._on_failure(one)
        except asyncio.CancelledError as error:
            if _is_stopped():
                raise
            # Nobody stopped this set: something that it waited for was cancelled.
            self._tell(one, error)
            self._on_failure(one)
        else:
            if not _is_stopped():
                one.returned = True
                self._on_return(one)

    def _tell(self, one: BehaviorSet, error: BaseException) -> None:
        """Log a failure: where it comes from the first time, and in one line from then on."""
        kind = one.task, type(error)
        if kind in self._told:
            _log.error("%s failed again: %s", described(one), type(error).__name__)
        else:
            self._told.add(kind)
            _log.error("%s failed", described(one), exc_info=error)

    async def _let_end(self, before: set[asyncio.Task[None]]) -> None:
        if not before:
            return
        _, late = await asyncio.wait(before, timeout=CLEAN_UP_LIMIT)
        for task in late - self._left_behind:
            _log.warning("%s did not end within %g s of being stopped; going on", task.get_name(), CLEAN_UP_LIMIT)
        self._left_behind |= late
        self._ending -= late

    async def close(self) -> None:
        """Cancel what runs and wait for it to clean up, within the limit."""
        self.stop_all()
        await self._let_end(set(self._ending))


def _begun(one: BehaviorSet) -> Awaitable[Any]:
    working: object = one.perform()
    if not inspect.isawaitable(working):
        raise TypeError(f"perform of {described(one)} is an ordinary function; expected async def perform")
    return working


def _is_stopped() -> bool:
    """Whether the present task was asked to end."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0
