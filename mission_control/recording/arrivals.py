"""Whether what was published arrives: everything, as it was, and in the same order. Pure."""

from collections import deque

from mission_control.watch.sighting import Sighting


class Arrivals:
    """Holds what somebody sees on the bus against what was published there.

    Attributes:
        arrived: messages that have arrived.
        lost: messages that have not, though later ones have.
    """

    def __init__(self) -> None:
        self.arrived = 0
        self.lost = 0
        self._under_way: deque[tuple[str, bytes]] = deque()

    def __len__(self) -> int:
        """How many are under way."""
        return len(self._under_way)

    def published(self, key: str, payload: bytes) -> None:
        """A message is on its way."""
        self._under_way.append((key, payload))

    def seen(self, sighting: Sighting) -> None:
        """One has arrived; or, if it is none of those, somebody else has published it."""
        one = (sighting.key, sighting.payload)
        if one not in self._under_way:
            return
        while self._under_way.popleft() != one:
            self.lost += 1
        self.arrived += 1

    def give_up(self) -> None:
        """What is still under way is lost."""
        self.lost += len(self._under_way)
        self._under_way.clear()
