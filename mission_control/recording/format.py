"""What a recording is made of: the names in it, and the schema of each kind of message. Pure."""

import functools
import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import BODY_OF
from mission_control.watch.gaps import Gap, Moment
from mission_control.watch.sighting import PRESENCES

#: The profile in the header of a recording, and of one that was converted for viewers.
PROFILE = "lalliance"
CONVERTED = "lalliance-json"
#: Metadata records: which mission it is, a time in which nothing was heard, and how the recording ended.
ABOUT = "lalliance/mission"
GAP = "lalliance/gap"
ENDING = "lalliance/ending"
#: The version of this format.
FORMAT = "1"

#: Channels that a file can have; its format numbers them with 16 bits.
MOST_CHANNELS = 60_000
#: Keys that a recording takes which are not of the mission's own robots and tasks: anybody can make up others without end.
MOST_STRANGE = 1_000

PRESENCE = "lalliance.Presence"
_PRESENCE_SCHEMA = {
    "title": "Presence",
    "description": "Whether a process is there, as its liveliness token on the bus says.",
    "type": "object",
    "properties": {"present": {"type": "boolean"}},
    "required": ["present"],
}


class Schema(NamedTuple):
    """The schema of a channel."""

    name: str
    document: Mapping[str, Any]

    def encoded(self) -> bytes:
        """As it stands in the file."""
        return json.dumps(self.document).encode()


@functools.cache
def schema_of(kind: Kind) -> Schema | None:
    """What messages of `kind` hold once they are unpacked; None if nothing is published on its keys."""
    if kind in PRESENCES:
        return Schema(PRESENCE, _PRESENCE_SCHEMA)
    body = BODY_OF.get(kind)
    return None if body is None else Schema(f"lalliance.{body.__name__}", body.model_json_schema())


class About(NamedTuple):
    """Which mission a recording is of."""

    mission: str
    """Its name."""
    text: str
    """The mission file."""
    seed: int
    version: str
    """Of the package that recorded it."""

    def metadata(self) -> dict[str, str]:
        """As it stands in the file."""
        return {**self._asdict(), "seed": str(self.seed), "format": FORMAT}

    @classmethod
    def of(cls, metadata: Mapping[str, str]) -> "About":
        """What a file says.

        Raises:
            KeyError: something is missing.
            ValueError: it is no seed.
        """
        return cls(metadata["mission"], metadata["text"], int(metadata["seed"]), metadata["version"])


def gap_metadata(gap: Gap) -> dict[str, str]:
    """A gap as it stands in a file."""
    return {
        "since": str(gap.since.wall),
        "until": str(gap.until.wall),
        "mission_since": repr(gap.since.mission),
        "mission_until": repr(gap.until.mission),
        "why": gap.why,
        "answered": "yes" if gap.answered else "no",
        "recovered": str(gap.recovered),
    }


def gap_of(metadata: Mapping[str, str]) -> Gap:
    """The gap that a file tells of.

    Raises:
        KeyError: something is missing.
        ValueError: it is no number, or no instant.
    """
    since, until = (
        Moment(int(metadata[name]) / 1e9, int(metadata[name]), float(metadata[f"mission_{name}"]))
        for name in ("since", "until")
    )
    if not all(0 <= one.wall < 2**64 and math.isfinite(one.mission) for one in (since, until)):
        raise ValueError(since, until)
    return Gap(since, until, metadata["why"], metadata["answered"] == "yes", int(metadata["recovered"]))


class Ending(NamedTuple):
    """How a recording ended."""

    reason: str
    dropped: int = 0
    """Messages that came, or may have come, and are not in the file."""

    def metadata(self) -> dict[str, str]:
        """As it stands in the file."""
        return {"reason": self.reason, "dropped": str(self.dropped)}

    @classmethod
    def of(cls, metadata: Mapping[str, str]) -> "Ending":
        """What a file says.

        Raises:
            KeyError: something is missing.
            ValueError: it is no count.
        """
        return cls(metadata["reason"], int(metadata["dropped"]))
