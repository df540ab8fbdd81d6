"""The bus of a mission that runs: found on this machine, or where somebody says it is; and which mission is meant."""

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import NamedTuple

from lalliance_agents.bus.base import Bus
from lalliance_agents.bus.zenoh_bus import ZenohBus, open_bus
from lalliance_agents.errors import BusError, UserError
from lalliance_agents.suggestions import like
from lalliance_agents.wire.keys import NAME_PATTERN, OPERATOR, Keys, Kind
from mission_control.running import endpoints, running
from mission_control.shell import credentials_from, endpoint_of

#: How long to look for the router, in seconds.
TIMEOUT = 3.0
#: How long to look for a mission on a bus, in seconds.
LOOK = 0.5


async def reach(mission: str, endpoint: str | None, keys: Path | None = None) -> ZenohBus:
    """Connect to the bus of a mission, as an operator.

    Args:
        mission: its name.
        endpoint: the router of its bus; None: where the mission runs on this machine, or else the usual one.
        keys: the folder of keys, if its bus asks for them.

    Raises:
        UserError: it cannot be reached.
    """
    found = _find(mission) if endpoint is None else endpoint
    there = endpoint_of(found, keys)
    shown = credentials_from(keys, OPERATOR)
    try:
        return await open_bus(there, timeout=TIMEOUT, credentials=shown)
    except BusError as error:
        if found is None:
            hint = like(mission, (name for name, _ in running()))
            raise UserError(
                f"mission {mission} is not known to run on this machine, and no router answers at {there}; "
                f"expected a mission started by `lalliance run`, or --connect with the endpoint of its router{hint}"
            ) from None
        reason = str(error)
        raise UserError(f"mission {mission} cannot be reached: {reason[0].lower()}{reason[1:]}") from None


def _find(mission: str) -> str | None:
    """Where the mission of this name runs on this machine, if one is known to."""
    found = endpoints(mission)
    if len(found) > 1:
        raise UserError(f"{len(found)} missions {mission} run here; expected --connect with one of {', '.join(found)}")
    return found[0] if found else None


class Reached(NamedTuple):
    """A bus with a mission on it."""

    mission: str
    endpoint: str
    bus: Bus


@contextlib.asynccontextmanager
async def reached(mission: str | None, endpoint: str | None, keys: Path | None) -> AsyncIterator[Reached]:
    """The mission that is meant and its bus, open for as long as the context lasts.

    Args:
        mission: its name; None: the only one that there is.
        endpoint: see `reach`.
        keys: see `reach`.

    Raises:
        UserError: there is no such mission, or more than one, or it cannot be reached.
    """
    if mission is None and endpoint is None:
        mission = _only_one_here()
    if mission is None:
        async with await _reach_any(endpoint, keys) as bus:
            yield Reached(await _only_one_on(bus), bus.endpoint, bus)
        return
    if not re.match(NAME_PATTERN, mission):
        raise UserError(f"{mission[:80]!r} is not the name of a mission; expected 1 to 64 of A-Z a-z 0-9 _ -")
    async with await reach(mission, endpoint, keys) as bus:
        yield Reached(mission, bus.endpoint, bus)


def _only_one_here() -> str | None:
    """The name of the mission that runs on this machine, if one is known to."""
    names = sorted({name for name, _ in running()})
    if len(names) > 1:
        raise UserError(f"{len(names)} missions run here; expected --mission with one of {', '.join(names)}")
    return names[0] if names else None


async def _reach_any(endpoint: str | None, keys: Path | None) -> ZenohBus:
    there = endpoint_of(endpoint, keys)
    try:
        return await open_bus(there, timeout=TIMEOUT, credentials=credentials_from(keys, OPERATOR))
    except BusError as error:
        if endpoint is None:
            raise UserError(
                f"no mission is known to run on this machine, and no router answers at {there}; "
                "expected a mission started by `lalliance run`, or --connect with the endpoint of its router"
            ) from None
        raise UserError(f"{str(error)[0].lower()}{str(error)[1:]}") from None


async def _only_one_on(bus: ZenohBus) -> str:
    """The name of the one mission on a bus: worlds answer, and robots are there."""
    anybody, keys = Keys("*"), set[str]()
    somebody = asyncio.Event()

    def meet(key: str, present: bool) -> None:
        if present:
            keys.add(key)
            somebody.set()

    watch = await bus.watch_presence(anybody.build(Kind.ALIVE), meet)
    keys |= {sample.key for sample in await bus.query(anybody.build(Kind.SENSE_ROBOT), timeout=LOOK)}
    if not keys:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LOOK):
                await somebody.wait()
    await watch.close()
    names = sorted({name for name in (key.split("/")[1] for key in keys) if re.match(NAME_PATTERN, name)})
    if not names:
        raise UserError(f"no mission is on the bus at {bus.endpoint}; expected one to run there just now")
    if len(names) > 1:
        raise UserError(
            f"{len(names)} missions are on the bus at {bus.endpoint}; expected --mission with one of {', '.join(names)}"
        )
    return names[0]
