"""`lalliance echo`: messages as they come, as text or as JSON."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
import yaml

from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import Keys
from mission_control.reach import reached
from mission_control.watch.absence import told_of_absence
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.patterns import whole_pattern
from mission_control.watch.sighting import Sighting, read
from mission_control.watch.words import printable

#: Letters of a line that are printed.
LONGEST = 2000


async def echo(
    pattern: str, mission: str | None, connect: str | None, keys: Path | None, *, once: bool, as_json: bool
) -> None:
    """Print each message whose key matches `pattern`, until this is cancelled.

    Raises:
        UserError: there is no such mission, or no such key.
    """
    async with reached(mission, connect, keys) as there:
        only = whole_pattern(pattern, there.mission)
        async with (
            Onlooker(there.bus, there.mission, MissionClock(), motivations=False, only=only) as onlooker,
            told_of_absence(onlooker, there.endpoint),
        ):
            async for sighting in onlooker:
                document = plain(sighting, Keys(there.mission))
                typer.echo(json.dumps(document) if as_json else "\n".join([*lines(document), "---"]))
                if once:
                    return


def plain(sighting: Sighting, keys: Keys) -> dict[str, Any]:
    """A sighting as plain data: its key below the mission, and what it says, or why it cannot be read."""
    key = {"key": sighting.key.removeprefix(keys.prefix), "seen_at": sighting.seen_at}
    try:
        _, message = read(sighting, keys)
    except MessageError as error:
        return key | {"unreadable": str(error), "bytes": len(sighting.payload)}
    return key | ({"present": not sighting.gone} if message is None else {"message": message.model_dump()})


def lines(document: dict[str, Any]) -> Iterator[str]:
    """The same as text for a person."""
    yield printable(str(document["key"]))
    said = document.get("message", {name: value for name, value in document.items() if name not in {"key", "seen_at"}})
    text: str = yaml.safe_dump(said, allow_unicode=True, sort_keys=False, width=LONGEST)
    yield from (printable(line, LONGEST) for line in text.rstrip().split("\n"))
