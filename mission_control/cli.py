"""The commands. Each reads its input, does its work through the other rooms, and turns errors into a sentence.

Exit status: 0 the mission is complete or the command did its work, 1 the mission is not complete, 2 bad input or a missing
component. With `--json`, standard output holds one JSON document and nothing else. Heavy imports are made where they are
needed, so that `lalliance --help` is quick.
"""

import asyncio
import contextlib
import errno
import json
import logging
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer

from lalliance_agents.errors import LallianceError, UserError
from mission_control.campaign_command import campaign
from mission_control.chaos import chaos
from mission_control.shell import (
    DEFAULT_ENDPOINT,
    AsJson,
    MissionPath,
    ToldToEnd,
    end_when_told,
    run_until_told,
    warn,
    warn_of,
)
from mission_control.simulate import simulate
from mission_control.study_command import study

if TYPE_CHECKING:
    from rich.console import Console

    from lalliance_agents.config import Mission
    from mission_control.live import Lines

#: A silence timeout shorter than this, in real seconds, is at the mercy of the machine's scheduling.
SHORTEST_SILENCE = 0.15

app = typer.Typer(
    name="lalliance",
    help="Fault-tolerant, learning task allocation for teams of different robots, without a coordinator.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Speed = Annotated[float, typer.Option(min=0.01, max=1000.0, help="Mission seconds per real second.")]
Seed = Annotated[
    int | None, typer.Option(min=0, max=2**63 - 1, help="All randomness; default: the mission's own seed.")
]
Connect = Annotated[str, typer.Option(metavar="ENDPOINT", help="The router to connect to.")]
Parent = Annotated[int | None, typer.Option(hidden=True, help="End when the process with this id does.")]
Learned = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where robots keep what they learned; default: nowhere.")
]
JournalPath = Annotated[
    Path | None,
    typer.Option("--journal", metavar="FILE", help="What happens is kept there; if it is there, the mission goes on."),
]


