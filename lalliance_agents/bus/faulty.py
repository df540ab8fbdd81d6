"""Any bus, as one robot hears it through the faults that the world has put in force.

The world says on `@chaos/rules` what is to happen to messages where they arrive; a `FaultyBus` does it to those of one robot.
Activity and heartbeats of a teammate come under the rules of the link from there; what the world senses of tasks comes under
the robot's blindness, be it published or an answer to a query. Nothing else is touched, nor is what leaves. On a link that no
rule names a message costs one look at a table, and is decoded only by whoever reads it.

What the rules say counts for messages that arrive from then on; what is under way then arrives when it was to. Delays are
mission time. What waits for its lazy subscriber is delayed from the instant it came, not from when it is collected, and all
is handed on in the order in which it arrives after its delay. A delayed message is discarded if its registration or the bus
is closed meanwhile, or if too many wait.

Two accounts are kept, both for this incarnation. `effects`: how many messages each fault touched (lost, delayed, doubled,
reordered or held back), by sender. `dropped`: the messages that came and were not handed on, by reason: `LOST`, `HELD_BACK` and
`TOO_MANY`, and whatever a messenger drops, for messages on `@chaos/rules` that are not heeded. So of what teammates sent here,
all was received or dropped, but for second copies, which count as messages, and for what is still under way.
"""

import asyncio
from collections import Counter

from lalliance_agents.bus.base import (
    Bus,
    Handler,
    Registration,
    Sample,
)
from lalliance_agents.bus.delay_line import DelayLine
from lalliance_agents.bus.drops import OTHERS
from lalliance_agents.bus.inbox import Inlet
from lalliance_agents.bus.link import LinkRules, RuledLink
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.patterns import MAX_KEY, check_pattern, intersects
from lalliance_agents.bus.wrapped import WrappedBus
from lalliance_agents.clock import MissionClock
from lalliance_agents.errors import MessageError
from lalliance_agents.faults import fits
from lalliance_agents.wire.keys import PRESENCE, WORLD, Key, Keys, Kind
from lalliance_agents.wire.messages import Blindness, ChaosRules, Decoder, Effect, Message, decode_at

#: Reasons of drops: a link rule lost it; the robot is blind; too many delayed ones wait already.
LOST = "link fault"
HELD_BACK = "blind"
TOO_MANY = "late overflow"

#: Keys whose treatment is remembered at most: whoever makes up names makes up keys.
MOST_KEYS = 2**14
#: Pairs of fault and sender told apart at most, so that a report stays small; more count as those of `OTHERS`.
MOST_EFFECTS = 128

_Treatment = tuple[Key, RuledLink | Blindness]


