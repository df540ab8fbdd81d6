"""`lalliance deploy`: a mission written down for those who run containers."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission_control.shell import MissionPath, Speed, load_part, warn

if TYPE_CHECKING:
    from lalliance_agents.config import Mission

deploy = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@deploy.callback()
def deployments() -> None:
    """Write a mission down as a deployment."""


@deploy.command()
def compose(
    path: MissionPath,
    folder: Annotated[
        Path, typer.Option(metavar="DIR", help="Where the compose file is to be: paths in it begin there.")
    ] = Path(),
    keys: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="The team's keys, which are looked at; default: keys beside the compose file, unseen."
        ),
    ] = None,
    speed: Speed = 1.0,
) -> None:
    """Print the compose file of a mission: router, world server, one service for each robot, and two tools."""
    from mission_control.deploy.compose import as_text
    from mission_control.deploy.compose import compose as compose_of
    from mission_control.deploy.team_keys import check_team

    mission = load_part(path, None, part="world")
    if keys is not None:
        check_team(keys, path, mission)
    for warning in _warnings(mission):
        warn(f"{path}: {warning}")
    words = ["lalliance", "deploy", "compose", str(path), "--folder", str(folder), "--speed", f"{speed:g}"]
    words += [] if keys is None else ["--keys", str(keys)]
    document = compose_of(mission, path, folder, keys=keys or folder / "keys", speed=speed)
    typer.echo(as_text(document, words), nl=False)


def _warnings(mission: "Mission") -> "Iterator[str]":
    """What this deployment does otherwise than `lalliance run`, which holds the robots' processes."""
    from lalliance_agents.faults import Crash, Hang

    if any(isinstance(fault, Crash | Hang) for fault in mission.faults):
        yield "crashes and hangs that the mission plans never fire here; use docker compose kill and pause"
    if later := [f"robot-{name} at {robot.joins:g} s" for name, robot in mission.robots.items() if robot.joins > 0]:
        yield f"who joins later is to be started by hand, with docker compose up -d: {', '.join(later)}"
