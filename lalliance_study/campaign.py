"""Many random missions, each simulated and judged; what is found is counted, and what fails is made small.

A campaign of seed `S` is the missions 0, 1, 2, … of `random_missions`. Examining one is a pure function of (S, number) but
for the time limit; whoever has several processors examines parts of it in several processes and adds up the results. The
digest is a sum over the missions, so that it does not depend on their order, and shows whether two campaigns saw the same.
"""

import signal
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import blake2b
from traceback import extract_tb
from types import FrameType
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from lalliance_agents.config import Mission
from lalliance_agents.faults import Blind, Bursts, Crash, Fault, LinkFault, Stuck, kind_of
from lalliance_study.evidence import Evidence, gather
from lalliance_study.invariants import Violation, judge
from lalliance_study.promises import promise
from lalliance_study.random_missions import Document, draw_mission, mission_of
from lalliance_study.shrink import shrink

#: One in so many missions is run once more, and once with another seed.
REPEAT_EVERY = 50
#: One in so many missions is run with every step made, which takes longer.
EVERY_STEP_EVERY = 200
#: A mission that takes longer to simulate has no end, in seconds of this machine.
TIME_LIMIT = 120.0

_MASK = 2**64 - 1


class NoEndError(Exception):
    """A simulation takes longer than the time limit."""


class Failure(NamedTuple):
    """A mission of a campaign that broke invariants."""

    number: int
    violations: tuple[Violation, ...]


