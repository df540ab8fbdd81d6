"""Which message is news: per stream of a sender, only what is newer than everything received before.

A sender lives through incarnations, and numbers what it sends in each. A message of an earlier incarnation comes from a
ghost, one with a number not above the newest was overtaken or doubled: both are stale. Whoever makes up senders makes up
streams; so only a limited number is remembered, and the one on which nothing new came for longest is forgotten first.

Whoever makes up one message with the largest number there is makes all that its sender really says stale, for good. What
comes then cannot be told from a ghost's messages, but it can be seen that nothing new comes any more.
"""

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass

#: Streams remembered at most: some hundred robots with some dozen tasks, many times over.
MOST_STREAMS = 2**15


@dataclass(slots=True)
class Newest:
    """The newest message of a stream, and what came since."""

    incarnation: int
    seq: int
    at: float
    """When it came, in seconds."""
    stale: int = 0
    """How many messages came since, none of which is newer."""
    told: bool = False
    """Whether it was told that nothing new comes."""


class Freshness:
    """The newest message of each stream.

    Args:
        most: streams remembered at most.
    """

    def __init__(self, most: int = MOST_STREAMS) -> None:
        self._most = most
        # In the order in which news came on them.
        self._newest: OrderedDict[Hashable, Newest] = OrderedDict()

    def overtaken(self, stream: Hashable, incarnation: int, seq: int, now: float) -> Newest | None:
        """The message of `stream` that stands against this one, which came at `now`; None: this is the newest from now on."""
        newest = self._newest.get(stream)
        if newest is not None and (newest.incarnation, newest.seq) >= (incarnation, seq):
            newest.stale += 1
            return newest
        self._newest[stream] = Newest(incarnation, seq, now)
        self._newest.move_to_end(stream)
        if len(self._newest) > self._most:
            self._newest.popitem(last=False)
        return None
