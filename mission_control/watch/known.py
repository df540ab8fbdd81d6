"""What an onlooker knows already of what it is told again when it asks. Pure.

A decision is the same if its sender has numbered it so in the same life. A world that was killed and goes on from its journal
numbers its events anew, so of those it is what they say that counts; and how often it was said, as a robot that comes and
goes while no trial runs does so at one instant of the world's. A last value is the same if it is the last that came on its
key, to the last byte. How much is known is limited: what is forgotten would be told twice.
"""

from collections import Counter, OrderedDict
from collections.abc import Hashable

from lalliance_agents.bus.base import Sample
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import Keys, Kind
from lalliance_agents.wire.messages import DecisionMade, Event, decode_at

#: What its owner, or the world, answers with when it is asked.
LAST_VALUES = (Kind.CHAOS_RULES, Kind.HELLO, Kind.SENSE_ROBOT, Kind.SENSE_TASK)
#: What the world remembers.
HISTORY = (Kind.EVENT, Kind.DECISION)

#: Events and decisions known at most: several times what a world remembers.
MOST_PAST = 2**15
#: Keys with a last value known at most, and keys told apart.
MOST_VALUES = MOST_KEYS = 2**13


class Known:
    """What is known already.

    Args:
        keys: the mission's.
    """

    def __init__(self, keys: Keys) -> None:
        self._keys = keys
        self._kinds: dict[str, Kind | None] = {}
        #: How often each was told, by a digest: in the order in which they were.
        self._past: OrderedDict[int, int] = OrderedDict()
        self._values: OrderedDict[str, int] = OrderedDict()

    def kind(self, key: str) -> Kind | None:
        """What is said on a key; None if it is no key."""
        if key not in self._kinds:
            if len(self._kinds) >= MOST_KEYS:
                self._kinds.clear()
            try:
                self._kinds[key] = self._keys.parse(key).kind
            except MessageError:
                self._kinds[key] = None
        return self._kinds[key]

    def note(self, sample: Sample) -> None:
        """This was told."""
        kind = self.kind(sample.key)
        if kind in HISTORY:
            digest = hash(self._identity(sample))
            self._told(digest, self._past.get(digest, 0) + 1)
        elif kind in LAST_VALUES:
            self._holds(sample)

    def news(self, answers: list[Sample]) -> list[Sample]:
        """What of these answers to one question was not told before; it is known from now on."""
        counts: Counter[int] = Counter()
        new = []
        for sample in answers:
            if self.kind(sample.key) in HISTORY:
                digest = hash(self._identity(sample))
                counts[digest] += 1
                is_new = counts[digest] > self._past.get(digest, 0)
                if is_new:
                    self._told(digest, counts[digest])
            else:
                is_new = self._values.get(sample.key) != hash(sample.payload)
                self._holds(sample)
            if is_new:
                new.append(sample)
        return new

    def _told(self, digest: int, times: int) -> None:
        self._past[digest] = times
        self._past.move_to_end(digest)
        if len(self._past) > MOST_PAST:
            self._past.popitem(last=False)

    def _holds(self, sample: Sample) -> None:
        self._values[sample.key] = hash(sample.payload)
        self._values.move_to_end(sample.key)
        if len(self._values) > MOST_VALUES:
            self._values.popitem(last=False)

    def _identity(self, sample: Sample) -> Hashable:
        try:
            message = decode_at(self._keys.parse(sample.key), sample.payload)
        except MessageError:
            return sample
        if isinstance(message, Event):
            return message.trial, message.elapsed, message.kind, message.text, message.robot, message.task
        if isinstance(message, DecisionMade):
            return message.sender, message.incarnation, message.seq
        return sample