@dataclass
class Result:
    """What came of some missions of a campaign."""

    missions: int = 0
    complete: int = 0
    promised: int = 0
    excused: Counter[str] = field(default_factory=Counter)
    """Missions that did not complete and need not have, by the reason."""
    virtual: int = 0
    """Microseconds simulated: whole ones, whose sum does not depend on the order."""
    scheduled: Counter[str] = field(default_factory=Counter)
    fired: Counter[str] = field(default_factory=Counter)
    """Faults by kind: those that missions had, and those that had an effect."""
    takeovers: Counter[str] = field(default_factory=Counter)
    """By cause."""
    repeated: int = 0
    stepped: int = 0
    """Missions that were run again, and with every step."""
    digest: int = 0
    failures: list[Failure] = field(default_factory=list)

    def add(self, other: "Result") -> None:
        """Take in what came of other missions."""
        for name in ("missions", "complete", "promised", "repeated", "stepped", "virtual"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("excused", "scheduled", "fired", "takeovers"):
            getattr(self, name).update(getattr(other, name))
        self.digest = (self.digest + other.digest) & _MASK
        self.failures = sorted([*self.failures, *other.failures])

    def as_plain(self) -> dict[str, Any]:
        """As plain data, without the failures."""
        kinds = sorted(self.scheduled)
        return {
            "missions": self.missions,
            "complete": self.complete,
            "promised": self.promised,
            "excused": dict(sorted(self.excused.items())),
            "virtual_hours": self.virtual / 3.6e9,
            "faults": {kind: {"scheduled": self.scheduled[kind], "fired": self.fired[kind]} for kind in kinds},
            "takeovers": dict(sorted(self.takeovers.items())),
            "repeated": self.repeated,
            "every_step": self.stepped,
            "digest": f"{self.digest:016x}",
        }


def examine(seed: int, numbers: Iterable[int]) -> Result:
    """Draw, simulate and judge missions of campaign `seed`."""
    result = Result()
    for number in numbers:
        _, mission = draw_mission(seed, number)
        result.missions += 1
        evidence, violations = try_mission(mission)
        if evidence is not None:
            _count(result, evidence)
            if number % REPEAT_EVERY == 0:
                result.repeated += 1
                violations += is_repeatable(evidence)
            if number % EVERY_STEP_EVERY == 0:
                result.stepped += 1
                violations += skips_nothing(evidence)
        if violations:
            result.failures.append(Failure(number, tuple(violations)))
    return result


def try_mission(mission: Mission) -> tuple[Evidence | None, list[Violation]]:
    """Simulate and judge a mission; no evidence if it had no end, or ended with an error of ours."""
    try:
        with _limited(TIME_LIMIT):
            evidence = gather(mission)
            return evidence, judge(evidence)
    except NoEndError:
        return None, [Violation("ends", f"no end after {TIME_LIMIT:g} s of computing")]
    except Exception as error:  # whatever a mission makes our code raise is what a campaign is to find
        where = extract_tb(error.__traceback__)[-1]
        place = f"{where.filename.rpartition('/')[2]}:{where.lineno}"
        return None, [Violation("no_error", f"{type(error).__name__} at {place}: {error}")]


def check_fully(mission: Mission) -> list[Violation]:
    """All that a campaign can find wrong with a mission, with the checks that a campaign makes of some missions only."""
    evidence, violations = try_mission(mission)
    if evidence is not None:
        violations += is_repeatable(evidence) + skips_nothing(evidence)
    return violations


def is_repeatable(evidence: Evidence) -> list[Violation]:
    """The same seed gives the same log, and another seed another one, if robots decided anything at all."""
    mission = evidence.mission
    difference = _first_difference(evidence, gather(mission))
    found = [] if difference is None else [Violation("is_repeatable", f"a second run differs: {difference}")]
    if evidence.history.spans:
        other = gather(mission.model_copy(update={"seed": (mission.seed + 1) % 2**63}))
        if evidence.log == other.log:
            found.append(Violation("is_repeatable", "another seed gives the very same log"))
    return found


def skips_nothing(evidence: Evidence) -> list[Violation]:
    """A run in which every control step is made, and every message, has the same log and the same summary."""
    difference = _first_difference(evidence, gather(evidence.mission, every_step=True))
    return [] if difference is None else [Violation("skips_nothing", f"with every step made: {difference}")]


def _first_difference(one: Evidence, other: Evidence) -> str | None:
    for first, second in zip(one.log, other.log, strict=False):
        if first != second:
            return f"'{second}' instead of '{first}'"
    if len(one.log) != len(other.log):
        return f"{len(other.log)} lines instead of {len(one.log)}"
    for name, value in one.summary.items():
        if other.summary[name] != value:
            return f"in the summary, {name} {other.summary[name]} instead of {value}"
    return None


def _count(result: Result, evidence: Evidence) -> None:
    promised = promise(evidence.mission)
    complete = evidence.summary["complete"]
    result.complete += complete
    result.promised += promised.seconds is not None
    if not complete and promised.seconds is None:
        result.excused[promised.why] += 1
    result.virtual += round(evidence.ended * 1e6)
    for fault, report in zip(evidence.mission.faults, evidence.summary["faults"], strict=True):
        kinds = kinds_of(fault)
        result.scheduled.update(kinds)
        if report["fired"]:
            result.fired.update(kinds)
    result.takeovers.update(one["cause"] for one in evidence.summary["takeovers"])
    told = "\n".join(map(str, evidence.log)).encode()
    result.digest = (result.digest + int.from_bytes(blake2b(told, digest_size=8).digest(), "little")) & _MASK


def kinds_of(fault: Fault) -> list[str]:
    """What a fault is counted as; a rule of links as each of its aspects."""
    match fault:
        case Crash():
            return ["crash, restarted" if fault.restart else "crash"]
        case Stuck():
            return ["stuck" if fault.task is None else "stuck at a task"]
        case Blind():
            return ["blind" if fault.delay is None else "blind, late senses"]
        case LinkFault():
            found = [f"link {name}" for name in fault.aspects()] + ["link cut"] * fault.cut
            return ["link bursts" if name == "link loss" and isinstance(fault.loss, Bursts) else name for name in found]
        case _:
            return [kind_of(fault)]


def make_small(seed: int, failure: Failure) -> Document:
    """A small mission that breaks the first invariant that `failure` broke."""
    document, _ = draw_mission(seed, failure.number)
    wanted = failure.violations[0].invariant
    return shrink(document, lambda smaller: breaks(smaller, wanted))


def breaks(document: Document, invariant: str) -> bool:
    """Whether a document is a mission that breaks `invariant`."""
    try:
        mission = mission_of(document)
    except (ValidationError, PydanticCustomError):
        return False
    sampled = invariant in {"is_repeatable", "skips_nothing"}
    violations = check_fully(mission) if sampled else try_mission(mission)[1]
    return any(one.invariant == invariant for one in violations)


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise `NoEndError` in this process's main thread after `seconds`."""

    def stop(_: int, __: FrameType | None) -> None:
        raise NoEndError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
