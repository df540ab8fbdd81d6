"""One participant's messages on a bus: a header on each that leaves, a check of each that comes.

What leaves is numbered and stamped. What comes is dropped if it does not decode, if somebody speaks for another, or if it is
no news; every drop is counted by its reason and logged once per key's owner and reason, as far as the limit of such lines. No
message can raise an error here: a receiver that fails has lost the one message, and the first such failure is logged.

Presence (activity and heartbeats) has numbers of its own, 1, 2, 3, …, and all other kinds share another row. What a link rule
does to a message follows from its number, so a simulated robot that announces the same must count the same, whatever else the
real one sends. Each key's stream takes its numbers from one row only, in the order of sending: what is news can be told.
"""

import itertools
import logging
from collections import Counter
from collections.abc import Callable
from typing import Any

from lalliance_agents.bus.base import Bus, Delivery, Registration, Sample
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.freshness import Freshness
from lalliance_agents.wire.keys import PRESENCE, Key, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, Message, decode_at, encode

_log = logging.getLogger(__name__)

_DELIVERY = {
    Kind.ACTIVITY: Delivery.PRESENCE,
    Kind.HEARTBEAT: Delivery.PRESENCE,
    Kind.MOTIVATION: Delivery.TELEMETRY,
    Kind.LINK: Delivery.TELEMETRY,
}

#: Lines about dropped messages at most: whoever makes up names cannot fill the log, nor the memory of what was logged.
MOST_LINES = 1000

#: Reasons for which messages are dropped in good order; they are counted and not logged.
EXPECTED = {"stale", "other trial"}

Receiver = Callable[[Key, Message], None]


class Messenger:
    """Sends and receives checked messages.

    Args:
        bus: the connection; the messenger does not close it.
        keys: the mission's keys.
        me: the name that goes into each header.
        incarnation: which life of `me` this is.
        clock: gives mission time, in seconds.
    """

    def __init__(self, bus: Bus, keys: Keys, me: str, incarnation: int, clock: Callable[[], float]) -> None:
        self.bus = bus
        self.keys = keys
        self.me = me
        self.incarnation = incarnation
        self.sent = 0
        self.received = 0
        self.dropped: Counter[str] = Counter()
        self._clock = clock
        self._presence_numbers = itertools.count(1)
        self._other_numbers = itertools.count(1)
        self._freshness = Freshness()
        self._logged: set[tuple[str, str]] = set()
        self._registrations: list[Registration] = []

    def compose(self, kind: Kind, /, **fields: Any) -> bytes:
        """The packed message of `kind` with the next number of its row."""
        return encode(BODY_OF[kind](**self.header(presence=kind in PRESENCE), **fields))

    def header(self, *, presence: bool = False) -> dict[str, Any]:
        """The header of the next message of the row of presence, or of all others."""
        seq = next(self._presence_numbers if presence else self._other_numbers)
        return {"sender": self.me, "incarnation": self.incarnation, "seq": seq, "at": self._clock()}

    def send(self, kind: Kind, /, *, key_task: str = "", key_robot: str = "", **fields: Any) -> None:
        """Publish a message of `kind` under this participant's own name.

        Args:
            kind: what it is.
            key_task: the task in the key, where there is one.
            key_robot: the robot in the key, if not this participant itself.
            fields: the message's fields, but for the header.
        """
        key = self.keys.build(kind, robot=key_robot or self.me, task=key_task)
        self.bus.put(key, self.compose(kind, **fields), _DELIVERY.get(kind, Delivery.STATE))
        self.sent += 1

    async def listen(self, pattern: str, receiver: Receiver) -> Registration:
        """Have `receiver` called with each fresh message whose key matches `pattern`."""
        registration = await self.bus.subscribe(pattern, lambda sample: self.take(sample, receiver))
        self._registrations.append(registration)
        return registration

    async def offer(self, pattern: str, current: Callable[[str], list[Sample]]) -> None:
        """Answer queries that match `pattern` with what `current` returns for the query's own pattern."""
        self._registrations.append(await self.bus.answer(pattern, lambda query: current(query.key)))

    async def ask(self, pattern: str, receiver: Receiver, *, timeout: float) -> int:  # noqa: ASYNC109 - see Bus.query
        """Query `pattern` and take the answers like messages; the number of answers within `timeout` seconds."""
        answers = await self.bus.query(pattern, timeout=timeout)
        for sample in answers:
            self.take(sample, receiver)
        return len(answers)

    def take(self, sample: Sample, receiver: Receiver) -> None:
        """Check one sample and hand it on if it is a fresh message of another participant."""
        source = "an unknown key"
        try:
            key = self.keys.parse(sample.key)
            if key.speaker == self.me:
                return
            source = key.speaker or sample.key
            message = decode_at(key, sample.payload)
        except MessageError as error:
            self.drop(error.reason, source, str(error))
            return
        if not self._freshness.admit(key.stream, message.incarnation, message.seq):
            self.drop("stale", source)
            return
        self.received += 1
        try:
            receiver(key, message)
        except Exception:
            if self._is_first("receiver", source):
                _log.exception("a message of %s could not be used: its receiver failed", source)
            self.dropped["receiver"] += 1

    def drop(self, reason: str, source: str, detail: str = "") -> None:
        """Count a message that is not used, and log the first of its source and reason."""
        self.dropped[reason] += 1
        if reason not in EXPECTED and self._is_first(reason, source):
            _log.warning("dropping messages of %s: %s", source, detail or reason)

    def _is_first(self, reason: str, source: str) -> bool:
        """Whether this is the first time, so far as it can be told, and is to be logged."""
        if (source, reason) in self._logged or len(self._logged) >= MOST_LINES:
            return False
        self._logged.add((source, reason))
        return True

    async def close(self) -> None:
        """Stop listening and answering."""
        while self._registrations:
            await self._registrations.pop().close()
