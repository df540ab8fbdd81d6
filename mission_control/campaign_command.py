"""`lalliance campaign`: many random missions with faults, each simulated and checked against what must always hold."""

import json
import os
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lalliance_agents.errors import UserError
from mission_control.shell import ToldToEnd

if TYPE_CHECKING:
    from rich.console import Console

    from lalliance_study.campaign import Failure, Result
    from lalliance_study.invariants import Violation

#: Failing missions that are made small; of a defect that strikes everywhere a few examples are enough.
MOST_MADE_SMALL = 10
#: Missions that are handed to a process at once.
PART = 16

Missions = Annotated[int, typer.Option(min=1, help="How many missions.")]
Seed = Annotated[
    int, typer.Option(min=0, max=2**63 - 1, help="The campaign's seed; mission K of seed S is always the same.")
]
Only = Annotated[int | None, typer.Option(min=0, metavar="K", help="Examine mission K alone.")]
Replay = Annotated[Path | None, typer.Option(metavar="FILE", help="Simulate and check a mission file instead.")]
Jobs = Annotated[int | None, typer.Option(min=1, max=1024, help="Processes; default: one per processor.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output.")]
Out = Annotated[Path, typer.Option(metavar="DIR", help="Where missions that fail are written, made small.")]


def campaign(
    missions: Missions = 1000,
    seed: Seed = 0,
    only: Only = None,
    replay: Replay = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    out: Out = Path("campaign-failures"),
) -> None:
    """Simulate random missions with faults and check each against what must always hold."""
    from rich.console import Console

    console = Console(stderr=as_json, highlight=False, soft_wrap=True)
    if replay is not None:
        if only is not None:
            raise UserError("--only names a mission of a campaign, --replay a file; expected one of the two")
        raise typer.Exit(_replay(replay, console, as_json=as_json))
    _check_writable(out)
    began = time.monotonic()
    if only is None:
        result, interrupted = _examine_many(seed, missions, jobs)
    else:
        from lalliance_study.campaign import examine

        result, interrupted = examine(seed, [only]), False
    seconds = time.monotonic() - began
    told = _tell_failures(seed, result.failures, out, console, make_smaller=not interrupted)
    document = {
        "seed": seed,
        "interrupted": interrupted,
        "seconds": seconds,
        "rate": result.missions / seconds,
        "failed": len(result.failures),
        "failures": told,
        **result.as_plain(),
    }
    if as_json:
        typer.echo(json.dumps(document))
    else:
        _show(document, console)
    if interrupted:
        raise ToldToEnd(signal.SIGINT)
    raise typer.Exit(1 if result.failures else 0)


def _examine_many(seed: int, missions: int, jobs: int | None) -> "tuple[Result, bool]":
    """What came of the missions 0 to `missions` - 1, and whether Ctrl-C ended it early."""
    from lalliance_study.campaign import Result, examine
    from lalliance_study.pool import at_once, progress

    total = Result()
    parts = ((seed, range(first, min(first + PART, missions))) for first in range(0, missions, PART))
    try:
        with progress("missions", missions) as advance:
            for part in at_once(examine, parts, jobs):
                total.add(part)
                advance(part.missions, f"{len(total.failures)} failed" if total.failures else "")
    except ToldToEnd as asked:
        if asked.number is not signal.SIGINT:
            raise
        return total, True
    return total, False


def _check_writable(out: Path) -> None:
    """Refuse, before anything is done, a folder in which nothing could be written.

    Raises:
        UserError: it is none, or cannot be made.
    """
    place = out.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir() or not os.access(place, os.W_OK | os.X_OK):
        raise UserError(f"{out}: missions that fail cannot be written there; expected a folder, or where to make one")


def _tell_failures(
    seed: int, failures: "list[Failure]", out: Path, console: "Console", *, make_smaller: bool
) -> list[dict[str, Any]]:
    """Show each failure and write its mission; Ctrl-C ends the making small, not the writing."""
    from lalliance_study.campaign import make_small
    from lalliance_study.random_missions import draw_mission

    told = []
    for count, failure in enumerate(failures):
        _show_violations(f"seed {seed}, mission {failure.number}", failure.violations, console)
        document, _ = draw_mission(seed, failure.number)
        if make_smaller and count < MOST_MADE_SMALL:
            try:
                document = make_small(seed, failure)
            except ToldToEnd as asked:
                if asked.number is not signal.SIGINT:
                    raise
                make_smaller = False
        told += _tell(seed, failure, _write(seed, failure, document, out), console)
    return told


