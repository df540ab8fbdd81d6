"""What the decoder does with a million random and mutated messages: `python -m tests.wire.fuzz --cases 1000000 --seed 1`.

A case is a key and a payload: a valid message of some kind, changed as a document, as bytes and in its key, or bytes by
chance. Each goes through the decoder, and through a `Messenger`. It is refused for one reason, in one short line, and soon;
or it is accepted, and what was accepted is the same once more when it is packed and decoded again. All else is a defect.
"""

import argparse
import asyncio
import logging
import resource
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from random import Random

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.messages import BODY_OF, MAX_PAYLOAD, Message, decode, decode_at, encode

from .cases import Case, Cases
from .samples import KEYS

REASONS = {"key", "size", "msgpack", "form", "version", "content", "sender", "task"}

#: Letters of a refusal at most.
SHORT = 200


class DefectError(Exception):
    """The decoder did what it must not."""


@dataclass
class Report:
    """What became of the cases."""

    cases: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    """The longest time that one case took in the decoder, in seconds."""
    defects: list[str] = field(default_factory=list)

    @property
    def missing(self) -> set[str]:
        """The outcomes that never occurred."""
        return (REASONS | {f"accepted {kind.name}" for kind in BODY_OF}) - self.outcomes.keys()


class Judge:
    """Says what becomes of a case, and whether that may be.

    Args:
        messenger: one that hears everything.
        slow: how long a case may take in the decoder, in seconds.
    """

    def __init__(self, messenger: Messenger, slow: float) -> None:
        self.report = Report()
        self._messenger = messenger
        self._slow = slow

    def judge(self, case: Case) -> None:
        """Decode one case, and report."""
        self.report.cases += 1
        began = time.perf_counter()
        try:
            outcome, message = _outcome(case)
            took = time.perf_counter() - began
            self.report.outcomes[outcome] += 1
            if message is not None:
                _check_same(message)
            self._check_taken(case)
        except BaseException as error:  # Also what a library in Rust raises when it panics.
            if isinstance(error, KeyboardInterrupt):
                raise
            self._defect(case, repr(error))
            return
        if took > self.report.slowest:
            self._time(case, took)

    def _check_taken(self, case: Case) -> None:
        """Each message is either handed on, or dropped for a reason that is counted."""
        messenger = self._messenger
        before = messenger.received + messenger.dropped.total()
        messenger.take(Sample(case.key, case.payload), lambda *_: None)
        after = messenger.received + messenger.dropped.total()
        _require(after == before + 1, f"counted {after - before} times")

    def _time(self, case: Case, took: float) -> None:
        """Take notice of a slow case; one that was only interrupted is quicker the next time."""
        for _ in range(3):
            began = time.process_time()
            _outcome(case)
            took = min(took, time.process_time() - began)
        self.report.slowest = max(took, self.report.slowest)
        if took > self._slow:
            self._defect(case, f"takes {took * 1000:.0f} ms")

    def _defect(self, case: Case, what: str) -> None:
        number = self.report.cases
        self.report.defects.append(f"case {number}: {what[:300]!a}: {case.key[:100]!a} {case.payload[:200].hex()}")


def _require(condition: bool, otherwise: str) -> None:
    if not condition:
        raise DefectError(otherwise)


def _outcome(case: Case) -> tuple[str, Message | None]:
    """The reason why a case is refused, or which kind was accepted."""
    try:
        key = KEYS.parse(case.key)
        spelled = KEYS.build(key.kind, robot=key.robot or "", task=key.task or "")
        _require(spelled == case.key, f"parsed as {key}")
        return f"accepted {key.kind.name}", decode_at(key, case.payload)
    except MessageError as error:
        text = str(error)
        _require(error.reason in REASONS, f"refused for an unknown reason, {text}")
        _require(text.isprintable() and len(text) < SHORT, f"refused not in one short line: {text}")
        return error.reason, None


def _check_same(message: Message) -> None:
    """Packed and decoded again, a message is the same; unless it does not fit any more, with all its defaults."""
    packed = encode(message)
    if len(packed) <= MAX_PAYLOAD:
        again = decode(type(message), packed)
        _require(again == message and encode(again) == packed, f"{message} comes back as {again}")


async def fuzz(seed: int, cases: int, *, slow: float) -> Report:
    """Judge a number of cases, the same for the same seed."""
    made = Cases(Random(seed))
    async with MemoryBus(MemoryHub()) as bus:
        judge = Judge(Messenger(bus, KEYS, "@fuzz", 1, lambda: 0.0), slow)
        for _ in range(cases):
            judge.judge(made.next())
    return judge.report


def _print(report: Report, elapsed: float) -> None:
    lines = [f"{count:9,}  {outcome}" for outcome, count in sorted(report.outcomes.items())]
    lines += [f"never happened: {outcome}" for outcome in sorted(report.missing)]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    lines.append(f"{report.cases:9,}  cases in {elapsed:.1f} s: {report.cases / elapsed:,.0f}/s")
    lines.append(
        f"slowest {report.slowest * 1000:.1f} ms; peak memory of all {peak} MiB; {len(report.defects)} defects"
    )
    lines += report.defects[:20]
    sys.stdout.write("\n".join(lines) + "\n")


def main() -> int:
    """Run from the command line; the exit status is 1 if there are defects, or outcomes that never happened."""
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("--cases", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slow", type=float, default=50.0, help="what is slow, in milliseconds")
    arguments = parser.parse_args()
    logging.disable()
    began = time.perf_counter()
    report = asyncio.run(fuzz(arguments.seed, arguments.cases, slow=arguments.slow / 1000))
    _print(report, time.perf_counter() - began)
    return 1 if report.defects or report.missing else 0


if __name__ == "__main__":
    sys.exit(main())
