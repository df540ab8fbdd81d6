"""The page beside a mission that is launched here: a process of its own, so that it takes nothing from the launcher."""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from lalliance_agents.errors import UserError
from mission_control.processes import Child

#: How long the page may take to be there, in seconds.
TIMEOUT = 15.0


class Page:
    """The page of a mission that is about to run.

    Args:
        mission: the mission file.
        port: its port; 0: a free one.
        keys: the folder of keys, if the bus asks for them.
        speed: mission seconds per real second.

    Attributes:
        say: called with a sentence that says where the page is.
    """

    say: Callable[[str], None]

    def __init__(self, mission: Path, *, port: int, keys: Path | None, speed: float) -> None:
        shown = [] if keys is None else ["--keys", str(keys)]
        self._arguments = ["dashboard", str(mission), "--port", str(port), "--speed", repr(speed), "--wait", *shown]
        self._child: Child | None = None
        self._watching: asyncio.Task[None] | None = None

    async def open(self, endpoint: str) -> None:
        """Show the mission whose router is at `endpoint`, and say where.

        Raises:
            UserError: the page cannot be shown.
        """
        self._child = await Child.start("dashboard", self._with(endpoint), lambda _name, _line: None, keeps_output=True)
        try:
            async with asyncio.timeout(TIMEOUT):
                line = await self._child.read_line()
        except TimeoutError:
            raise UserError(
                f"the page was not there within {TIMEOUT:g} s; expected this machine to be less busy"
            ) from None
        if not line:
            await self._child.wait()
            reason = self._child.last_line.removeprefix("lalliance: ")
            raise UserError(reason or f"the page ended with {self._child.status}")
        self.say(line)
        self._watching = asyncio.create_task(self._watch(self._child))

    async def _watch(self, child: Child) -> None:
        """Say it if the page ends: the mission needs it not."""
        await child.wait()
        self.say(f"the page ended ({child.status}); `lalliance dashboard` shows the mission again")

    def _with(self, endpoint: str) -> Sequence[str]:
        return [*self._arguments, "--connect", endpoint]

    async def stay(self) -> None:
        """Wait until the page ends, or until somebody wants to go on."""
        if self._child is not None:
            with contextlib.suppress(asyncio.CancelledError):
                await self._child.wait()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the page."""
        if self._watching is not None:
            self._watching.cancel()
        if self._child is not None:
            await self._child.end()
