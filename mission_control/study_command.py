"""`lalliance study`: the paper's experiments, redone and carried further."""

import math
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from lalliance_agents.errors import UserError

if TYPE_CHECKING:
    from lalliance_study.experiments.runner import HandOut, Study

#: What a study cannot do without.
NEEDED = ("numba", "ortools", "polars", "scipy")
#: How often a run says how far it is, where there is no terminal to show it on, in seconds.
NEWS = 60.0

study = typer.Typer(
    help="The paper's experiments, redone and carried further.", no_args_is_help=True, rich_markup_mode=None
)


class Backend(StrEnum):
    """Where the work is done."""

    LOCAL = "local"
    DASK = "dask"


@study.callback()
def _study() -> None:
    """The paper's experiments, redone and carried further."""


@study.command()
def run(
    preset: Annotated[
        str, typer.Option(metavar="NAME", help="Which study: mini (a minute), paper (an hour on two cores), or full.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Its folder. A study that is there already is gone on with.")
    ],
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Where all that is drawn comes from.")] = 0,
    missions: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="Missions of each scenario; default: the preset's own number."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, max=1024, help="Processes; default: one per processor.")] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="EXPERIMENT", help="Only this one now; may be given several times.")
    ] = None,
    backend: Annotated[Backend, typer.Option(help="Here, or on the workers of a Dask scheduler.")] = Backend.LOCAL,
    scheduler: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Of Dask, as tcp://HOST:8786.")] = None,
) -> None:
    """Run the missions of a study, or those that are missing, and keep a row of each.

    Rows and MANIFEST.json in DIR are the same however often the run was interrupted, and wherever it was done.
    """
    from lalliance_study.extras import study_package

    for package in NEEDED:
        study_package(package)
    if (backend is Backend.DASK) != (scheduler is not None):
        raise UserError("--scheduler names where --backend dask does the work; expected both or neither")
    if scheduler is not None and jobs is not None:
        raise UserError("--jobs counts processes of this machine; expected none with --backend dask")
    from lalliance_study.experiments.presets import preset as preset_of
    from lalliance_study.experiments.runner import open_study

    with _told_to_end() as told:
        try:
            wanted = preset_of(preset)
            hand_out = _hand_out(scheduler, jobs)
            found = open_study(out, wanted, missions=missions, seed=seed, only=only or ())
            _carry_out(found, hand_out)
        except KeyboardInterrupt:
            number = told[0] if told else signal.SIGINT
            typer.echo("lalliance: interrupted; the same command goes on with what is left", err=True)
            raise typer.Exit(128 + number) from None
    typer.echo(f"{_rows(found)} rows of study {preset} are in {out}")


def _hand_out(scheduler: str | None, jobs: int | None) -> "HandOut":
    if scheduler is None:
        from lalliance_study.experiments.runner import here

        return here(jobs)
    from lalliance_study.experiments.cluster import at_workers_of

    return at_workers_of(scheduler)


def _carry_out(found: "Study", hand_out: "HandOut") -> None:
    from lalliance_study.experiments.runner import run as carry_out
    from lalliance_study.pool import progress

    total = sum(part.runs for part in found.left)
    if found.done and total:
        typer.echo(f"{found.done} rows are there already, {total} are left", err=True)
    pace = _Pace(total)
    with progress("rows", total) as advance:

        def came(count: int) -> None:
            advance(count, "")
            pace.came(count)

        carry_out(found, hand_out, came)


class _Pace:
    """Says in a line now and then how long it will take, if nobody sees the progress bar.

    Time counts from the first rows on: what comes before them, such as compiling, comes once.
    """

    def __init__(self, total: int) -> None:
        self._left, self._done = total, 0
        self._began = self._said = math.inf
        self._speaks = not sys.stderr.isatty()

    def came(self, count: int) -> None:
        """Some rows have come."""
        now = time.monotonic()
        self._left -= count
        if self._began == math.inf:
            self._began = self._said = now
            return
        self._done += count
        if self._speaks and now - self._said >= NEWS and self._left:
            self._said = now
            minutes = (now - self._began) / self._done * self._left / 60
            typer.echo(f"{self._left} rows are left, which takes about {minutes:.0f} minutes", err=True)


def _rows(found: "Study") -> int:
    return found.done + sum(part.runs for part in found.left)


@contextmanager
def _told_to_end() -> Iterator[list[int]]:
    """Let SIGTERM end the work as Ctrl-C does; in the list then is which of the two it was."""
    told: list[int] = []

    def stop(number: int, _: FrameType | None) -> None:
        told.append(number)
        raise KeyboardInterrupt

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield told
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@study.command()
def report(
    results: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a study, whole or not.")],
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where the report is written; default: report in the study's folder."),
    ] = None,
) -> None:
    """Draw the figures of a study and write report.md: every claim of the paper with its verdict.

    A study that is not complete is reported as far as it goes, and the report says so.
    """
    from lalliance_study.extras import study_package

    for package in ("matplotlib", "polars", "scipy"):
        study_package(package)
    from lalliance_study.pool import progress
    from lalliance_study.report.report import report as write
    from lalliance_study.report.report import steps
    from lalliance_study.report.results import Results

    found = Results(results)
    if found.missing:
        typer.echo(
            f"lalliance: warning: {found.missing} of {found.parts} parts are missing; "
            f"lalliance study run --preset {found.manifest.preset} --missions {found.manifest.missions} "
            f"--seed {found.manifest.seed} --out {results} goes on with them",
            err=True,
        )
    with progress("report", steps()) as advance:
        page = write(found, results / "report" if out is None else out, advance)
    typer.echo(f"the report is {page}")
