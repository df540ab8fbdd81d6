"""`lalliance keys`: certificates and access control for a team, and the account of what was made."""

from pathlib import Path
from typing import Annotated

import typer

from mission_control.shell import MissionPath

keys = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

#: Under which names a router is called if nothing else is said: on its own machine, and in a compose deployment.
HOSTS = ("localhost", "127.0.0.1", "::1", "router")


@keys.callback()
def keys_of_a_team() -> None:
    """Keys with which robots, world, operators and routers prove to one another who they are."""


@keys.command()
def init(
    path: MissionPath,
    folder: Annotated[Path, typer.Option("--keys", metavar="DIR", help="The new folder for them.")] = Path("keys"),
    hosts: Annotated[
        list[str] | None,
        typer.Option(
            "--host", metavar="HOST", help="A further name or address under which a router is called; may be repeated."
        ),
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=36500, help="How long they are valid.")] = 365,
) -> None:
    """Make an authority, certificates for a mission's robots, the world, the operator and the router, and access rules."""
    from lalliance_agents.bus.credentials import AUTHORITY
    from lalliance_agents.extras import extra
    from lalliance_agents.mission_file import load_mission

    mission = load_mission(path)
    with extra("deploy"):
        from mission_control.deploy.authority import Validity, make_keys

    make_keys(folder, mission.robots, [*HOSTS, *(hosts or ())], Validity.of_days(days))
    typer.echo(
        f"{folder}: keys of {len(mission.robots)} robots, the world, the operator and the router, valid for {days} days"
    )
    typer.echo(f"whoever has {folder / AUTHORITY}/key.pem can make further keys: put it away, or delete it")