class FaultyBus(WrappedBus):
    """One robot's connection, with faults made on arrival. Obeys no rules before `obey`; closing it closes the inner bus.

    Args:
        inner: the bus that does the work.
        keys: the mission's keys.
        me: the robot, as the receiver that rules name.
        clock: mission time, in which delays are meant.
        decode: how what comes is decoded.
    """

    def __init__(self, inner: Bus, keys: Keys, me: str, clock: MissionClock, *, decode: Decoder = decode_at) -> None:
        super().__init__(inner)
        self._keys = keys
        self._me = me
        self._clock = clock
        # It only listens: what it would put into its headers does not matter.
        self._ear = Messenger(inner, keys, me, 0, clock.now, decode=decode)
        self._decode = decode
        self._loop = asyncio.get_running_loop()
        self._line = DelayLine(self._collect)
        self._touchable = [keys.build(kind) for kind in (Kind.ACTIVITY, Kind.HEARTBEAT, Kind.SENSE_TASK)]
        self._links = LinkRules()
        self._blindness: Blindness | None = None
        self._treatments: dict[str, _Treatment | None] = {}
        self._effects: Counter[tuple[str, str]] = Counter()
        self._over: asyncio.Future[None] = self._loop.create_future()

    def __repr__(self) -> str:
        blind = "blind, " if self._blindness is not None else ""
        return f"<faulty bus of {self._me}: {len(self._links.rules)} rules, {blind}{len(self._line)} under way>"

    @property
    def dropped(self) -> Counter[str]:
        """Messages not handed on, by reason."""
        return self._ear.dropped

    @property
    def dropped_of(self) -> Counter[tuple[str, str]]:
        """Messages on `@chaos/rules` not heeded, by sender and reason."""
        return self._ear.dropped_of

    def effects(self) -> list[Effect]:
        """How many messages each fault touched so far, by sender."""
        return [Effect(fault=fault, sender=sender, count=count) for (fault, sender), count in self._effects.items()]

    async def obey(self, *, timeout: float) -> None:  # noqa: ASYNC109 - see Bus.query
        """Have the world's rules in force from now on; waits up to `timeout` real seconds for those there are."""
        rules = self._keys.build(Kind.CHAOS_RULES)
        await self._ear.listen(rules, self._put_in_force)
        await self._ear.ask(rules, self._put_in_force, timeout=timeout)

    async def forget(self) -> None:
        """Obey no more, for good: what is under way is discarded, and what comes is handed on as it comes."""
        if not self._over.done():
            self._over.set_result(None)
        self._links, self._blindness = LinkRules(), None
        self._treatments.clear()
        self._line.discard()
        await self._ear.close()

    async def subscribe(self, pattern: str, handler: Handler, *, lazy: bool = False) -> Registration:
        """Have `handler` called with each sample whose key matches `pattern`, when and as often as the faults let it come."""
        check_pattern(pattern)
        if not any(intersects(pattern, touchable) for touchable in self._touchable):
            return await self._inner.subscribe(pattern, handler, lazy=lazy)
        inlet = Inlet(f"the subscription {pattern!r}", handler, lazy=lazy)

        def hear(sample: Sample) -> None:
            if self._links.rules or self._blindness is not None or len(self._line) > 0:
                self._hear(inlet, sample)
            else:
                handler(sample)

        return _Subscription(await self._inner.subscribe(pattern, hear, lazy=lazy), inlet, self._line)

    def collect(self) -> bool:
        """Have what arrived until now handled; of a flood only a part. False inside a handler, where it does nothing."""
        return self._collect(self._loop.time())

    def _collect(self, until: float) -> bool:
        collected = not self._line.delivers and self._inner.collect()
        if collected:
            self._line.deliver(until)
        return collected

    def _hear(self, inlet: Inlet[Sample], sample: Sample) -> None:
        """Hand a sample on, after those that are to come before it."""
        came = sample.came if inlet.lazy else self._loop.time()
        self._line.deliver(came)
        treatment = self._treatment(sample.key)
        if treatment is None:
            inlet.deliver(sample)
        else:
            self._treat(treatment, inlet, sample, came)

    async def query(self, pattern: str, payload: bytes = b"", *, timeout: float) -> list[Sample]:  # noqa: ASYNC109 - see Bus.query
        """Ask whoever answers `pattern`; a blind robot gets what the world senses late, or not at all if not in time."""
        loop = asyncio.get_running_loop()
        until = loop.time() + timeout
        answers = await self._inner.query(pattern, payload, timeout=timeout)
        blind = self._blindness
        seen = answers if blind is None else [answer for answer in answers if not self._is_unseen(answer.key)]
        if blind is None or len(seen) == len(answers):
            return answers
        unseen = len(answers) - len(seen)
        self._count(blind.fault, WORLD, unseen)
        if blind.delay is not None and await self._passes(blind.delay, until - loop.time()):
            return answers
        self._ear.dropped[HELD_BACK] += unseen
        return seen

    async def close(self) -> None:
        """Discard what is under way and close the inner bus; a second call does nothing."""
        try:
            await self.forget()
        finally:
            await self._inner.close()

    def _put_in_force(self, _: Key, message: Message) -> None:
        if not isinstance(message, ChaosRules) or self._over.done():
            return
        rules = tuple(rule for rule in message.rules if fits(self._me, rule.receivers))
        blindness = next((blind for blind in message.blind if blind.robot == self._me), None)
        if (message.seed, rules, blindness) != (self._links.seed, self._links.rules, self._blindness):
            self._links, self._blindness = LinkRules(message.seed, rules), blindness
            self._treatments.clear()

    def _treatment(self, text: str) -> _Treatment | None:
        """What is in force for samples on a key, if anything is."""
        if len(text) > MAX_KEY:  # no key of a robot's, and too long to be remembered
            return None
        if text not in self._treatments:
            if len(self._treatments) >= MOST_KEYS:
                self._treatments.clear()
            self._treatments[text] = self._find_treatment(text)
        return self._treatments[text]

    def _find_treatment(self, text: str) -> _Treatment | None:
        try:
            key = self._keys.parse(text)
        except MessageError:  # whoever reads it will count it
            return None
        found: RuledLink | Blindness | None = None
        if key.kind is Kind.SENSE_TASK:
            found = self._blindness
        elif key.kind in PRESENCE and key.robot is not None:
            found = self._links.on(key.robot, self._me)
        return None if found is None else (key, found)

    def _treat(self, treatment: _Treatment, inlet: Inlet[Sample], sample: Sample, came: float) -> None:
        key, found = treatment
        if isinstance(found, Blindness):
            self._count(found.fault, WORLD)
            if found.delay is None:
                self._ear.dropped[HELD_BACK] += 1
            else:
                self._deliver(found.delay, inlet, sample, came, WORLD)
            return
        try:
            message = self._decode(key, sample.payload)
        except MessageError:  # whoever reads it will count it
            inlet.deliver(sample)
            return
        verdict = found.verdict(message.incarnation, message.seq)
        for fault in verdict.faults:
            self._count(fault, message.sender)
        for delay in verdict.delays:
            self._deliver(delay, inlet, sample, came, message.sender)
        if not verdict.delays:
            self._ear.dropped[LOST] += 1

    def _deliver(self, delay: float, inlet: Inlet[Sample], sample: Sample, came: float, sender: str) -> None:
        if delay <= 0:
            inlet.deliver(sample)
        elif not self._line.push(came + self._clock.lasts(delay), inlet, sample):
            self._ear.drop(TOO_MANY, sender)

    def _count(self, fault: str, sender: str, messages: int = 1) -> None:
        pair = fault, sender
        if pair not in self._effects and len(self._effects) >= MOST_EFFECTS:
            pair = fault, OTHERS
        # Faults made up without end must not fill the memory either.
        if pair in self._effects or len(self._effects) < 2 * MOST_EFFECTS:
            self._effects[pair] += messages

    def _is_unseen(self, text: str) -> bool:
        treatment = self._treatment(text)
        return treatment is not None and isinstance(treatment[1], Blindness)

    async def _passes(self, delay: float, patience: float) -> bool:
        """Wait until `delay` mission seconds are over; whether they were, before `patience` real ones or the end were."""
        passed: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        timer = self._clock.call_at(self._clock.now() + delay, lambda: passed.set_result(None))
        try:
            await asyncio.wait({passed, self._over}, timeout=patience, return_when=asyncio.FIRST_COMPLETED)
        finally:
            timer.cancel()
        return passed.done() and not self._over.done()


class _Subscription:
    """A subscription whose delayed samples end with it."""

    def __init__(self, inner: Registration, inlet: Inlet[Sample], line: DelayLine) -> None:
        self._inner = inner
        self._inlet = inlet
        self._line = line

    async def close(self) -> None:
        """Take the declaration back; a second call does nothing."""
        if self._inlet.is_open:
            self._inlet.is_open = False
            self._line.discard(self._inlet)
            await self._inner.close()
