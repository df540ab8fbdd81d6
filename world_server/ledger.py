"""What happened in a mission, kept so that it can be told afterwards: the summary.

The ledger writes down who worked on what and when, what was completed, which task went from one robot to another and why, and
what everybody sent and received. Instants are the world's, in seconds since the live trial began; where a robot's own account
is used, only a length of time measured on that robot's clock enters, and what is not a number there is left out. However
often a robot says something, what is kept of it is limited: the latest attempts and takeovers, and sums of counters.
"""

import math
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from typing import Any

from lalliance_agents.wire.keys import WORLD
from lalliance_agents.wire.messages import DecisionMade, Effect, LinkReport

_TAKEOVERS = {"silence", "impatience", "released"}

#: Attempts kept per task, and takeovers kept in all: the latest.
MOST_KEPT = 1000
#: Letters kept of a cause.
MOST_LETTERS = 40
#: Reasons of drops that are told apart; those of a robot that makes up more count as `OTHER_REASONS`.
MOST_REASONS = 100
OTHER_REASONS = "others"
#: How an attempt ended with which its task was completed.
COMPLETE = "complete"
#: Of drops by hearer, sender and reason, those told apart; more are not kept.
MOST_DROPS = 1000


@dataclass(slots=True)
class _Counts:
    """Sums over link reports."""

    sent: int = 0
    received: int = 0
    dropped: Counter[str] = field(default_factory=Counter)
    drops: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    """By hearer, sender and reason."""
    ticks: int = 0
    missed: int = 0

    def add(self, report: LinkReport) -> None:
        self.sent += report.sent
        self.received += report.received
        self.ticks += report.ticks
        self.missed += report.missed
        for reason, count in report.dropped.items():
            known = reason in self.dropped or len(self.dropped) < MOST_REASONS
            self.dropped[reason if known else OTHER_REASONS] += count
        for drop in report.drops:
            row = report.sender, drop.sender, drop.reason
            if row in self.drops or len(self.drops) < MOST_DROPS:
                self.drops[row] += drop.count


@dataclass(slots=True)
class _Attempt:
    robot: str
    at: float
    ended: str | None = None
    """`complete` if the task was completed meanwhile, `lost` if the robot was; else the cause that it gave for its end."""


@dataclass(slots=True)
class _TaskRecord:
    attempts: deque[_Attempt] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))
    completed_at: float | None = None
    by: tuple[str, ...] = ()


