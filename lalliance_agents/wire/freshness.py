"""Which message is news: per stream of a sender, only what is newer than everything received before.

A sender lives through incarnations, and numbers what it sends in each. A message of an earlier incarnation comes from a
ghost, one with a number not above the newest was overtaken or doubled: both are stale. Whoever makes up senders makes up
streams; so only a limited number is remembered, and the one on which nothing new came for longest is forgotten first.
"""

from collections import OrderedDict
from collections.abc import Hashable

#: Streams remembered at most: some hundred robots with some dozen tasks, many times over.
MOST_STREAMS = 2**15


class Freshness:
    """The newest (incarnation, seq) of each stream.

    Args:
        most: streams remembered at most.
    """

    def __init__(self, most: int = MOST_STREAMS) -> None:
        self._most = most
        # In the order in which news came on them.
        self._newest: OrderedDict[Hashable, tuple[int, int]] = OrderedDict()

    def admit(self, stream: Hashable, incarnation: int, seq: int) -> bool:
        """Whether this message is newer than all admitted before on `stream`; if so it is the newest from now on."""
        if self._newest.get(stream, (-1, -1)) >= (incarnation, seq):
            return False
        self._newest[stream] = (incarnation, seq)
        self._newest.move_to_end(stream)
        if len(self._newest) > self._most:
            self._newest.popitem(last=False)
        return True
