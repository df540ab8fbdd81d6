"""Commands to the world of a running mission, over its bus: one question, one answer."""

from pathlib import Path
from typing import Any

from lalliance_agents.agent.catalog import fresh_incarnation
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.zenoh_bus import ZenohBus
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.wire.keys import OPERATOR, WORLD, Keys, Kind
from lalliance_agents.wire.messages import ChaosAnswer, ChaosCommand, decode, encode
from mission_control.reach import reach

#: How long to wait for the world's answer, in seconds.
TIMEOUT = 3.0


async def ask(mission: str, endpoint: str | None, keys: Path | None = None, **words: Any) -> ChaosAnswer:
    """What the world of the mission answers to a command.

    Args:
        mission: its name.
        endpoint: the router of its bus; None: where the mission runs on this machine, or else the usual one.
        keys: the folder of keys, if its bus asks for them.
        words: the fields of a `ChaosCommand`.

    Raises:
        UserError: it refuses, or nobody answers.
    """
    async with await reach(mission, endpoint, keys) as bus:
        return await command(bus, mission, **words)


async def command(bus: ZenohBus, mission: str, **words: Any) -> ChaosAnswer:
    """What the world of the mission on `bus` answers to a command, given as the fields of a `ChaosCommand`.

    Raises:
        UserError: it refuses, or nobody answers.
    """
    messenger = Messenger(bus, Keys(mission), OPERATOR, fresh_incarnation(), MissionClock().now)
    question = encode(ChaosCommand(**messenger.header(), **words))
    samples = await bus.query(Keys(mission).build(Kind.CHAOS_COMMAND), question, timeout=TIMEOUT)
    try:
        answers = [decode(ChaosAnswer, sample.payload) for sample in samples]
    except MessageError as error:
        raise UserError(f"the answer of mission {mission} at {bus.endpoint} cannot be read: {error}") from None
    answer = next((answer for answer in answers if answer.sender == WORLD), None)
    if answer is None:
        raise UserError(
            f"no world server of mission {mission} answers at {bus.endpoint}; expected the mission to run there just now"
        )
    if not answer.done:
        raise UserError(answer.text)
    return answer
