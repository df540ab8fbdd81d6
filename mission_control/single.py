"""The single processes of a mission, each a command of its own: the router, the world server, robots, a look at their health.

`lalliance run` starts the same commands; here they are for several machines, and for deployments that start them.
"""

import asyncio
import contextlib
import gc
import logging
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lalliance_agents.errors import UserError
from mission_control.keeping import check_place, keep, kept_summary, tell
from mission_control.shell import (
    AsJson,
    JournalPath,
    Keys,
    Learned,
    MissionPath,
    Seed,
    Speed,
    credentials_from,
    endpoint_of,
    load_part,
    run_until_told,
)

if TYPE_CHECKING:
    from lalliance_agents.agent.runtime import Outcome
    from lalliance_agents.bus.base import Bus
    from lalliance_agents.config import Mission

Connect = Annotated[
    str | None,
    typer.Option(
        metavar="ENDPOINT",
        envvar="LALLIANCE_CONNECT",
        help="The router to connect to; default: port 7447 of this machine.",
    ),
]
ConnectTimeout = Annotated[
    float,
    typer.Option(
        "--connect-timeout",
        metavar="SECONDS",
        min=0.1,
        max=86400.0,
        envvar="LALLIANCE_CONNECT_TIMEOUT",
        help="How long to wait for the router before giving up.",
    ),
]
Parent = Annotated[int | None, typer.Option(hidden=True, help="End when the process with this id does.")]


def router(
    listen: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="Where to listen; default: port 7447 of this machine.")
    ] = None,
    others: Annotated[
        list[str] | None,
        typer.Option("--connect", metavar="ENDPOINT", help="Another router, to be one bus with; may be repeated."),
    ] = None,
    keys: Keys = None,
    parent: Parent = None,
) -> None:
    """Run a router: where robots, world and operators of a mission meet."""
    follow(parent)
    endpoint = endpoint_of(listen, keys)

    async def serve() -> None:
        from lalliance_agents.bus.credentials import ROUTER
        from lalliance_agents.bus.router import open_router

        shown = credentials_from(keys, ROUTER)
        async with await open_router(endpoint, credentials=shown, others=others or ()) as running:
            typer.echo(f"router listens on {running.endpoint}")
            sys.stdout.flush()
            await asyncio.Event().wait()

    run_until_told(serve())


def world(
    path: MissionPath,
    connect: Connect = None,
    connect_timeout: ConnectTimeout = 5.0,
    keys: Keys = None,
    speed: Speed = 1.0,
    seed: Seed = None,
    wait: Annotated[
        float, typer.Option(min=0.0, help="Seconds to wait for the whole team before beginning with a part of it.")
    ] = 30.0,
    journal: JournalPath = None,
    returning: Annotated[
        float, typer.Option(min=0.0, help="Seconds to wait for robots that were there when the journal ends.")
    ] = 2.0,
    summary_path: Annotated[
        Path | None,
        typer.Option("--summary", metavar="FILE", help="The summary is written there too, as a JSON document."),
    ] = None,
    as_json: AsJson = False,
    parent: Parent = None,
) -> None:
    """Run the world server of a mission."""
    follow(parent)
    if summary_path is not None:
        check_place(summary_path)
    mission = load_part(path, seed, part="world")
    if not as_json:
        _show_events()

    async def serve() -> dict[str, Any]:
        from lalliance_agents.agent.catalog import fresh_incarnation
        from lalliance_agents.bus.zenoh_bus import open_bus
        from lalliance_agents.wire.keys import WORLD
        from world_server.journal import Journal
        from world_server.server import WorldServer

        with contextlib.nullcontext() if journal is None else Journal(journal, mission) as kept:
            shown, endpoint = credentials_from(keys, WORLD), endpoint_of(connect, keys)
            async with await open_bus(endpoint, timeout=connect_timeout, credentials=shown) as bus:
                server = WorldServer(
                    mission,
                    bus=bus,
                    incarnation=fresh_incarnation(),
                    speed=speed,
                    patience=wait,
                    journal=kept,
                    returning=returning,
                )
                return await server.run()

    summary = run_until_told(serve())
    if summary_path is not None:
        keep(summary, summary_path)
    tell(summary, as_json=as_json)


