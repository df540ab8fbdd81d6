"""Messages that one participant did not use: counted by reason and by sender, and told without filling the log.

Whoever can reach the bus can make up names, keys and contents without end. So only the team and those with a part of their own
are told apart, and all others are `OTHERS`. For each cause the first few senders are told of at once; after that a line comes
only each time the number of messages has grown tenfold, and it says that number.
"""

from collections import Counter
from collections.abc import Iterable

from lalliance_agents.wire.keys import LAUNCHER, OPERATOR, WORLD

#: Senders told of at once, for each cause.
FEW = 3
#: From this number on, the messages dropped for one cause are told at each power of ten.
MANY = 100
#: Who is neither of the team nor has a part of its own.
OTHERS = "@others"

#: The sender's newest message stands in the way of all that it says for a while already.
CUT_OFF = "cut off"
#: Reasons for which messages are dropped in good order, or told of in another way: they are counted and not logged.
QUIET = {"stale", "other trial", CUT_OFF}


class Drops:
    """The account.

    Args:
        team: the robots that are told apart.

    Attributes:
        by_reason: how many messages were dropped, by reason.
        by_sender: the same by sender and reason.
    """

    def __init__(self, team: Iterable[str] = ()) -> None:
        self.by_reason: Counter[str] = Counter()
        self.by_sender: Counter[tuple[str, str]] = Counter()
        self._known = {*team, WORLD, LAUNCHER, OPERATOR}
        self._causes: Counter[str] = Counter()
        self._told: dict[str, set[str]] = {}

    def add(self, reason: str, source: str) -> bool:
        """Count a message of `source`; whether that is to be told."""
        self.by_reason[reason] += 1
        self.by_sender[source if source in self._known else OTHERS, reason] += 1
        return reason not in QUIET and self._is_to_be_told(reason, source, of_all=False)

    def is_cut_off(self, source: str) -> bool:
        """Note that nothing of `source` is used any more; whether that is to be told, as it is once of each of the team."""
        return self._is_to_be_told(CUT_OFF, source, of_all=source in self._known)

    def _is_to_be_told(self, cause: str, source: str, *, of_all: bool) -> bool:
        self._causes[cause] += 1
        told = self._told.setdefault(cause, set())
        if source not in told and (of_all or len(told) < FEW):
            told.add(source)
            return True
        count = str(self._causes[cause])
        return not of_all and len(count) >= len(str(MANY)) and count.rstrip("0") == "1"
