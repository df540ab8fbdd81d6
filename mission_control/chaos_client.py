"""Commands to the world of a running mission, over its bus: one question, one answer."""

from pathlib import Path
from typing import Any

from lalliance_agents.agent.catalog import fresh_incarnation
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import BusError, MessageError, UserError
from lalliance_agents.wire.keys import OPERATOR, WORLD, Keys, Kind
from lalliance_agents.wire.messages import ChaosAnswer, ChaosCommand, decode, encode
from mission_control.running import endpoints
from mission_control.shell import credentials_from, endpoint_of

#: How long to look for the router, and how long to wait for the world's answer, in seconds.
TIMEOUT = 3.0


async def ask(mission: str, endpoint: str | None, keys: Path | None = None, **command: Any) -> ChaosAnswer:
    """What the world of the mission answers to a command.

    Args:
        mission: its name.
        endpoint: the router of its bus; None: where the mission runs on this machine, or else the usual one.
        keys: the folder of keys, if its bus asks for them.
        command: the fields of a `ChaosCommand`.

    Raises:
        UserError: it refuses, or nobody answers.
    """
    found = _find(mission) if endpoint is None else endpoint
    endpoint = endpoint_of(found, keys)
    shown = credentials_from(keys, OPERATOR)
    key = Keys(mission).build(Kind.CHAOS_COMMAND)
    try:
        async with await open_bus(endpoint, timeout=TIMEOUT, credentials=shown) as bus:
            messenger = Messenger(bus, Keys(mission), OPERATOR, fresh_incarnation(), MissionClock().now)
            question = encode(ChaosCommand(**messenger.header(), **command))
            samples = await bus.query(key, question, timeout=TIMEOUT)
    except BusError as error:
        if found is None:
            raise UserError(
                f"mission {mission} is not known to run on this machine, and no router answers at {endpoint}; "
                "expected a mission started by `lalliance run`, or --connect with the endpoint of its router"
            ) from None
        reason = str(error)
        raise UserError(f"mission {mission} cannot be reached: {reason[0].lower()}{reason[1:]}") from None
    try:
        answers = [decode(ChaosAnswer, sample.payload) for sample in samples]
    except MessageError as error:
        raise UserError(f"the answer of mission {mission} at {endpoint} cannot be read: {error}") from None
    answer = next((answer for answer in answers if answer.sender == WORLD), None)
    if answer is None:
        raise UserError(
            f"no world server of mission {mission} answers at {endpoint}; expected the mission to run there just now"
        )
    if not answer.done:
        raise UserError(answer.text)
    return answer


def _find(mission: str) -> str | None:
    """Where the mission of this name runs on this machine, if one is known to."""
    found = endpoints(mission)
    if len(found) > 1:
        raise UserError(f"{len(found)} missions {mission} run here; expected --connect with one of {', '.join(found)}")
    return found[0] if found else None
