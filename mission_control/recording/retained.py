"""The last values of a recorded mission: who comes late to a replay is answered as their owners would have answered. Pure."""

from collections import deque

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.patterns import matches
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import Keys, Kind
from mission_control.watch.sighting import Sighting
from world_server.history import MOST_PAST

#: Of these the owner answers with the newest on each key.
LAST_VALUES = frozenset({Kind.HELLO, Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.CHAOS_RULES})
#: Of these the world answers with what it remembers.
REMEMBERED = frozenset({Kind.EVENT, Kind.DECISION})


class Retained:
    """What is answered just now.

    Args:
        mission: the mission's name.
    """

    def __init__(self, mission: str) -> None:
        self._keys = Keys(mission)
        self._values: dict[str, Sample] = {}
        self._memory: dict[Kind, deque[Sample]] = {kind: deque(maxlen=MOST_PAST) for kind in REMEMBERED}

    def take(self, sighting: Sighting) -> None:
        """Something was said, or somebody has come or gone."""
        try:
            key = self._keys.parse(sighting.key)
        except MessageError:
            return
        if key.kind in LAST_VALUES:
            self._values[sighting.key] = Sample(sighting.key, sighting.payload)
        elif key.kind in REMEMBERED:
            self._memory[key.kind].append(Sample(sighting.key, sighting.payload))
        elif key.kind is Kind.ALIVE and sighting.gone and key.robot is not None:
            self._values.pop(self._keys.build(Kind.HELLO, robot=key.robot), None)

    def answers(self, kind: Kind, pattern: str) -> list[Sample]:
        """What a query of `pattern` is answered with on the keys of `kind`."""
        if kind in REMEMBERED:
            return [sample for sample in self._memory[kind] if matches(pattern, sample.key)]
        own = self._keys.build(kind)
        return [sample for key, sample in self._values.items() if matches(own, key) and matches(pattern, key)]
