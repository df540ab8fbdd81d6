"""`lalliance simulate`: a mission in virtual time, exactly repeatable, once or many times."""

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lalliance_agents.errors import UserError
from mission_control.shell import AsJson, MissionPath, warn_of

if TYPE_CHECKING:
    from rich.console import Console

    from lalliance_agents.config import Mission
    from lalliance_study.simulator import Simulator


def simulate(
    path: MissionPath,
    runs: Annotated[int, typer.Option(min=1, max=1_000_000, help="How many runs, each with the next seed.")] = 1,
    seed: Annotated[
        int | None, typer.Option(min=0, max=2**62, help="The first seed; default: the mission's own.")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes for many runs; default: one per core.")
    ] = None,
    events: Annotated[bool, typer.Option("--events", help="Print every event of the run.")] = False,
    why: Annotated[bool, typer.Option("--why", help="Tell what happened and why, a sentence each.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run a mission in virtual time: the same seed gives the same run, to the byte."""
    from rich.console import Console

    from mission_control.missions import load

    if (events or why) and runs > 1:
        raise UserError(f"--{'events' if events else 'why'} shows one run; expected --runs 1, not {runs}")
    mission = load(path, for_team=False)
    if seed is not None:
        mission = mission.model_copy(update={"seed": seed})
    warn_of(path, mission)
    console = Console(stderr=as_json)
    found = (
        _once(mission, console, events=events, why=why, as_json=as_json)
        if runs == 1
        else _often(mission, runs, jobs, console)
    )
    if as_json:
        typer.echo(json.dumps(found))
    raise typer.Exit(0 if found["complete"] else 1)


def _once(mission: "Mission", console: "Console", *, events: bool, why: bool, as_json: bool) -> Mapping[str, Any]:
    from lalliance_study.simulator import Simulator
    from mission_control.summary import show
    from mission_control.watch.explain import plain, tell
    from mission_control.watch.happened import Happened, happened_in
    from mission_control.yardstick import with_optimum

    simulator = Simulator(mission)
    told: list[Happened] = []
    if why:
        simulator.follow(lambda one: told.extend(happened_in(one, simulator.world.elapsed)))
    with _progress(simulator):
        summary = with_optimum(simulator.run(), mission)
    if not as_json:
        for line in simulator.log if events else ():
            typer.echo(str(line))
        for happened in told:
            typer.echo(tell(happened))
        show(summary, console)
    document = {**summary, "events": [line._asdict() for line in simulator.log]} if events else summary
    return {**document, "happened": [plain(happened) for happened in told]} if why else document


def _progress(simulator: "Simulator") -> AbstractContextManager[object]:
    """How far a mission is in virtual time, on standard error, if that is a terminal."""
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    def reached() -> Text:
        world = simulator.world
        trial = f"trial {world.trial} of {world.trials_planned}, " if world.trials_planned > 1 else ""
        return Text(f"{world.mission.name}: {trial}{world.elapsed:,.0f} s of at most {world.mission.deadline:,.0f} s")

    console = Console(stderr=True)
    if not console.is_terminal:
        return nullcontext()
    return Live(get_renderable=reached, console=console, refresh_per_second=5, transient=True)


def _often(mission: "Mission", runs: int, jobs: int | None, console: "Console") -> Mapping[str, Any]:
    from lalliance_study.pool import at_once, progress
    from lalliance_study.runs import overview, simulate_seeds
    from mission_control.yardstick import with_optimum

    parts = [
        range(first, min(first + PART, mission.seed + runs)) for first in range(mission.seed, mission.seed + runs, PART)
    ]
    found: list[Any] = []
    with progress("runs", runs) as advance:
        for part in at_once(simulate_seeds, [(mission, part) for part in parts], jobs):
            found += part
            advance(len(part), "")
    document = with_optimum(overview(mission, sorted(found)), mission)
    if not console.stderr:
        _show(document, mission, console)
    return document


#: Runs that are handed to a process at once.
PART = 8


def _show(document: Mapping[str, Any], mission: "Mission", console: "Console") -> None:
    from lalliance_agents.faults import describe

    total = len(document["runs"])
    first, last = document["seeds"]
    style = "bold green" if document["complete"] else "bold red"
    console.print(
        f"\nMission {document['mission']} complete in {document['completed']} of {total} runs, seeds {first} to {last}",
        style=style,
        highlight=False,
    )
    if document["makespan"]:
        spread = ", ".join(f"{name} {value:.1f} s" for name, value in document["makespan"].items())
        console.print(f"Makespan: {spread}", highlight=False)
    if document["ratio"] is not None:
        told = f"the mean is {document['ratio']:.2f} times the optimum of {document['optimum']:.1f} s"
        console.print(f"Optimum: {told}", highlight=False)
    takeovers = ", ".join(f"{count} {cause}" for cause, count in document["takeovers"].items()) or "none"
    console.print(f"Takeovers: {takeovers}", highlight=False)
    for fault, fired in zip(mission.faults, document["faults"], strict=True):
        console.print(
            f"Fault: {describe(fault)} fired in {fired} runs", style="" if fired == total else "yellow", highlight=False
        )