@app.callback(invoke_without_command=True)
def lalliance(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Fault-tolerant, learning task allocation for teams of different robots, without a coordinator."""
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"lalliance {installed('lalliance')}")
        raise typer.Exit


@app.command()
def run(
    path: MissionPath,
    speed: Speed = 1.0,
    seed: Seed = None,
    connect: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="Use the router there instead of starting one.")
    ] = None,
    listen: Annotated[
        str | None,
        typer.Option(metavar="ENDPOINT", help="Where the router listens; default: a free port of this machine."),
    ] = None,
    learned: Learned = None,
    journal: JournalPath = None,
    plain: Annotated[bool, typer.Option("--plain", help="One line per event instead of the live view.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run a mission here: router, world and robots as processes."""
    from rich.console import Console

    from mission_control.launch import Beginning, Launcher, Plan
    from mission_control.summary import show
    from mission_control.yardstick import with_optimum
    from world_server.history import recall

    if connect is not None and listen is not None:
        raise UserError("--connect uses a router that runs already, --listen starts one; expected one of the two")
    mission = _load(path, seed, part="team")
    console = Console(stderr=as_json)
    if learned is not None:
        from lalliance_agents.agent.catalog import prepare

        prepare(learned)
    warn_of(path, mission)
    if (real := mission.parameters.silence_timeout / speed) < SHORTEST_SILENCE:
        warn(
            f"--speed {speed:g} makes {real:.2g} real seconds of silence a failure; a busy machine may see some that are none"
        )

    def plan(kept: Path) -> Plan:
        own = None if learned is None else learned.resolve()
        beginning = Beginning.of(recall(kept, mission))
        return Plan(path.resolve(), mission, kept.resolve(), beginning, speed, connect, listen, own)

    async def launch(kept: Path) -> dict[str, Any]:
        with _view(mission, console, plain=plain) as view:
            return await Launcher(plan(kept), view).run()

    with _kept(journal) as kept:
        summary = run_until_told(launch(kept))
    summary = with_optimum(summary, mission)
    if as_json:
        typer.echo(json.dumps(summary))
    else:
        show(summary, console)
    raise typer.Exit(0 if summary["complete"] else 1)


app.command()(simulate)
app.command()(campaign)


@app.command()
def router(
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = DEFAULT_ENDPOINT,
    parent: Parent = None,
) -> None:
    """Run a router: where robots, world and operators of a mission meet."""
    _follow(parent)

    async def serve() -> None:
        from lalliance_agents.bus.router import open_router

        async with await open_router(listen) as running:
            typer.echo(f"router listens on {running.endpoint}")
            sys.stdout.flush()
            await asyncio.Event().wait()

    run_until_told(serve())


@app.command()
def world(
    path: MissionPath,
    connect: Connect = DEFAULT_ENDPOINT,
    speed: Speed = 1.0,
    seed: Seed = None,
    wait: Annotated[
        float, typer.Option(min=0.0, help="Seconds to wait for the whole team before beginning with a part of it.")
    ] = 30.0,
    journal: JournalPath = None,
    returning: Annotated[
        float, typer.Option(min=0.0, help="Seconds to wait for robots that were there when the journal ends.")
    ] = 2.0,
    as_json: AsJson = False,
    parent: Parent = None,
) -> None:
    """Run the world server of a mission."""
    _follow(parent)
    mission = _load(path, seed, part="world")
    if not as_json:
        _show_events()

    async def serve() -> dict[str, Any]:
        from lalliance_agents.agent.catalog import fresh_incarnation
        from lalliance_agents.bus.zenoh_bus import open_bus
        from world_server.journal import Journal
        from world_server.server import WorldServer

        with contextlib.nullcontext() if journal is None else Journal(journal, mission) as kept:
            async with await open_bus(connect) as bus:
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
    if as_json:
        typer.echo(json.dumps(summary))
    else:
        from rich.console import Console

        from mission_control.summary import show

        show(summary, Console())
    raise typer.Exit(0 if summary["complete"] else 1)


@app.command()
def robot(
    path: MissionPath,
    name: Annotated[str, typer.Option(help="Which robot of the mission.", show_default=False)],
    connect: Connect = DEFAULT_ENDPOINT,
    speed: Speed = 1.0,
    seed: Seed = None,
    behaviors: Annotated[
        str | None,
        typer.Option(metavar="MODULE:FACTORY", help="Behaviour sets of your own; default: what the mission says."),
    ] = None,
    learned: Learned = None,
    incarnation: Annotated[
        int | None, typer.Option(min=0, hidden=True, help="Which life of the robot this is.")
    ] = None,
    without_world: Annotated[bool, typer.Option("--without-world", help="There is no world server.")] = False,
    parent: Parent = None,
) -> None:
    """Run one robot of a mission until the mission is over."""
    _follow(parent)
    mission = _load(path, seed, part="robot")
    if name not in mission.robots:
        raise UserError(f"{path}: no robot {name!r} in this mission; expected one of {', '.join(mission.robots)}")

    async def live() -> str:
        from lalliance_agents.agent.behavior import load_behaviors
        from lalliance_agents.agent.catalog import Catalog
        from lalliance_agents.agent.runtime import Robot
        from lalliance_agents.bus.zenoh_bus import open_bus
        from lalliance_agents.clock import MissionClock

        place = behaviors or mission.robots[name].behaviors
        sets = load_behaviors(place) if place else []
        catalog = None if learned is None else Catalog(learned, name)
        async with await open_bus(connect) as bus:
            if parent is None:
                typer.echo(f"robot {name} of mission {mission.name} is connected to {connect}")
            member = Robot(
                mission,
                name,
                bus=bus,
                behaviors=sets,
                clock=MissionClock(speed),
                catalog=catalog,
                incarnation=incarnation,
                world=not without_world,
            )
            return await member.run()

    outcome = run_until_told(live())
    raise typer.Exit(0 if outcome == "complete" else 1)


@app.command()
def check(path: MissionPath) -> None:
    """Check a mission file and name the first mistake in it."""
    from mission_control.summary import fault_lines

    mission = _load(path, None, part="team")
    warn_of(path, mission)
    parts = {
        "robot": len(mission.robots),
        "task": len(mission.tasks),
        "trial": sum(phase.trials for phase in mission.phases),
        "fault": len(mission.faults),
    }
    listed = ", ".join(f"{count} {what}{'' if count == 1 else 's'}" for what, count in parts.items())
    typer.echo(f"{path} is a good mission: {mission.name}, with {listed}")
    for line in fault_lines(mission.faults):
        typer.echo(line)


@app.command()
def schema() -> None:
    """Print the JSON Schema of mission files, for editors."""
    from mission_control.missions import mission_schema

    typer.echo(json.dumps(mission_schema(), indent=2))


app.add_typer(chaos, name="chaos")
app.add_typer(study, name="study")


def _load(path: Path, seed: int | None, *, part: Literal["team", "world", "robot"]) -> "Mission":
    """The checked mission at `path`.

    Whole for a team; without the robots' own code for a world, and without the world's environment for a robot.
    """
    if part == "robot":
        from lalliance_agents.mission_file import load_mission

        mission = load_mission(path)
    else:
        from mission_control.missions import load

        mission = load(path, for_team=part == "team")
    return mission if seed is None else mission.model_copy(update={"seed": seed})


@contextlib.contextmanager
def _kept(journal: Path | None) -> Iterator[Path]:
    """The path of the world's journal: one of this run's own, which goes with it, if none is named."""
    if journal is not None:
        yield journal
        return
    from mission_control.temporary import own_folder

    with contextlib.ExitStack() as open_until_then:
        try:
            folder = open_until_then.enter_context(own_folder())
        except OSError as error:
            raise UserError(
                f"no folder for temporary files ({error.strerror}); expected one that can be written to, or --journal FILE"
            ) from error
        yield folder / "journal"


def _view(mission: "Mission", console: "Console", *, plain: bool) -> "Lines":
    from mission_control.live import Lines, LiveView

    return LiveView(mission, console) if console.is_terminal and not plain else Lines(console)


def _follow(parent: int | None) -> None:
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


def _fail(text: str, status: int) -> NoReturn:
    typer.echo(f"lalliance: {' '.join(text.split())}", err=True)
    sys.exit(status)


def main() -> None:
    """Run the command line; errors become one sentence on standard error."""
    sys.path.insert(0, str(Path.cwd()))
    try:
        end_when_told()
        app()
    except UserError as error:
        _fail(str(error), 2)
    except LallianceError as error:
        _fail(str(error), 1)
    except ToldToEnd as told:
        if told.number is signal.SIGINT:
            typer.echo("lalliance: interrupted", err=True)
        sys.exit(128 + told.number)
    except OSError as error:
        if error.errno not in {errno.EPIPE, errno.ENOSPC}:
            raise
        # Nobody reads what is printed, or it has no room: nothing more can be said there.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    finally:
        # What is left to do must not take long; who is asked to end now ends at once.
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.SIG_DFL)
