"""One thing that was seen on a bus: what an onlooker hands on and a recording holds. Pure."""

from typing import NamedTuple

from lalliance_agents.wire.keys import Key, Keys, Kind
from lalliance_agents.wire.messages import Message, decode_at

#: Keys on which nothing is published: that somebody is there is all they say.
PRESENCES = frozenset({Kind.ALIVE, Kind.LAUNCHER})


class Sighting(NamedTuple):
    """A message as it came, or that somebody came or went."""

    seen_at: int
    """The wall clock, in nanoseconds since the epoch; informative."""
    now: float
    """The same instant on the onlooker's own mission clock, in seconds."""
    key: str
    """The whole key."""
    payload: bytes
    """Exactly what was on the bus; of a presence, nothing."""
    gone: bool = False
    """Of a presence: whether it has ended."""


def read(sighting: Sighting, keys: Keys) -> tuple[Key, Message | None]:
    """Which key it is, and the checked message; None for a presence.

    Raises:
        MessageError: it is no key of this mission, or no valid message of the speaker of that key.
    """
    key = keys.parse(sighting.key)
    return key, None if key.kind in PRESENCES else decode_at(key, sighting.payload)
