"""What a viewer asks to be done to the mission, checked and handed on to its world."""

from dataclasses import dataclass
from typing import Any, Protocol

from lalliance_agents.bus.zenoh_bus import ZenohBus
from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.mission_errors import one_line
from lalliance_agents.wire.messages import LONGEST_WORD
from mission_control.chaos_client import command
from mission_control.chaos_words import read_content


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a request: whether it was done, and a sentence."""

    done: bool
    text: str


class Disturber(Protocol):
    """Puts faults in force and ends them."""

    async def inject(self, request: Any) -> Outcome:
        """Put the fault in a request in force."""

    async def heal(self, request: Any) -> Outcome:
        """End the fault that a request names, or all."""


class Absent:
    """For a recording, and as long as the mission is not reached: nothing can be done."""

    def __init__(self, reason: str) -> None:
        self._outcome = Outcome(False, reason)

    async def inject(self, request: Any) -> Outcome:
        """Nothing."""
        del request
        return self._outcome

    async def heal(self, request: Any) -> Outcome:
        """Nothing."""
        del request
        return self._outcome


class Operator:
    """Gives commands to the world of a running mission.

    Args:
        mission: which.
        bus: an open bus of that mission.
    """

    def __init__(self, mission: Mission, bus: ZenohBus) -> None:
        self._mission = mission
        self._bus = bus

    async def inject(self, request: Any) -> Outcome:
        """Put a fault in force: `fault` in the fields of a mission file, and `lasts`, a number of seconds or nothing."""
        try:
            wanted = read_content(*_parts(request), self._mission)
        except UserError as error:
            return Outcome(False, str(error))
        return await self._ask(verb="inject", fault=wanted.fault, lasts=wanted.lasts)

    async def heal(self, request: Any) -> Outcome:
        """End the fault called `name`, or all where that is empty."""
        name = request.get("name", "") if isinstance(request, dict) else None
        if not isinstance(name, str):
            return Outcome(False, "this names no fault; expected a name, or an empty one for all")
        return await self._ask(verb="heal", name=one_line(name)[:LONGEST_WORD])

    async def _ask(self, **words: Any) -> Outcome:
        try:
            answer = await command(self._bus, self._mission.name, **words)
        except UserError as error:
            return Outcome(False, str(error))
        return Outcome(answer.done, answer.text)


def _parts(request: Any) -> tuple[dict[str, Any], Any]:
    fault = request.get("fault") if isinstance(request, dict) else None
    if not isinstance(fault, dict):
        raise UserError("this holds no fault; expected the fields of a fault in a mission file")
    return fault, request.get("lasts")
