"""Messages that one participant did not use: counted by reason and by sender, and told without filling the log.

Whoever can reach the bus can make up names, keys and contents without end. So for each cause the first few senders are
told of at once; after that a line comes only each time the number of messages has grown tenfold, and it says that number. What
is counted by sender is limited as well: beyond that, counts are those of `OTHERS`.
"""

import re
from collections import Counter

from lalliance_agents.wire.keys import SENDER_PATTERN

#: Senders told of at once, for each cause.
FEW = 3
#: From this number on, the messages dropped for one cause are told at each power of ten.
MANY = 100
#: Pairs of sender and reason told apart at most, so that a report stays small; more count as those of `OTHERS`.
MOST_PAIRS = 64
OTHERS = "@others"

#: The sender's newest message stands in the way of all that it says for a while already.
CUT_OFF = "cut off"
#: Reasons for which messages are dropped in good order, or told of in another way: they are counted and not logged.
QUIET = {"stale", "other trial", CUT_OFF}


class Drops:
    """The account.

    Attributes:
        by_reason: how many messages were dropped, by reason.
        by_sender: the same by sender and reason, `OTHERS` standing for who has no name and for those beyond the limit.
    """

    def __init__(self) -> None:
        self.by_reason: Counter[str] = Counter()
        self.by_sender: Counter[tuple[str, str]] = Counter()
        self._causes: Counter[str] = Counter()
        self._told: dict[str, set[str]] = {}

    def add(self, reason: str, source: str) -> bool:
        """Count a message of `source`; whether that is to be told."""
        self.by_reason[reason] += 1
        pair = (source if re.fullmatch(SENDER_PATTERN, source) else OTHERS, reason)
        if pair not in self.by_sender and len(self.by_sender) >= MOST_PAIRS:
            pair = OTHERS, reason
        self.by_sender[pair] += 1
        return reason not in QUIET and self.is_to_be_told(reason, source)

    def is_to_be_told(self, cause: str, source: str) -> bool:
        """Count a case of `cause`, and whether it is one of those that are told."""
        self._causes[cause] += 1
        told = self._told.setdefault(cause, set())
        if source not in told and len(told) < FEW:
            told.add(source)
            return True
        count = str(self._causes[cause])
        return len(count) >= len(str(MANY)) and count.rstrip("0") == "1"
