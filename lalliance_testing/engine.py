"""What moves a mission that a test has in its hands, as the test sees it."""

from collections.abc import Callable
from typing import Any, Protocol

from lalliance_agents.faults import Fault
from mission_control.watch.happened import Happened


class Engine(Protocol):
    """A mission that is moved by real processes, or by the simulator."""

    #: All that has happened so far; only ever grows.
    events: list[Happened]

    def start(self) -> None:
        """Have the mission run, until its first trial has begun.

        Raises:
            LallianceError: it could not be brought to run.
        """

    @property
    def ended(self) -> str | None:
        """How the mission ended, in words; None while it goes on."""

    def wait(self, found: Callable[[], bool], within: float | None) -> bool:
        """Let time pass until `found`; whether it was, before the mission's end or `within` mission seconds."""

    def inject(self, fault: Fault, spelled: str, lasts: float | None) -> str:
        """Put a fault in force, which is also `spelled` as JSON; its name.

        Raises:
            UserError: the world refuses.
        """

    def heal(self, name: str) -> None:
        """End the fault `name`, or all if that is empty.

        Raises:
            UserError: the world refuses.
        """

    def faults(self) -> list[dict[str, Any]]:
        """What became of each fault so far, in the words of the summary."""

    def kill(self, what: str) -> None:
        """Kill the `router` or the `world` server.

        Raises:
            UserError: there is none.
        """

    def conclude(self) -> dict[str, Any]:
        """Let the mission run to its end; its summary.

        Raises:
            LallianceError: it ended without one.
        """

    def violations(self) -> list[str]:
        """What did not hold in the mission that is over, as far as the engine can tell, a sentence for each."""

    def close(self) -> None:
        """Have nothing left that runs."""