def _tell(seed: int, failure: "Failure", path: Path, console: "Console") -> list[dict[str, Any]]:
    command = f"lalliance campaign --seed {seed} --only {failure.number}"
    console.print(
        f"  written to {path}", f"  repeat: {command}", f"  or:     lalliance campaign --replay {path}", sep="\n"
    )
    return [
        {
            "number": failure.number,
            "invariant": one.invariant,
            "facts": one.facts,
            "file": str(path),
            "command": command,
        }
        for one in failure.violations
    ]


def _show_violations(what: str, violations: "tuple[Violation, ...] | list[Violation]", console: "Console") -> None:
    console.print(f"[red]{what}[/red]")
    for one in violations:
        console.print(f"  {one.invariant}: {one.facts}", markup=False)


def _write(seed: int, failure: "Failure", document: dict[str, Any], out: Path) -> Path:
    """Write a failing mission to a file of its own; what is there already stays.

    Raises:
        UserError: it cannot be written.
    """
    from lalliance_study.random_missions import text_of

    first = failure.violations[0]
    facts = " ".join(first.facts.split())
    text = (
        f"# Breaks {first.invariant}: {facts}\n# Found by: lalliance campaign --seed {seed} --only {failure.number}\n"
    )
    text += f"# Repeat:   lalliance campaign --replay FILE\n{text_of(document)}"
    name = f"seed-{seed}-mission-{failure.number}-{first.invariant}"
    try:
        out.mkdir(parents=True, exist_ok=True)
        for number in range(1, 10_000):
            path = out / (f"{name}.yaml" if number == 1 else f"{name}-{number}.yaml")
            try:
                with path.open("x", encoding="utf-8") as file:
                    file.write(text)
            except FileExistsError:
                continue
            return path
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}; the mission that failed could not be written") from None
    raise UserError(f"{out}: holds thousands of files of this mission; expected fewer")


def _replay(path: Path, console: "Console", *, as_json: bool) -> int:
    from lalliance_study.campaign import check_fully
    from lalliance_study.promises import promise
    from mission_control.missions import load

    mission = load(path, for_team=False)
    violations = check_fully(mission)
    promised = promise(mission)
    if as_json:
        found = [one._asdict() for one in violations]
        typer.echo(
            json.dumps({"mission": mission.name, "promised": promised.seconds, "why": promised.why, "failures": found})
        )
    elif violations:
        _show_violations(str(path), violations, console)
    else:
        console.print(f"{path}: everything holds")
    return 1 if violations else 0


def _show(document: dict[str, Any], console: "Console") -> None:
    """The campaign in a few lines, the last of which says it all."""
    from rich.table import Table

    faults = Table(box=None, pad_edge=False, header_style="bold")
    faults.add_column("fault")
    for column in ("scheduled", "fired", "had nothing to strike"):
        faults.add_column(column, justify="right")
    for kind, one in document["faults"].items():
        faults.add_row(kind, str(one["scheduled"]), str(one["fired"]), str(one["scheduled"] - one["fired"]))
    console.print(faults)
    takeovers = [f"{count} by {cause}" for cause, count in document["takeovers"].items()]
    console.print(f"Takeovers: {', '.join(takeovers) or 'none'}")
    for why, count in document["excused"].items():
        console.print(f"Not complete, as expected: {count} ({why})")
    console.print(
        f"{document['missions']} missions of seed {document['seed']}, {document['failed']} failed; "
        f"{document['complete']} complete, {sum(document['excused'].values())} incomplete as expected; "
        f"{document['repeated']} repeated and compared, {document['every_step']} with every step made; "
        f"{document['rate']:.1f} missions/s, {document['virtual_hours']:.2f} virtual hours, digest {document['digest']}"
    )
