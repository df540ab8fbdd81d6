"""An environment of one's own: beds that dry out while nobody waters them."""

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from lalliance_agents.config import Mission, misplaced
from lalliance_agents.model.parameters import SLACK, Record
from world_server.environments.base import EventDriven, TaskView, Work


class DryingBeds(EventDriven):
    """A bed is complete once it is wet through; until then it loses what it got when nobody waters it."""

    class Options(Record):
        """What a mission may say below `environment`."""

        drying: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = 0.05
        """Share of a bed's water that is lost in a second without anybody."""

    @classmethod
    def check(cls, mission: Mission) -> None:
        """Refuse what this environment does not know."""
        super().check(mission)
        for name, task in mission.tasks.items():
            if task.after or task.arrives:
                raise misplaced(("tasks", name), "a bed is there from the start; expected neither after nor arrives")

    def __init__(self, mission: Mission, *, seed: int) -> None:  # noqa: ARG002 - nothing here is random
        """Begin a trial."""
        self._drying = self.Options.model_validate(mission.environment.options).drying
        self._own_times = {
            (robot, bed): time for robot, spec in mission.robots.items() for bed, time in spec.tasks.items()
        }
        self._wet = dict.fromkeys(mission.tasks, 0.0)
        self._complete: set[str] = set()
        self._watering: dict[str, dict[str, float]] = {}

    def next_change(self, actions: Mapping[str, Work]) -> float:
        """When the next bed is complete."""
        return min((self._time_left(bed, rates) for bed, rates in self._rates(actions).items()), default=math.inf)

    def sense(self) -> dict[str, TaskView]:
        """What robots see of each bed."""
        return {bed: TaskView(bed in self._complete, bed not in self._complete, wet) for bed, wet in self._wet.items()}

    def _rates(self, actions: Mapping[str, Work]) -> dict[str, dict[str, float]]:
        """Who waters which bed how fast, in shares per second."""
        rates: dict[str, dict[str, float]] = {}
        for robot, work in actions.items():
            if (robot, work.task) in self._own_times and work.task not in self._complete and work.pace > 0:
                rates.setdefault(work.task, {})[robot] = work.pace / self._own_times[robot, work.task]
        return rates

    def _time_left(self, bed: str, rates: Mapping[str, float]) -> float:
        return max(1 - self._wet[bed], 0.0) / sum(rates.values())

    def _take_up(self, actions: Mapping[str, Work]) -> None:
        self._watering = self._rates(actions)

    def _advance(self, dt: float) -> None:
        for bed in self._wet.keys() - self._complete:
            rate = sum(self._watering[bed].values()) if bed in self._watering else -self._drying
            self._wet[bed] = min(max(self._wet[bed] + rate * dt, 0.0), 1.0)

    def _settle(self) -> list[tuple[str, tuple[str, ...]]]:
        """Which beds are complete by now, and by whose work."""
        due = [bed for bed, rates in self._watering.items() if self._time_left(bed, rates) <= SLACK]
        self._complete.update(due)
        return [(bed, tuple(sorted(self._watering.pop(bed)))) for bed in due]
