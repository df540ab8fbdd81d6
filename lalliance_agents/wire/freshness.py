"""Which message is news: per stream of a sender, only what is newer than everything received before.

A sender lives through incarnations, and numbers what it sends in each. A message of an earlier incarnation comes from a
ghost, one with a number not above the newest was overtaken or doubled: both are stale.
"""

from collections.abc import Hashable


class Freshness:
    """The newest (incarnation, seq) of each stream."""

    def __init__(self) -> None:
        self._newest: dict[Hashable, tuple[int, int]] = {}

    def admit(self, stream: Hashable, incarnation: int, seq: int) -> bool:
        """Whether this message is newer than all admitted before on `stream`; if so it is the newest from now on."""
        if self._newest.get(stream, (-1, -1)) >= (incarnation, seq):
            return False
        self._newest[stream] = (incarnation, seq)
        return True
