"""Whoever keeps a mission's world server running: it is started, and started again when it dies of a signal or a crash.

A world server that ends by itself has said why, with its summary or a sentence, and is not started again. One that dies time
and again is given up, unless the mission gets on between its deaths: a deterministic crash at one instant of the mission
would come back for ever, while somebody who kills a server now and then only holds the mission up.
"""

import json
from collections.abc import Sequence
from typing import Any, Protocol

from lalliance_agents.errors import LallianceError, UserError
from lalliance_agents.wire.messages import Status
from mission_control.processes import Child, OnLine
from mission_control.watch.sighting import Sighting

#: How often a world server that dies is started again, while the mission does not get on.
RESTARTS = 20
#: The mission has got on when it is this much further than ever before, in mission seconds.
PROGRESS = 1.0
#: Exit statuses with which a world server ends by itself: complete, not complete, bad input.
_BY_ITSELF = frozenset({0, 1, 2})


class View(Protocol):
    """Where a launcher shows what happens."""

    def take(self, sighting: Sighting) -> None:
        """Something of the mission was seen on the bus."""

    def locate(self, mission: str, endpoint: str) -> None:
        """The mission's bus is there."""

    def say(self, text: str) -> None:
        """Something happened to a process."""


class LaunchError(LallianceError):
    """A mission that could not be brought to its end."""


class Keeper:
    """Keeps the world server of one mission.

    Args:
        arguments: of its command; the journal is among them.
        first: further arguments for its first life.
        view: where to say that it is started again.
        on_line: called with each line that it writes to standard error.
    """

    def __init__(self, arguments: Sequence[str], first: Sequence[str], view: View, on_line: OnLine) -> None:
        self._arguments = [*arguments]
        self._first = [*first]
        self._view = view
        self._on_line = on_line
        #: Its process, if it was started.
        self.child: Child | None = None
        self._deaths = 0
        self._furthest = (0, 0.0)

    def __repr__(self) -> str:
        return f"<keeper of {self.child}, {self._deaths} deaths>"

    async def start(self) -> None:
        """Start it for the first time."""
        self.child = await self._start(self._first)

    async def _start(self, more: Sequence[str] = ()) -> Child:
        return await Child.start("world", [*self._arguments, *more], self._on_line, keeps_output=True)

    def heard(self, status: Status) -> None:
        """How far the mission is."""
        trial, elapsed = self._furthest
        if status.trial > trial or (status.trial == trial and status.elapsed >= elapsed + PROGRESS):
            self._furthest = (status.trial, status.elapsed)
            self._deaths = 0

    async def summary(self) -> dict[str, Any]:
        """The summary of the mission, when the world server has ended by itself.

        Raises:
            UserError: it was given something that it cannot use.
            LaunchError: it ended without a summary, or died too often.
        """
        while self.child is not None:
            output = await self.child.read_all()
            code = await self.child.wait()
            if code in _BY_ITSELF:
                return self._read(self.child, output)
            self._deaths += 1
            if self._deaths > RESTARTS:
                break
            self._view.say(f"the world server ended ({self.child.status}); starting it again")
            self.child = await self._start()
        raise LaunchError(f"the world server ended {self._deaths} times without a summary ({_end_of(self.child)}")

    def _read(self, child: Child, output: str) -> dict[str, Any]:
        """The last line of the world's output; what its environment may have printed stands before."""
        if child.exit_code == 2:
            raise UserError(child.last_line.removeprefix("lalliance: "))
        try:
            summary: dict[str, Any] = json.loads(output.splitlines()[-1])
        except (ValueError, IndexError):
            raise LaunchError(f"the world server ended without a summary ({_end_of(child)}") from None
        return summary

    async def end(self) -> None:
        """End it, if it runs."""
        if self.child is not None:
            await self.child.end()


def _end_of(child: Child | None) -> str:
    return "never started)" if child is None else f"at last {child.status}): {child.last_line}"
