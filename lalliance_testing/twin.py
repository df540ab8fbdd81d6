"""The simulated engine: a mission in virtual time, which passes only while the test waits for something."""

import math
from collections.abc import Callable
from typing import Any

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.faults import Fault
from lalliance_agents.model.parameters import SLACK
from lalliance_agents.wire.messages import DecisionMade
from lalliance_study.evidence import Witness, collect
from lalliance_study.invariants import judge
from lalliance_study.simulator import Simulator
from mission_control.watch.happened import Happened, happened_in
from world_server.world import Happening


class Twin:
    """Runs one mission in the exact simulator.

    Args:
        mission: a mission that passed `environments.check_options`.
    """

    def __init__(self, mission: Mission) -> None:
        self.events: list[Happened] = []
        self._witness = Witness()
        self._simulator = Simulator(mission, watcher=self._witness)
        self._simulator.follow(self._take)

    def __repr__(self) -> str:
        return f"<Twin {self._simulator!r}>"

    def _take(self, told: Happening | DecisionMade) -> None:
        self.events += happened_in(told, self._simulator.world.elapsed)

    def start(self) -> None:
        """Let time pass until the first trial begins."""
        self.wait(lambda: any(event.kind == "trial" for event in self.events), None)

    @property
    def ended(self) -> str | None:
        """How the mission ended, in words; None while it goes on."""
        return self.events[-1].text if self._simulator.world.over else None

    def wait(self, found: Callable[[], bool], within: float | None) -> bool:
        """Let virtual time pass until `found`."""
        simulator = self._simulator
        until = math.inf if within is None else simulator.now + within + SLACK
        while not found():
            if simulator.world.over or simulator.now >= until:
                return False
            simulator.step()
        return simulator.now <= until

    def inject(self, fault: Fault, spelled: str, lasts: float | None) -> str:
        """Put a fault in force now."""
        del spelled
        return self._simulator.inject(fault, lasts).partition(":")[0]

    def heal(self, name: str) -> None:
        """End a fault now, or all."""
        self._simulator.heal(name)

    def faults(self) -> list[dict[str, Any]]:
        """What became of each fault so far."""
        return self._simulator.world.failures.report()

    def kill(self, what: str) -> None:
        """There is nothing to kill."""
        raise UserError(
            f"a simulated mission has no {what} that could be killed; expected the marker lalliance(engine='real')"
        )

    def conclude(self) -> dict[str, Any]:
        """Run to the end; the summary."""
        self.wait(lambda: False, None)
        return self._simulator.summary()

    def violations(self) -> list[str]:
        """The invariants of campaigns that did not hold."""
        return [f"{one.invariant}: {one.facts}" for one in judge(collect(self._simulator, self._witness))]

    def close(self) -> None:
        """Nothing runs by itself."""
