"""What link rules do to a message: lost, late, twice, out of order, or nothing. Pure.

The verdict on a message is a function of (seed, sender, receiver, incarnation, seq) alone. It depends neither on when the
message arrives nor on what else does, so that a run can be explained afterwards and the simulator comes to the same verdict.
Randomness is a hash of those five and of what is drawn (loss, delay, …): where two rules differ only in their probability of
loss, what the milder one loses the harsher one loses too.

A burst (Gilbert-Elliott) is a chain of states, one step a message. The state at a message follows from the ones before, so it
is found by walking back to a step whose draw decides alone, whatever the state before it; that is after 1/(enter + leave)
steps on average. Chains are cut into blocks that begin with a draw of their own, so that no walk is longer than `BLOCK`.
"""

import math
from collections.abc import Iterable, Sequence
from enum import IntEnum
from fnmatch import fnmatchcase
from hashlib import blake2b
from statistics import NormalDist
from typing import NamedTuple

from lalliance_agents.wire.messages import LinkRule

#: Messages of a burst chain that are drawn together.
BLOCK = 4096

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


UNTOUCHED = Verdict((0.0,), ())


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
        """What is in force from `sender` to `receiver`; None if nothing is."""
        link = sender, receiver
        if link not in self._links:
            if len(self._links) >= MOST_LINKS:
                self._links.clear()
            rules = [rule for rule in self.rules if _matches(rule, sender, receiver)]
            self._links[link] = RuledLink(self.seed, sender, receiver, rules) if rules else None
        return self._links[link]


#: Links remembered at most: whoever makes up senders makes up links.
MOST_LINKS = 2**16


def _matches(rule: LinkRule, sender: str, receiver: str) -> bool:
    return _fits(sender, rule.senders) and _fits(receiver, rule.receivers)


def _fits(name: str, globs: Iterable[str]) -> bool:
    return any(fnmatchcase(name, glob) for glob in globs)


class RuledLink:
    """The rules on the messages of one sender to one receiver."""

    def __init__(self, seed: int, sender: str, receiver: str, rules: Sequence[LinkRule]) -> None:
        digest = blake2b(f"{seed}/{sender}/{receiver}".encode(), digest_size=8).digest()
        self._key = int.from_bytes(digest, "little")
        self._cut = next((rule for rule in rules if rule.cut), None)
        self._loss = next((rule for rule in rules if rule.loss > 0 or rule.burst_enter > 0), None)
        self._delay = next((rule for rule in rules if rule.delay != "none"), None)
        self._duplicate = next((rule for rule in rules if rule.duplicate > 0), None)
        self._reorder = next((rule for rule in rules if rule.reorder > 0), None)

    def verdict(self, incarnation: int, seq: int) -> Verdict:
        """What happens to the message `seq` that the sender sent in its life `incarnation`."""
        if self._cut is not None:
            return Verdict((), (self._cut.fault,))
        key = _mixed(self._key + 0x9E3779B97F4A7C15 * incarnation)
        if self._loss is not None and self._is_lost(self._loss, key, seq):
            return Verdict((), (self._loss.fault,))
        faults: list[str] = []
        late = 0.0
        if self._delay is not None:
            faults.append(self._delay.fault)
            late = _delay(self._delay, _uniform(key, _Draw.DELAY, seq))
        if self._reorder is not None and _uniform(key, _Draw.REORDER, seq) < self._reorder.reorder:
            faults.append(self._reorder.fault)
            late += self._reorder.held
        if self._duplicate is None or _uniform(key, _Draw.DUPLICATE, seq) >= self._duplicate.duplicate:
            return Verdict((late,), tuple(dict.fromkeys(faults)))
        copy = late if self._delay is None else _delay(self._delay, _uniform(key, _Draw.COPY_DELAY, seq))
        return Verdict((late, copy), tuple(dict.fromkeys([*faults, self._duplicate.fault])))

    def _is_lost(self, rule: LinkRule, key: int, seq: int) -> bool:
        share = rule.burst_loss if rule.burst_enter > 0 and in_burst(rule, key, seq) else rule.loss
        return _uniform(key, _Draw.LOSS, seq) < share


def in_burst(rule: LinkRule, key: int, seq: int) -> bool:
    """Whether the message `seq` of the chain `key` falls into a burst."""
    stays = 1 - rule.burst_leave
    surely_bad, surely_good = min(rule.burst_enter, stays), max(rule.burst_enter, stays)
    flips, bad = rule.burst_enter > stays, False
    undecided = 0
    for at in range(seq, -1, -1):
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
        return rule.delay_by * math.exp(rule.delay_to * _NORMAL.inv_cdf(max(drawn, 2.0**-53)))
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
