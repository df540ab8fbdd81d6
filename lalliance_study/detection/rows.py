"""What is measured, one record a row, in files of comma-separated values that a person can read."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_type_hints


class Suspicions(NamedTuple):
    """How often living robots were taken to be silent, in one setting."""

    source: str
    """`simulated` or `real`."""
    loss: float
    burst: float
    """Mean length of a burst in messages; 0: losses are independent."""
    jitter: float
    """Messages are late by up to this, uniformly; in seconds."""
    tau_rho: float
    pairs: int
    seconds: float
    """Observed, over all pairs of robots."""
    times: int


class Detections(NamedTuple):
    """How soon dead robots were noticed, in one setting; in seconds."""

    source: str
    loss: float
    burst: float
    tau_rho: float
    crashes: int
    suspected: int
    """Noticed before they died, falsely then; they count as noticed at once."""
    p10: float
    p50: float
    p90: float
    p99: float
    low: float
    """Confidence interval (95 %) of the median."""
    high: float


class Cost(NamedTuple):
    """One mission."""

    seed: int
    crash: int
    """Whether a robot crashes."""
    loss: float
    tau_rho: float
    makespan: float
    """In seconds; not a number if the mission did not complete."""
    needless: int
    """Takeovers for silence from robots that had not failed."""
    needed: int
    """Takeovers from the robot that had crashed."""
    doubled: float
    """Share of the robots' working time in which another robot was on the same task already."""


class Reaction(NamedTuple):
    """How a team took one fault of one robot; times in seconds, not a number where it did not happen."""

    fault: str
    seed: int
    silent: float
    """From the fault until the first teammate counted the robot as silent."""
    decided: float
    """From the fault until the first decision that nobody made without it."""
    who: str
    """`teammate` or `itself`."""
    what: str
    """Which decision, and why."""
    delay: float
    """How much later the mission was complete than without the fault."""


R = TypeVar("R", Suspicions, Detections, Cost, Reaction)


def _written(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def save(path: Path, rows: Iterable[R], kind: type[R]) -> None:
    """Write rows, with the names of their fields in the first line."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(kind._fields)
        writer.writerows([_written(value) for value in row] for row in rows)


def load(path: Path, kind: type[R]) -> list[R]:
    """Read rows; none if there is no such file."""
    if not path.exists():
        return []
    types = list(get_type_hints(kind).values())
    with path.open(newline="") as file:
        reader = csv.reader(file)
        next(reader)
        return [kind(*(cast(cell) for cast, cell in zip(types, row, strict=True))) for row in reader]
