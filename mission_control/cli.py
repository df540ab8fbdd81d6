"""The commands. Each reads its input, does its work through the other rooms, and turns errors into a sentence.

Exit status: 0 the mission is complete or the command did its work, 1 the mission is not complete, 2 bad input or a missing
component. With `--json`, standard output holds one JSON document and nothing else. Heavy imports are made where they are
needed, so that `lalliance --help` is quick.
"""

import contextlib
import errno
import io
import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from lalliance_agents.errors import LallianceError, UserError
from mission_control.campaign_command import campaign
from mission_control.chaos import chaos
from mission_control.dashboard.command import PORT, Port, dashboard
from mission_control.deploy.deploy_command import deploy
from mission_control.deploy.keys_command import keys as keys_command
from mission_control.keeping import tell
from mission_control.record_command import bag, check_extra, new_recording, record, replay
from mission_control.shell import (
    AsJson,
    JournalPath,
    Keys,
    Learned,
    MissionPath,
    Seed,
    Speed,
    ToldToEnd,
    end_when_told,
    load_part,
    run_until_told,
    warn,
    warn_of,
)
from mission_control.simulate import simulate
from mission_control.single import health, robot, router, summary, world
from mission_control.study_command import study
from mission_control.watch_commands import echo, hz, top, why

if TYPE_CHECKING:
    from rich.console import Console

    from lalliance_agents.config import Mission
    from mission_control.dashboard.beside import Page
    from mission_control.live import Lines
    from mission_control.recording.writer import RecordingWriter

#: A silence timeout shorter than this, in real seconds, is at the mercy of the machine's scheduling.
SHORTEST_SILENCE = 0.15

app = typer.Typer(
    name="lalliance",
    help="Fault-tolerant, learning task allocation for teams of different robots, without a coordinator.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
    keys: Keys = None,
    learned: Learned = None,
    journal: JournalPath = None,
    recorded: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="All that is said is recorded there.")
    ] = None,
    dashboard_too: Annotated[
        bool, typer.Option("--dashboard", help="Show it as a web page too; on a terminal the page stays until Ctrl-C.")
    ] = False,
    port: Port = PORT,
    processes: Annotated[
        int | None, typer.Option(min=1, help="Processes that the robots share; default: each robot has its own.")
    ] = None,
    plain: Annotated[bool, typer.Option("--plain", help="One line per event instead of the live view.")] = False,
    as_json: AsJson = False,
) -> None:
    """Run a mission here: router, world and robots as processes."""
    from rich.console import Console

    from mission_control.hosting import shared_processes
    from mission_control.launch import Beginning, Launcher, Plan
    from mission_control.yardstick import with_optimum
    from world_server.history import recall

    if recorded is not None:
        check_extra()
        from mission_control.recording.writer import check_new

        check_new(recorded)
    if connect is not None and listen is not None:
        raise UserError("--connect uses a router that runs already, --listen starts one; expected one of the two")
    mission = load_part(path, seed, part="team")
    processes = shared_processes(path, mission, processes, keys)
    _prepare_folders(path, mission, learned, keys, with_router=connect is None)
    warn_of(path, mission)
    if (real := mission.parameters.silence_timeout / speed) < SHORTEST_SILENCE:
        warn(
            f"--speed {speed:g} makes {real:.2g} real seconds of silence a failure; a busy machine may see some that are none"
        )
    console = Console(stderr=as_json)
    page = _page(path, port, keys, speed) if dashboard_too else None

    def plan(kept: Path) -> Plan:
        own, shown = (None if folder is None else folder.resolve() for folder in (learned, keys))
        beginning = Beginning.of(recall(kept, mission))
        return Plan(path.resolve(), mission, kept.resolve(), beginning, speed, connect, listen, own, shown, processes)

    async def launch(kept: Path) -> dict[str, Any]:
        async with page or contextlib.nullcontext():
            with _view(mission, console, plain=plain) as view:
                if page is not None:
                    page.say = view.pin
                outcome = await Launcher(plan(kept), view, writer, page).run()
            if page is not None and console.is_terminal and not as_json:
                console.print("The mission is over; the page stays until Ctrl-C.")
                await page.stay()
        return outcome

    with _kept(journal) as kept, _recorded(recorded, path, mission) as writer:
        outcome = run_until_told(launch(kept))
    tell(with_optimum(outcome, mission), as_json=as_json, console=console)


app.command()(simulate)
app.command()(campaign)
app.command()(router)
app.command()(world)
app.command()(robot)
app.command()(health)
app.command()(summary)
app.command()(why)
app.command()(echo)
app.command()(hz)
app.command()(top)
app.command()(record)
app.command()(replay)
app.command()(dashboard)


@app.command()
def check(path: MissionPath) -> None:
    """Check a mission file and name the first mistake in it."""
    from mission_control.summary import fault_lines

    mission = load_part(path, None, part="team")
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
app.add_typer(bag, name="bag")
app.add_typer(keys_command, name="keys")
app.add_typer(deploy, name="deploy")
app.add_typer(study, name="study")


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


@contextlib.contextmanager
def _recorded(recorded: Path | None, path: Path, mission: "Mission") -> "Iterator[RecordingWriter | None]":
    """The recording, if there is to be one; that it cannot be ended as it should is no fault of the mission."""
    if recorded is None:
        yield None
        return
    from mission_control.recording.writer import RecordingError

    writer = new_recording(recorded, path, mission)
    try:
        with writer:
            yield writer
    except RecordingError as error:
        warn(str(error))


def _prepare_folders(
    path: Path, mission: "Mission", learned: Path | None, keys: Path | None, *, with_router: bool
) -> None:
    """Make sure that what is learned can be kept, and that all processes can show who they are."""
    if learned is not None:
        from lalliance_agents.agent.catalog import prepare

        prepare(learned)
    if keys is not None:
        from mission_control.deploy.team_keys import check_team

        check_team(keys, path, mission, with_router=with_router)


def _page(path: Path, port: int, keys: Path | None, speed: float) -> "Page":
    from lalliance_agents.extras import extra

    with extra("dashboard"):
        from mission_control.dashboard import program  # noqa: F401 - a missing package is to be told now
    from mission_control.dashboard.beside import Page

    return Page(path.resolve(), port=port, keys=None if keys is None else keys.resolve(), speed=speed)


def _view(mission: "Mission", console: "Console", *, plain: bool) -> "Lines":
    from mission_control.live import Lines, LiveView, can_redraw

    return LiveView(mission, console) if can_redraw(console) and not plain else Lines(mission.name, console)


def _fail(text: str, status: int) -> NoReturn:
    typer.echo(f"lalliance: {' '.join(text.split())}", err=True)
    sys.exit(status)


def main() -> None:
    """Run the command line; errors become one sentence on standard error."""
    sys.path.insert(0, str(Path.cwd()))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # not every terminal has all the letters that are printed
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
