"""What happened in a mission, kept so that it can be told afterwards: the summary.

The ledger writes down who worked on what and when, what was completed, which task went from one robot to another and why, and
what everybody sent and received. Instants are the world's, in seconds since the live trial began; where a robot's own account
is used, only a length of time measured on that robot's clock enters.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from lalliance_agents.wire.messages import DecisionMade, LinkReport

_TAKEOVERS = {"silence", "impatience", "released"}


@dataclass(slots=True)
class _TaskRecord:
    attempts: list[tuple[str, float]] = field(default_factory=list)
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
        self._takeovers: list[dict[str, Any]] = []
        self._links: dict[tuple[str, int], LinkReport] = {}
        self.trials: list[float] = []

    def new_trial(self) -> None:
        """Begin a new account; counters and the makespans of earlier trials are kept."""
        self._tasks = {task: _TaskRecord() for task in self._tasks}
        self._failed_at.clear()
        self._takeovers.clear()

    def began(self, robot: str, task: str, at: float) -> None:
        """`robot` began to work on `task`."""
        if task in self._tasks:
            self._tasks[task].attempts.append((robot, at))

    def completed(self, task: str, by: tuple[str, ...], at: float) -> None:
        """`task` was finished by `by`."""
        self._tasks[task].completed_at = at
        self._tasks[task].by = by

    def failed(self, robot: str, at: float) -> None:
        """`robot` ceased to be."""
        self._failed_at[robot] = at

    def returned(self, robot: str) -> None:
        """`robot` is there again."""
        self._failed_at.pop(robot, None)

    def decided(self, made: DecisionMade, at: float) -> dict[str, Any] | None:
        """A robot reported a decision; the takeover that it is, if it is one.

        A takeover is an activation on a task that another robot was known to have been on, and had been on indeed since
        the one who takes it had it last.
        """
        record = self._tasks.get(made.task)
        if record is None or made.verb != "activate" or made.cause not in _TAKEOVERS:
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
            "delay": made.factors.get("delay"),
        }
        if made.other in self._failed_at:
            takeover["failed_at"] = self._failed_at[made.other]
            takeover["after_failure"] = at - self._failed_at[made.other]
        self._takeovers.append(takeover)
        return takeover

    def reported(self, report: LinkReport) -> None:
        """A robot's counters, which replace the ones it reported before in this incarnation."""
        self._links[report.sender, report.incarnation] = report

    def has_final(self, robot: str) -> bool:
        """Whether the latest life of `robot` has reported its counters for the last time."""
        lives = [incarnation for name, incarnation in self._links if name == robot]
        return bool(lives) and self._links[robot, max(lives)].final

    def summary(self) -> dict[str, Any]:
        """Tasks, takeovers, messages and control periods, as plain data."""
        dropped: Counter[str] = Counter()
        for report in self._links.values():
            dropped.update(report.dropped)
        return {
            "tasks": {
                task: {
                    "completed_at": record.completed_at,
                    "by": list(record.by),
                    "attempts": [{"robot": robot, "at": at} for robot, at in record.attempts],
                }
                for task, record in self._tasks.items()
            },
            "takeovers": [dict(takeover) for takeover in self._takeovers],
            "messages": {
                "sent": sum(report.sent for report in self._links.values()),
                "received": sum(report.received for report in self._links.values()),
                "dropped": dict(sorted(dropped.items())),
            },
            "control": {
                "periods": sum(report.ticks for report in self._links.values()),
                "missed": sum(report.missed for report in self._links.values()),
            },
        }


def _had_it_last(attempts: list[tuple[str, float]], other: str, sender: str) -> bool:
    """Whether `other` began the task after all but the present attempt of `sender`, which is its latest."""
    order = [robot for robot, _ in attempts]
    if other not in order:
        return False
    latest_of_other = len(order) - 1 - order[::-1].index(other)
    own = [index for index, robot in enumerate(order) if robot == sender]
    return all(index < latest_of_other for index in own[:-1])


def _detected_at(made: DecisionMade, at: float) -> float | None:
    """When the robot noticed that the other was gone from the task; None if it is still heard there."""
    for mate in made.teammates:
        lapsed = mate.get("lapsed_at")
        if mate.get("robot") == made.other and isinstance(lapsed, int | float):
            return at - max(made.at - lapsed, 0.0)
    return None