class Ledger:
    """The account of one trial; what robots counted is kept over all trials.

    Args:
        tasks: the mission's tasks.
    """

    def __init__(self, tasks: list[str]) -> None:
        self._tasks = {task: _TaskRecord() for task in tasks}
        self._failed_at: dict[str, float] = {}
        self._takeovers: deque[dict[str, Any]] = deque(maxlen=MOST_KEPT)
        self._links: dict[str, LinkReport] = {}
        self._earlier_lives = _Counts()
        #: What the world's own server could not use, by sender and reason.
        self.dropped_here: Mapping[tuple[str, str], int] = {}
        self.trials: list[float] = []

    def new_trial(self) -> None:
        """Begin a new account; counters and the makespans of earlier trials are kept."""
        self._tasks = {task: _TaskRecord() for task in self._tasks}
        self._failed_at.clear()
        self._takeovers.clear()

    def began(self, robot: str, task: str, at: float) -> None:
        """`robot` began to work on `task`."""
        if task in self._tasks:
            self._tasks[task].attempts.append(_Attempt(robot, at))

    def completed(self, task: str, by: tuple[str, ...], at: float) -> None:
        """`task` was finished by `by`; that ends all attempts at it."""
        record = self._tasks[task]
        record.completed_at, record.by = at, by
        for attempt in record.attempts:
            attempt.ended = attempt.ended or COMPLETE

    def failed(self, robot: str, at: float) -> None:
        """`robot` ceased to be."""
        self._failed_at[robot] = at
        for task in self._tasks:
            self._ended(robot, task, "lost")

    def returned(self, robot: str) -> None:
        """`robot` is there again."""
        self._failed_at.pop(robot, None)

    def decided(self, made: DecisionMade, at: float) -> dict[str, Any] | None:
        """A robot reported a decision; the takeover that it is, if it is one.

        A takeover is an activation on a task that another robot was known to have been on, and had been on indeed since
        the one who takes it had it last, not counting what ended at once in a collision.
        """
        record = self._tasks.get(made.task)
        if record is None:
            return None
        if made.verb != "activate":
            self._ended(made.sender, made.task, made.cause)
        if made.verb != "activate" or made.cause not in _TAKEOVERS:
            return None
        if made.other is None or not _had_it_last(record.attempts, made.other, made.sender):
            return None
        takeover = {
            "task": made.task,
            "from": made.other,
            "to": made.sender,
            "cause": made.cause,
            "detected_at": _detected_at(made, at),
            "taken_at": at,
            "delay": _number(made.factors.get("delay")),
        }
        if made.other in self._failed_at:
            takeover["failed_at"] = self._failed_at[made.other]
            takeover["after_failure"] = at - self._failed_at[made.other]
        self._takeovers.append(takeover)
        return takeover

    def _ended(self, robot: str, task: str, cause: str) -> None:
        """Note how the latest attempt of `robot` at `task` ended, if it has not ended already."""
        latest = next((one for one in reversed(self._tasks[task].attempts) if one.robot == robot), None)
        if latest is not None and latest.ended is None:
            latest.ended = cause[:MOST_LETTERS]

    def reported(self, report: LinkReport) -> list[Effect]:
        """A robot's counters, which replace the ones it reported before in this incarnation; what faults did since."""
        before = self._links.get(report.sender)
        if before is not None and before.incarnation != report.incarnation:
            self._earlier_lives.add(before)
        self._links[report.sender] = report
        return _newly(report, before)

    def lives(self) -> dict[str, int]:
        """The latest incarnation of each robot that has reported its counters."""
        return {robot: report.incarnation for robot, report in self._links.items()}

    def has_final(self, robot: str) -> bool:
        """Whether the latest life of `robot` has reported its counters for the last time."""
        return robot in self._links and self._links[robot].final

    @property
    def last_completion(self) -> float | None:
        """When the last task was completed, if any was."""
        return max((one.completed_at for one in self._tasks.values() if one.completed_at is not None), default=None)

    def _counts(self) -> _Counts:
        """The sums over all robots and their lives."""
        counts = deepcopy(self._earlier_lives)
        for report in self._links.values():
            counts.add(report)
        return counts

    def drops(self) -> list[dict[str, Any]]:
        """Who did not use how many messages of whom, and why: robots, and the world's server."""
        rows = sorted(self._counts().drops.items())
        rows += sorted(((WORLD, of, reason), count) for (of, reason), count in self.dropped_here.items())
        return [{"at": at, "of": of, "reason": reason, "count": count} for (at, of, reason), count in rows]

    def summary(self) -> dict[str, Any]:
        """Tasks, takeovers, messages and control periods, as plain data."""
        counts = self._counts()
        return {
            "tasks": {
                task: {
                    "completed_at": record.completed_at,
                    "by": list(record.by),
                    "attempts": [asdict(attempt) for attempt in record.attempts],
                }
                for task, record in self._tasks.items()
            },
            "takeovers": [dict(takeover) for takeover in self._takeovers],
            "messages": {
                "sent": counts.sent,
                "received": counts.received,
                "dropped": dict(sorted(counts.dropped.items())),
                "drops": self.drops(),
            },
            "control": {"periods": counts.ticks, "missed": counts.missed},
        }


def _had_it_last(attempts: Iterable[_Attempt], other: str, sender: str) -> bool:
    """Whether `other` began the task after all but the present attempt of `sender`, which is its latest."""
    order = [one.robot for one in attempts if one.ended != "collision"]
    if other not in order:
        return False
    latest_of_other = len(order) - 1 - order[::-1].index(other)
    own = [index for index, robot in enumerate(order) if robot == sender]
    return all(index < latest_of_other for index in own[:-1])


def _detected_at(made: DecisionMade, at: float) -> float | None:
    """When the robot noticed that the other was gone from the task; None if it is still heard there."""
    for mate in made.teammates:
        lapsed = _number(mate.get("lapsed_at"))
        if mate.get("robot") == made.other and lapsed is not None:
            return max(at - max(made.at - lapsed, 0.0), 0.0)
    return None


def _number(value: str | float | None) -> float | None:
    return value if isinstance(value, int | float) and math.isfinite(value) else None


def _newly(report: LinkReport, before: LinkReport | None) -> list[Effect]:
    """What faults did since the robot's report before, in this life."""
    known: dict[tuple[str, str], int] = {}
    if before is not None and before.incarnation == report.incarnation:
        known = {(one.fault, one.sender): one.count for one in before.effects}
    return [
        Effect(fault=one.fault, sender=one.sender, count=more)
        for one in report.effects
        if (more := one.count - known.get((one.fault, one.sender), 0)) > 0
    ]
