"""`lalliance chaos`: put faults in force in a running mission, end them, and see what became of them.

What is asked for is checked against the mission file first; the world decides. As everywhere, heavy imports are made where
they are needed.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission_control.shell import AsJson, Connect, Keys, MissionPath, run_until_told

if TYPE_CHECKING:
    from lalliance_agents.config import Mission
    from lalliance_agents.wire.messages import ChaosAnswer

chaos = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@chaos.callback()
def chosen(context: typer.Context, path: MissionPath) -> None:
    """Put faults in force in a running mission, and end them."""
    context.obj = path


@chaos.command()
def inject(
    context: typer.Context,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="FIELD=VALUE",
            help="A fault in the fields of a mission file; for=SECONDS says how long it lasts.",
            show_default=False,
        ),
    ],
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> None:
    """Put a fault in force, such as kind=hang robot=NAME for=5."""
    from mission_control.chaos_words import read_injection

    mission = _mission(context)
    wanted = read_injection(words, mission)
    answer = _ask(mission, connect, keys, verb="inject", fault=wanted.fault, lasts=wanted.lasts)
    _tell(answer, as_json=as_json)


@chaos.command()
def heal(
    context: typer.Context,
    name: Annotated[
        str, typer.Argument(help="Which fault, as `status` calls it; default: all.", show_default=False)
    ] = "",
    connect: Connect = None,
    keys: Keys = None,
    as_json: AsJson = False,
) -> None:
    """End a fault, or all; a robot that was killed is started again."""
    from lalliance_agents.mission_errors import one_line
    from lalliance_agents.wire.messages import LONGEST_WORD

    # No fault has a longer name, so the world refuses what is left of one.
    answer = _ask(_mission(context), connect, keys, verb="heal", name=one_line(name)[:LONGEST_WORD])
    _tell(answer, as_json=as_json)


@chaos.command()
def status(context: typer.Context, connect: Connect = None, keys: Keys = None, as_json: AsJson = False) -> None:
    """Show every fault of the mission, and whether it fired."""
    mission = _mission(context)
    answer = _ask(mission, connect, keys, verb="status")
    if as_json:
        _tell(answer, as_json=True)
        return
    from rich.console import Console

    from mission_control.summary import faults_table

    console = Console()
    console.print(f"Mission {mission.name}: {answer.text}", highlight=False, markup=False)
    console.print(faults_table(answer.faults) if answer.faults else "No faults.")


def _mission(context: typer.Context) -> "Mission":
    from lalliance_agents.mission_file import load_mission

    path: Path = context.obj
    return load_mission(path)


def _ask(mission: "Mission", connect: str | None, keys: Path | None, **command: Any) -> "ChaosAnswer":
    from mission_control.chaos_client import ask

    return run_until_told(ask(mission.name, connect, keys, **command))


def _tell(answer: "ChaosAnswer", *, as_json: bool) -> None:
    from mission_control.watch.words import printable

    typer.echo(json.dumps(answer.model_dump(include={"done", "text", "faults"})) if as_json else printable(answer.text))
