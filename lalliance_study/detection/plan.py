"""Which settings are measured, how often, and all of it at once on all cores.

All seeds come from one. A part is a function of a module and its arguments, as it goes to another process, and returns rows;
the same parts give the same rows, whatever order they come in.
"""

import json
import platform
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from lalliance_agents.errors import UserError
from lalliance_study.detection.cost import cost
from lalliance_study.detection.law import Loss
from lalliance_study.detection.probe import count_suspicions, quantiles, time_detections
from lalliance_study.detection.reactions import FAULTS, reaction
from lalliance_study.detection.rows import Cost, Detections, Reaction, Suspicions, save
from lalliance_study.pool import at_once, progress

#: The kinds of parts, each with rows of its own.
KINDS = ("listen", "detect", "cost", "react")
MANIFEST = "manifest.json"

Row: TypeAlias = Suspicions | Detections | Cost | Reaction
Part: TypeAlias = tuple[str, tuple[Any, ...]]

#: Parameters demand tau > 2/rho, so that 2 is approached from above.
TAU_RHOS = (2.01, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0)
LOSSES = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
#: Mean length of a burst, in messages.
BURST = 5.0
#: The stairs of the law: one loss, many tau, and messages on time or late by up to half a period.
STAIRS = tuple(2.125 + step / 8 for step in range(32))
STAIRS_LOSS = 0.5
JITTERS = (0.0, 0.1)
COST_TAU_RHOS = (2.01, 3.0, 4.0, 5.0, 7.0, 10.0)
COST_LOSSES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is measured of each setting."""

    listening: float
    """Length of one run of the probe, in seconds."""
    runs: int
    """Runs of the probe; twice as many for small losses."""
    crashes: int
    missions: int
    scenes: int


FULL = Effort(listening=4000.0, runs=3, crashes=300, missions=32, scenes=100)
QUICK = Effort(listening=200.0, runs=1, crashes=10, missions=2, scenes=3)


def parts(effort: Effort, seed: int) -> list[Part]:
    """All that is to be done, longest parts first."""
    streams = iter(np.random.SeedSequence(seed).spawn(5))

    def seeds(count: int) -> list[int]:
        return [int(one) for one in next(streams).generate_state(count)]

    losses = [Loss(share, burst) for burst in (None, BURST) for share in LOSSES]
    listened = seeds(2 * effort.runs)
    planned: list[Part] = [
        ("detect", (loss, seeds_of_crashes)) for seeds_of_crashes in [seeds(effort.crashes)] for loss in losses
    ]
    # Between whole periods pairs differ by their phases, so many pairs count for more than long runs.
    stairs = seeds(8 * effort.runs)
    planned += [
        ("listen", (STAIRS, Loss(STAIRS_LOSS), jitter, effort.listening / 16, each))
        for jitter in JITTERS
        for each in stairs
    ]
    planned += [
        ("listen", (TAU_RHOS, loss, 0.0, effort.listening, each))
        for loss in losses
        for each in listened[: effort.runs if loss.share > 0.2 else None]
    ]
    settings = [(crash, loss, tau_rho) for crash in (False, True) for loss in COST_LOSSES for tau_rho in COST_TAU_RHOS]
    planned += [("cost", (each, *setting)) for each in seeds(effort.missions) for setting in settings]
    planned += [("react", (each, fault)) for each in seeds(effort.scenes) for fault in FAULTS]
    return planned


def work(kind: str, arguments: tuple[Any, ...]) -> list[Row]:
    """Do one part."""
    return _WORK[kind](*arguments)


def _listen(tau_rhos: tuple[float, ...], loss: Loss, jitter: float, lasts: float, seed: int) -> list[Row]:
    counts, seconds = count_suspicions(tau_rhos, loss, jitter, lasts, seed)
    return [
        Suspicions("simulated", loss.share, loss.burst or 0.0, jitter, tau_rho, 1, seconds, count)
        for tau_rho, count in zip(tau_rhos, counts, strict=True)
    ]


def _detect(loss: Loss, seeds: list[int]) -> list[Row]:
    timed = time_detections(TAU_RHOS, loss, seeds)
    return [
        Detections(
            "simulated",
            loss.share,
            loss.burst or 0.0,
            tau_rho,
            crashes=len(times),
            suspected=sum(time < 0 for time in times),
            **quantiles(times),
        )
        for tau_rho, times in zip(TAU_RHOS, timed, strict=True)
    ]


def _cost(seed: int, crash: bool, loss: float, tau_rho: float) -> list[Row]:
    return [cost(seed, loss, tau_rho, crash=crash)]


def _react(seed: int, fault: str) -> list[Row]:
    return [reaction(seed, fault)]


_WORK: dict[str, Callable[..., list[Row]]] = {"listen": _listen, "detect": _detect, "cost": _cost, "react": _react}


def summed(rows: list[Suspicions]) -> Iterator[Suspicions]:
    """One row for each setting: the runs of the probe together."""
    runs: dict[tuple[Any, ...], list[Suspicions]] = defaultdict(list)
    for row in rows:
        runs[row[:5]].append(row)
    for same in runs.values():
        yield same[0]._replace(
            pairs=len(same), seconds=sum(row.seconds for row in same), times=sum(row.times for row in same)
        )


def run(out: Path, *, quick: bool, seed: int, jobs: int | None, only: str | None = None) -> dict[str, Any]:
    """Measure and write rows into `out`; what is said of the run in its manifest.

    Args:
        out: the folder of the rows.
        quick: little of everything.
        seed: where all that is drawn comes from.
        jobs: the number of processes; None: one per core.
        only: the one kind of parts (`KINDS`) whose rows are to be renewed in a folder that has all; None: everything.

    Raises:
        UserError: with `only`, the folder's other rows are of another seed or effort, or it has none.
    """
    whole, wanted = parts(QUICK if quick else FULL, seed), {"seed": seed, "quick": quick}
    manifest = _manifest_of(out, wanted) if only else _about_this_run() | wanted
    planned, began = [part for part in whole if only in {None, part[0]}], time.monotonic()
    rows: list[Row] = []
    with progress("Failure detection", len(planned)) as advance:
        for found in at_once(work, planned, jobs):
            rows += found
            advance(1, "")
    out.mkdir(parents=True, exist_ok=True)
    for kind in KINDS if only is None else (only,):
        _SAVE[kind](out, rows)
    took = {"parts": len(planned), "seconds": round(time.monotonic() - began)}
    # Of a run that renews one kind of rows the manifest says no more than that the parts may have become more.
    kept = took if only is None else {"parts": len(whole)}
    (out / MANIFEST).write_text(json.dumps(manifest | kept, indent=2) + "\n")
    return manifest | took


def _about_this_run() -> dict[str, Any]:
    return {"lalliance": version("lalliance"), "python": platform.python_version(), "machine": platform.machine()}


def _manifest_of(out: Path, wanted: dict[str, Any]) -> dict[str, Any]:
    """What the manifest in `out` says, if it is of a run as `wanted`."""
    try:
        manifest: dict[str, Any] = json.loads((out / MANIFEST).read_text())
    except (OSError, ValueError) as error:
        raise UserError(f"{out / MANIFEST} cannot be read: {error}; expected rows of all kinds in {out}") from None
    for name, value in wanted.items():
        if manifest.get(name) != value:
            raise UserError(
                f"the rows in {out} have {name} {manifest.get(name)!r}; expected {value!r} for those beside them"
            )
    return manifest


def _save_suspicions(out: Path, rows: list[Row]) -> None:
    counted = summed([row for row in rows if isinstance(row, Suspicions)])
    save(
        out / "suspicions.csv",
        sorted(counted, key=lambda row: (row.burst, row.loss, row.jitter, row.tau_rho)),
        Suspicions,
    )


def _save_detections(out: Path, rows: list[Row]) -> None:
    timed = [row for row in rows if isinstance(row, Detections)]
    save(out / "detections.csv", sorted(timed, key=lambda row: (row.burst, row.loss, row.tau_rho)), Detections)


def _save_costs(out: Path, rows: list[Row]) -> None:
    save(out / "costs.csv", sorted(row for row in rows if isinstance(row, Cost)), Cost)


def _save_reactions(out: Path, rows: list[Row]) -> None:
    taken = [row for row in rows if isinstance(row, Reaction)]
    save(out / "reactions.csv", sorted(taken, key=lambda row: (list(FAULTS).index(row.fault), row.seed)), Reaction)


_SAVE: dict[str, Callable[[Path, list[Row]], None]] = {
    "listen": _save_suspicions,
    "detect": _save_detections,
    "cost": _save_costs,
    "react": _save_reactions,
}
