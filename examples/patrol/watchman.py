"""Behaviour sets for robots without a world server; what was inspected bears a stamp that every robot can see."""

import asyncio
from pathlib import Path

from lalliance_agents import AutonomousBehaviorSet, BehaviorSet

STAMPS = Path("inspected")


class Inspect(AutonomousBehaviorSet):
    """Looks at one place and leaves a stamp."""

    @property
    def stamp(self) -> Path:
        """Where a robot sees that the place was inspected, whoever did it."""
        return STAMPS / self.task

    def applicable(self) -> bool:
        """Whether there is anything left to do."""
        return not self.complete()

    def complete(self) -> bool:
        """Whether this robot is done with it, or sees that another one is."""
        return super().complete() or self.stamp.exists()

    async def perform(self) -> None:
        """Take two seconds for it, and return: the task is done."""
        print(f"inspecting the {self.task}", flush=True)
        await asyncio.sleep(2)
        leave(self.stamp)


def leave(stamp: Path) -> None:
    """Stamp a place."""
    stamp.parent.mkdir(exist_ok=True)
    stamp.touch()


def behaviors() -> list[BehaviorSet]:
    """One set for each place."""
    return [Inspect("gate"), Inspect("fence")]
