"""`lalliance dashboard`: the web page of a running mission, or of a recording."""

from pathlib import Path
from typing import Annotated

import typer

from lalliance_agents.errors import UserError
from lalliance_agents.extras import extra
from mission_control.shell import Connect, Keys, Speed, run_until_told

Host = Annotated[str, typer.Option(metavar="ADDRESS", help="Where the page listens; default: on this machine only.")]
Port = Annotated[int, typer.Option(min=0, max=65535, help="The page's port; 0: a free one.")]
PORT = 8080


def dashboard(
    path: Annotated[
        Path | None, typer.Argument(metavar="[MISSION]", help="The mission file (YAML).", show_default=False)
    ] = None,
    connect: Connect = None,
    bag: Annotated[Path | None, typer.Option(metavar="FILE", help="Show a recording instead.")] = None,
    host: Host = "127.0.0.1",
    port: Port = PORT,
    token_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Holds the token for injecting faults; default: a new one each time."),
    ] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A host name under which the page may be called; may be repeated."),
    ] = None,
    keys: Keys = None,
    speed: Speed = 1.0,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the mission if it does not run yet.")] = False,
    parent: Annotated[int | None, typer.Option(hidden=True, help="End when the process with this id does.")] = None,
) -> None:
    """Show a mission, or a recording of one, as a web page."""
    from lalliance_agents.mission_file import load_mission
    from mission_control.dashboard.guard import new_token, read_token
    from mission_control.single import follow

    follow(parent)
    if path is None and bag is None:
        raise UserError("no mission is named; expected a mission file, or --bag with a recording")
    if bag is not None and connect is not None:
        raise UserError("--bag shows a recording, --connect a running mission; expected one of the two")
    mission = None if path is None else load_mission(path)
    token = new_token() if token_file is None else read_token(token_file)
    with extra("dashboard"):
        from mission_control.dashboard.program import Address, show_mission, show_recording
    address = Address(host, port, token, tuple(allow_host or ()), own_token=token_file is None)
    if bag is not None:
        run_until_told(show_recording(bag, mission, address, _say))
    elif mission is not None:
        run_until_told(show_mission(mission, connect, keys, address, _say, speed=speed, wait=wait))


def _say(text: str) -> None:
    typer.echo(text)
