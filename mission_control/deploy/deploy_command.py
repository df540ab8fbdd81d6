"""`lalliance deploy`: a mission written down for those who run containers."""

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
    """Print the compose file of a mission: router, world server, one service for each robot, and what an operator needs."""
    from mission_control.deploy.compose import compose as compose_of
    from mission_control.deploy.documents import as_text
    from mission_control.deploy.team_keys import check_team

    mission = load_part(path, None, part="world")
    if keys is not None:
        check_team(keys, path, mission)
    _warn(path, mission, fail="docker compose kill and pause", start="docker compose up -d")
    words = ["deploy", "compose", str(path), "--folder", str(folder), "--speed", f"{speed:g}"]
    words += [] if keys is None else ["--keys", str(keys)]
    document = compose_of(mission, path, folder, keys=keys or folder / "keys", speed=speed)
    typer.echo(as_text(words, document), nl=False)


@deploy.command()
def kubernetes(
    path: MissionPath,
    folder: Annotated[
        Path,
        typer.Option(
            "--out", metavar="DIR", help="The folder for the manifests; the team's keys belong into its folder keys."
        ),
    ],
    speed: Speed = 1.0,
) -> None:
    """Write the manifests of a mission into a folder, for kubectl apply -k."""
    from mission_control.deploy.kubernetes.folder import KEYS, contents, write
    from mission_control.deploy.team_keys import check_team

    mission = load_part(path, None, part="world")
    if (folder / KEYS).exists():
        check_team(folder / KEYS, path, mission)
    words = ["deploy", "kubernetes", str(path), "--out", str(folder), "--speed", f"{speed:g}"]
    write(contents(path, mission, words, speed), folder)
    _warn(
        path, mission, fail="kubectl delete pod", start='kubectl patch job JOB --patch \'{"spec": {"suspend": false}}\''
    )
    typer.echo(f"{folder}: manifests of {len(mission.robots)} robots, the world and the router")


def _warn(path: Path, mission: "Mission", *, fail: str, start: str) -> None:
    """Tell what a deployment does otherwise than `lalliance run`, which holds the robots' processes.

    Args:
        path: the mission file.
        mission: what it says.
        fail: with what a robot is made to fail there.
        start: with what a robot is started there.
    """
    from lalliance_agents.faults import Crash, Hang

    named = [mission.environment.kind, *(robot.behaviors for robot in mission.robots.values())]
    if own := sorted({name.partition(":")[0] for name in named if name is not None and ":" in name}):
        warn(f"{path}: the image holds no code of yours; use one of your own, FROM lalliance, with {', '.join(own)}")
    if any(isinstance(fault, Crash | Hang) for fault in mission.faults):
        warn(f"{path}: crashes and hangs that the mission plans never fire here; use {fail}")
    if later := [f"robot-{name} at {robot.joins:g} s" for name, robot in mission.robots.items() if robot.joins > 0]:
        warn(f"{path}: who joins later is to be started by hand, with {start}: {', '.join(later)}")
