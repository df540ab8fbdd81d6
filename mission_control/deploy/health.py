"""Whether a process of a mission is well: asked over its bus, so that the answer is true of router, network and process.

A robot answers who asks for its greeting, and the world who asks how the tasks stand; both do so in the event loop that does
all their work, so that one that hangs does not answer. A router is well if it lets one of its own in.
"""

from pathlib import Path

from lalliance_agents.bus.credentials import ROUTER
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.errors import BusError, LallianceError
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from mission_control.shell import credentials_from, endpoint_of

#: How long to wait for the router, and how long for the answer, in seconds.
TIMEOUT = 2.0


class IllnessError(LallianceError):
    """Somebody does not answer."""


async def ask(mission: str | None, robot: str | None, connect: str | None, keys: Path | None) -> str:
    """What is well, in a sentence.

    Args:
        mission: its name; None: ask only whether the router is there.
        robot: which robot to ask; None: the world.
        connect: where the router is; None: at the usual place.
        keys: the folder of keys, with those of whoever is asked, if the bus asks for them.

    Raises:
        IllnessError: nobody answers.
        KeysError: the keys cannot be used.
    """
    endpoint, name = endpoint_of(connect, keys), (ROUTER if mission is None else robot or WORLD)
    shown = credentials_from(keys, name)
    try:
        async with await open_bus(endpoint, timeout=TIMEOUT, credentials=shown) as bus:
            if mission is None:
                return f"the router at {endpoint} is well"
            kind = Kind.HELLO if robot else Kind.SENSE_TASK
            answers = await bus.query(Keys(mission).build(kind, robot=robot or "*"), timeout=TIMEOUT)
    except BusError as error:
        raise IllnessError(str(error)) from None
    who = f"robot {robot}" if robot else "the world"
    if not answers:
        raise IllnessError(f"{who} of mission {mission} does not answer at {endpoint}")
    return f"{who} of mission {mission} is well"
