"""One participant's messages on a bus: a header on each that leaves, a check of each that comes.

What leaves is numbered and stamped. What comes is dropped if it does not decode, if somebody speaks for another, or if it is
no news; every drop is counted, and told as far as that does not fill the log (`drops`). No message can raise an error here: a
receiver that fails has lost the one message. If nothing of a sender is news for a while although it goes on talking, that is
told and counted as well: one made-up message can do that.

Presence (activity and heartbeats) has numbers of its own, 1, 2, 3, …, and all other kinds share another row. What a link rule
does to a message follows from its number, so a simulated robot that announces the same must count the same, whatever else the
real one sends. Each key's stream takes its numbers from one row only, in the order of sending: what is news can be told.
"""

import itertools
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from lalliance_agents.bus.base import Bus, Delivery, Registration, Sample
from lalliance_agents.bus.drops import CUT_OFF, Drops
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.freshness import Freshness, Newest
from lalliance_agents.wire.keys import PRESENCE, Key, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, Decoder, Message, decode_at, encode

_log = logging.getLogger(__name__)

_DELIVERY = {
    Kind.ACTIVITY: Delivery.PRESENCE,
    Kind.HEARTBEAT: Delivery.PRESENCE,
    Kind.MOTIVATION: Delivery.TELEMETRY,
    Kind.LINK: Delivery.TELEMETRY,
}

#: A sender is cut off when so many of its messages in a row were no news, for at least so many seconds of mission time.
CUT_OFF_AFTER = 10
CUT_OFF_SECONDS = 10.0

Receiver = Callable[[Key, Message], None]
#: Is told as well when the message came, in seconds of the event loop's clock.
LazyReceiver = Callable[[Key, Message, float], None]


class Messenger:
    """Sends and receives checked messages.

    Args:
        bus: the connection; the messenger does not close it.
        keys: the mission's keys.
        me: the name that goes into each header.
        incarnation: which life of `me` this is.
        clock: gives mission time, in seconds.
        team: the robots that are told apart in the account of what was dropped.
        decode: how what comes is decoded.
    """

    def __init__(
        self,
        bus: Bus,
        keys: Keys,
        me: str,
        incarnation: int,
        clock: Callable[[], float],
        team: Iterable[str] = (),
        *,
        decode: Decoder = decode_at,
    ) -> None:
        self.bus = bus
        self.keys = keys
        self.me = me
        self.incarnation = incarnation
        self.sent = 0
        self.received = 0
        self._drops = Drops(team)
        self._clock = clock
        self._decode = decode
        self._presence_numbers = itertools.count(1)
        self._other_numbers = itertools.count(1)
        self._freshness = Freshness()
        self._registrations: list[Registration] = []

    @property
    def dropped(self) -> Counter[str]:
        """Messages that were not used, by reason."""
        return self._drops.by_reason

    @property
    def dropped_of(self) -> Counter[tuple[str, str]]:
        """The same by sender and reason; see `Drops`."""
        return self._drops.by_sender

    def compose(self, kind: Kind, /, **fields: Any) -> bytes:
        """The packed message of `kind` with the next number of its row."""
        return encode(BODY_OF[kind](**self.header(presence=kind in PRESENCE), **fields))

    def header(self, *, presence: bool = False) -> dict[str, Any]:
        """The header of the next message of the row of presence, or of all others."""
        seq = next(self._presence_numbers if presence else self._other_numbers)
        return {"sender": self.me, "incarnation": self.incarnation, "seq": seq, "at": self._clock()}

    def sample(self, kind: Kind, /, *, key_task: str = "", key_robot: str = "", **fields: Any) -> Sample:
        """A message of `kind` and its key, as `send` publishes it."""
        key = self.keys.build(kind, robot=key_robot or self.me, task=key_task)
        return Sample(key, self.compose(kind, **fields))

    def send(self, kind: Kind, /, *, key_task: str = "", key_robot: str = "", **fields: Any) -> Sample:
        """Publish a message of `kind` under this participant's own name, and return it.

        Args:
            kind: what it is.
            key_task: the task in the key, where there is one.
            key_robot: the robot in the key, if not this participant itself.
            fields: the message's fields, but for the header.
        """
        sample = self.sample(kind, key_task=key_task, key_robot=key_robot, **fields)
        self.bus.put(sample.key, sample.payload, _DELIVERY.get(kind, Delivery.STATE))
        self.sent += 1
        return sample

    async def listen(self, pattern: str, receiver: Receiver) -> Registration:
        """Have `receiver` called with each fresh message whose key matches `pattern`."""
        registration = await self.bus.subscribe(pattern, lambda sample: self.take(sample, receiver))
        self._registrations.append(registration)
        return registration

    async def listen_lazily(self, pattern: str, receiver: LazyReceiver) -> Registration:
        """The same with a lazy subscription."""
        registration = await self.bus.subscribe(
            pattern, lambda sample: self.take(sample, receiver, sample.came), lazy=True
        )
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

    def take(self, sample: Sample, receiver: Callable[..., None], *more: float) -> None:
        """Check one sample and hand it on, and `more`, if it is a fresh message of another participant."""
        source = "an unknown key"
        try:
            key = self.keys.parse(sample.key)
            if key.speaker == self.me:
                return
            source = key.speaker or sample.key
            message = self._decode(key, sample.payload)
        except MessageError as error:
            self.drop(error.reason, source, str(error))
            return
        newest = self._freshness.overtaken(key.stream, message.incarnation, message.seq, self._clock())
        if newest is not None:
            self._drop_stale(source, sample.key, newest)
            return
        self.received += 1
        try:
            receiver(key, message, *more)
        except Exception:
            if self._drops.add("receiver", source):
                _log.exception("a message of %s could not be used: its receiver failed", source)

    def drop(self, reason: str, source: str, detail: str = "") -> None:
        """Count a message that is not used; tell it if its reason is new, or the number of such messages."""
        if self._drops.add(reason, source):
            count = self.dropped[reason]
            more = f" ({count} dropped for this reason so far)" if count > 1 else ""
            _log.warning("dropping messages of %s: %s%s", source, detail or reason, more)

    def _drop_stale(self, source: str, key: str, newest: Newest) -> None:
        """Count a message that is no news; tell it if nothing has been for a while."""
        lasts = self._clock() - newest.at
        if newest.stale < CUT_OFF_AFTER or lasts < CUT_OFF_SECONDS:
            self.drop("stale", source)
            return
        self.drop(CUT_OFF, source)
        if not newest.told:
            newest.told = True
            if self._drops.is_cut_off(source):
                _log.warning(
                    "%s is cut off: for %.0f s nothing on %s is newer than its message %d of life %d, which somebody made up, "
                    "unless another process goes by this name or messages come very late; none of them is used",
                    source,
                    lasts,
                    key,
                    newest.seq,
                    newest.incarnation,
                )

    async def close(self) -> None:
        """Stop listening and answering."""
        while self._registrations:
            await self._registrations.pop().close()