def robot(
    path: MissionPath,
    names: Annotated[
        list[str],
        typer.Option(
            "--name",
            help="Which robot of the mission; may be repeated, and be a glob: all these robots live in this process.",
            show_default=False,
        ),
    ],
    connect: Connect = None,
    connect_timeout: ConnectTimeout = 5.0,
    keys: Keys = None,
    speed: Speed = 1.0,
    seed: Seed = None,
    behaviors: Annotated[
        str | None,
        typer.Option(metavar="MODULE:FACTORY", help="Behaviour sets of your own; default: what the mission says."),
    ] = None,
    learned: Learned = None,
    incarnations: Annotated[
        list[int] | None, typer.Option("--incarnation", min=0, hidden=True, help="Which life of each robot this is.")
    ] = None,
    without_world: Annotated[bool, typer.Option("--without-world", help="There is no world server.")] = False,
    parent: Parent = None,
) -> None:
    """Run one robot of a mission, or several in one process, until the mission is over."""
    from mission_control.hosting import check_certificate, named, told

    follow(parent)
    mission = load_part(path, seed, part="robot")
    chosen = named(path, mission, names)
    check_certificate(chosen, keys)
    if incarnations and len(incarnations) != len(chosen):
        raise UserError(f"--incarnation was given {len(incarnations)} times; expected once for each of {told(chosen)}")
    lives = dict(zip(chosen, incarnations or [], strict=False))

    def options(name: str) -> dict[str, Any]:
        from lalliance_agents.agent.behavior import load_behaviors
        from lalliance_agents.agent.catalog import Catalog

        place = behaviors or mission.robots[name].behaviors
        return {
            "behaviors": load_behaviors(place) if place else [],
            "catalog": None if learned is None else Catalog(learned, name),
            "incarnation": lives.get(name),
            "world": not without_world,
        }

    async def live() -> "list[Outcome]":
        from lalliance_agents.bus.session import receive_in_one_thread
        from lalliance_agents.bus.zenoh_bus import open_bus

        receive_in_one_thread()
        made = {name: options(name) for name in chosen}
        shown, endpoint = credentials_from(keys, chosen[0]), endpoint_of(connect, keys)
        async with await open_bus(endpoint, timeout=connect_timeout, credentials=shown) as bus:
            if parent is None:
                are = "is" if len(chosen) == 1 else "are"
                typer.echo(f"{told(chosen)} of mission {mission.name} {are} connected to {endpoint}")
            return await _live(mission, made, bus, speed)

    outcomes = run_until_told(live())
    raise typer.Exit(0 if set(outcomes) == {"complete"} else 1)


async def _live(mission: "Mission", made: Mapping[str, dict[str, Any]], bus: "Bus", speed: float) -> "list[Outcome]":
    """Let robots live, each made as it is told, until the mission is over; how it ended for each."""
    from lalliance_agents.agent.host import Host
    from lalliance_agents.agent.runtime import Robot
    from lalliance_agents.clock import MissionClock

    clock = MissionClock(speed)
    if len(made) == 1:  # which has nobody to share with, and needs none of what sharing costs
        [(name, how)] = made.items()
        member = Robot(mission, name, bus=bus, clock=clock, **how)
        _keep_all()
        return [await member.run()]
    async with Host(mission, bus) as host:
        for name, how in made.items():
            host.take_in(name, clock=clock, **how)
        _keep_all()
        return await host.run()


def health(
    path: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MISSION]", envvar="LALLIANCE_MISSION", help="The mission file; without it: the router's."
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(envvar="LALLIANCE_NAME", help="Which robot of the mission; default: its world.")
    ] = None,
    connect: Connect = None,
    keys: Keys = None,
) -> None:
    """Ask a robot, the world or the router whether it is well; exit status 1 if there is no answer."""
    from mission_control.deploy.health import ask

    mission = None if path is None else load_part(path, None, part="robot").name
    typer.echo(run_until_told(ask(mission, name, connect, keys)))


def summary(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="What `lalliance world --summary FILE` writes.")],
    wait: Annotated[bool, typer.Option("--wait", help="Wait until the mission is over.")] = False,
    as_json: AsJson = False,
) -> None:
    """Print the summary of a mission that is over, and exit with its status."""
    tell(kept_summary(path, wait=wait), as_json=as_json)


def follow(parent: int | None) -> None:
    """What a single process does first: log to standard error, and end with its parent if it has one."""
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s", stream=sys.stderr)
    if parent is not None:
        from lalliance_agents.lineage import end_with_parent

        end_with_parent(parent)


def _show_events() -> None:
    """Let the world server print what happens."""
    lines = logging.StreamHandler(sys.stdout)
    lines.setFormatter(logging.Formatter("%(message)s"))
    events = logging.getLogger("world_server.server")
    events.addHandler(lines)
    events.setLevel(logging.INFO)
    events.propagate = False


def _keep_all() -> None:
    """What is there now stays: to look through it for garbage later on would hold the robots up."""
    gc.collect()
    gc.freeze()
