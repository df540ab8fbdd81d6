"""What link rules do to a message: lost, late, twice, out of order, or nothing. Pure.

The verdict on a message is a function of (seed, sender, receiver, incarnation, seq) alone. It depends neither on when the
message arrives nor on what else does, so that a run can be explained afterwards and the simulator comes to the same verdict.
Randomness is a hash of those five and of what is drawn (loss, delay, …): where two rules differ only in their probability of
loss, what the milder one loses the harsher one loses too.

A burst (Gilbert-Elliott) is a chain of states, one step a message. The state at a message follows from the ones before, so it
is found by walking back to a step whose draw decides alone, whatever the state before it. A step does so with probability
1 - |1 - enter - leave|, which can be small; so chains are cut into blocks that begin with a draw of their own, and no walk is
longer than `BLOCK`. A link remembers the state it found last, where the walk from the next message ends after one step.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from hashlib import blake2b
from statistics import NormalDist
from typing import NamedTuple

from lalliance_agents.faults import fits
from lalliance_agents.wire.messages import LinkRule

#: Messages of a burst chain that are drawn together.
BLOCK = 4096
#: Links remembered at most: whoever makes up senders makes up links.
MOST_LINKS = 2**16
#: The largest exponent of a log-normal delay. No rule of a mission file comes near it; a rule made up must not overflow.
_LARGEST_EXPONENT = 50.0

_MASK = 2**64 - 1
_NORMAL = NormalDist()


class _Draw(IntEnum):
    """What a random number decides."""

    LOSS = 1
    BURST = 2
    DELAY = 3
    DUPLICATE = 4
    COPY_DELAY = 5
    REORDER = 6


class Verdict(NamedTuple):
    """What happens to one message."""

    delays: tuple[float, ...]
    """How late each copy comes, in seconds; empty if the message is lost."""
    faults: tuple[str, ...]
    """The faults that did something to it."""


#: What happens to a message on a link without rules.
UNTOUCHED = Verdict((0.0,), ())


class Known(NamedTuple):
    """The state that a burst chain has at one message."""

    key: int
    """Which chain."""
    seq: int
    bad: bool


NOTHING_KNOWN = Known(key=-1, seq=-1, bad=False)


class LinkRules:
    """The rules in force.

    Args:
        seed: where all randomness comes from.
        rules: the rules; of two that set the same aspect of a link the first counts.
    """

    def __init__(self, seed: int = 0, rules: Sequence[LinkRule] = ()) -> None:
        self.seed = seed
        self.rules = tuple(rules)
        self._links: dict[tuple[str, str], RuledLink | None] = {}

    def __repr__(self) -> str:
        return f"<{len(self.rules)} link rules, seed {self.seed}>"

    def on(self, sender: str, receiver: str) -> "RuledLink | None":
        """What is in force from `sender` to `receiver`; None if nothing is. No link leads from a robot to itself."""
        link = sender, receiver
        if link not in self._links:
            if len(self._links) >= MOST_LINKS:
                self._links.clear()
            rules = [] if sender == receiver else [rule for rule in self.rules if _holds(rule, sender, receiver)]
            self._links[link] = RuledLink(self.seed, sender, receiver, rules) if rules else None
        return self._links[link]


def _holds(rule: LinkRule, sender: str, receiver: str) -> bool:
    return fits(sender, rule.senders) and fits(receiver, rule.receivers)


class RuledLink:
    """The rules on the messages of one sender to one receiver."""

    __slots__ = ("_cuts", "_delay", "_duplicate", "_key", "_known", "_loss", "_name", "_reorder")

    def __init__(self, seed: int, sender: str, receiver: str, rules: Sequence[LinkRule]) -> None:
        digest = blake2b(f"{seed}/{sender}/{receiver}".encode(), digest_size=8).digest()
        self._name = f"{sender} to {receiver}"
        self._key = int.from_bytes(digest, "little")
        self._known = NOTHING_KNOWN
        self._cuts = tuple(dict.fromkeys(rule.fault for rule in rules if rule.cut))
        self._loss = next((rule for rule in rules if rule.loss > 0 or rule.burst_enter > 0), None)
        self._delay = next((rule for rule in rules if rule.delay != "none"), None)
        self._duplicate = next((rule for rule in rules if rule.duplicate > 0), None)
        self._reorder = next((rule for rule in rules if rule.reorder > 0), None)

    def __repr__(self) -> str:
        rules = {
            "cut": self._cuts,
            "loss": self._loss,
            "delay": self._delay,
            "duplicate": self._duplicate,
            "reorder": self._reorder,
        }
        return f"<link from {self._name}: {', '.join(name for name, rule in rules.items() if rule)}>"

    def verdict(self, incarnation: int, seq: int) -> Verdict:
        """What happens to the message `seq` that the sender sent in its life `incarnation`."""
        if self._cuts:
            return Verdict((), self._cuts)
        key = _mixed(self._key + 0x9E3779B97F4A7C15 * incarnation)
        if self._loss is not None and self._is_lost(self._loss, key, seq):
            return Verdict((), (self._loss.fault,))
        faults: list[str] = []
        late, held = self._transit(key, _Draw.DELAY, seq), 0.0
        if self._delay is not None and late > 0:
            faults.append(self._delay.fault)
        if self._reorder is not None and _uniform(key, _Draw.REORDER, seq) < self._reorder.reorder:
            faults.append(self._reorder.fault)
            held = self._reorder.held
        delays: tuple[float, ...] = (late + held,)
        if self._duplicate is not None and _uniform(key, _Draw.DUPLICATE, seq) < self._duplicate.duplicate:
            faults.append(self._duplicate.fault)
            delays += (self._transit(key, _Draw.COPY_DELAY, seq) + held,)
        return Verdict(delays, tuple(dict.fromkeys(faults)))

    def _transit(self, key: int, draw: _Draw, seq: int) -> float:
        """How long one copy is under way, in seconds."""
        return 0.0 if self._delay is None else _delay(self._delay, _uniform(key, draw, seq))

    def _is_lost(self, rule: LinkRule, key: int, seq: int) -> bool:
        share = rule.loss
        if rule.burst_enter > 0:
            bad = in_burst(rule, key, seq, self._known)
            self._known = Known(key, seq, bad)
            share = rule.burst_loss if bad else rule.loss
        return _uniform(key, _Draw.LOSS, seq) < share


def in_burst(rule: LinkRule, key: int, seq: int, known: Known = NOTHING_KNOWN) -> bool:
    """Whether the message `seq` of the chain `key` falls into a burst; what is `known` shortens the search."""
    stays = 1 - rule.burst_leave
    surely_bad, surely_good = min(rule.burst_enter, stays), max(rule.burst_enter, stays)
    flips, bad = rule.burst_enter > stays, False
    undecided = 0
    shortcut = known.seq if known.key == key else -1
    for at in range(seq, -1, -1):
        if at == shortcut:
            bad = known.bad
            break
        drawn = _uniform(key, _Draw.BURST, at)
        if at % BLOCK == 0:
            bad = drawn < rule.burst_enter / (rule.burst_enter + rule.burst_leave)
            break
        if drawn < surely_bad or drawn >= surely_good:
            bad = drawn < surely_bad
            break
        # Here a step keeps the state before it, or turns it round where bursts begin more readily than they last.
        undecided += 1
    return bad != (flips and undecided % 2 == 1)


def _delay(rule: LinkRule, drawn: float) -> float:
    if rule.delay == "uniform":
        return rule.delay_by + drawn * (rule.delay_to - rule.delay_by)
    if rule.delay == "lognormal":
        exponent = rule.delay_to * _NORMAL.inv_cdf(max(drawn, 2.0**-53))
        return rule.delay_by * math.exp(min(exponent, _LARGEST_EXPONENT))
    return rule.delay_by


def _mixed(number: int) -> int:
    """A hash of a number to 64 bits (the finaliser of SplitMix64)."""
    number &= _MASK
    number = ((number ^ (number >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    number = ((number ^ (number >> 27)) * 0x94D049BB133111EB) & _MASK
    return number ^ (number >> 31)


def _uniform(key: int, draw: _Draw, seq: int) -> float:
    """A number in [0, 1)."""
    return (_mixed(key + draw * 0xD1B54A32D192ED03 + seq * 0x9E3779B97F4A7C15) >> 11) * 2.0**-53
