"""`lalliance record`, `replay` and `bag`: recordings of missions. Heavy imports are made where they are needed."""

import asyncio
import contextlib
import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lalliance_agents.errors import LallianceError, UserError
from mission_control.shell import AsJson, Connect, Keys, MissionPath, Speed, run_until_told, warn

if TYPE_CHECKING:
    from lalliance_agents.config import Mission
    from mission_control.recording.player import Played
    from mission_control.recording.reader import Information
    from mission_control.recording.writer import RecordingWriter

Recorded = Annotated[Path, typer.Argument(metavar="FILE", help="A recording.", show_default=False)]

bag = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@bag.callback()
def of_recordings() -> None:
    """See what a recording holds, and make it readable for others."""


def record(
    path: MissionPath,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The recording; default: the mission's name and the time, in this folder."),
    ] = None,
    connect: Connect = None,
    keys: Keys = None,
    speed: Speed = 1.0,
) -> None:
    """Record all that is said in a mission until it is over, or until Ctrl-C."""
    from lalliance_agents.mission_file import load_mission

    check_extra()
    mission = load_mission(path)
    file = Path(time.strftime(f"{mission.name}-%Y%m%d-%H%M%S.mcap")) if out is None else out
    writer = run_until_told(_record(path, mission, file, connect, keys, speed))
    if not writer.written:
        raise UserError(f"nothing was said in mission {mission.name}, so that there is no recording of it")
    from mission_control.recording.recorder import told

    typer.echo(f"{writer.ending.reason}: {told(writer)}")


async def _record(
    path: Path, mission: "Mission", out: Path, connect: str | None, keys: Path | None, speed: float
) -> "RecordingWriter":
    from lalliance_agents.clock import MissionClock
    from mission_control.reach import reached
    from mission_control.recording.recorder import Recorder
    from mission_control.recording.writer import check_new
    from mission_control.watch.absence import told_of_absence

    check_new(out)
    async with reached(mission.name, connect, keys) as there:
        with new_recording(out, path, mission) as writer:

            def say() -> None:
                typer.echo(f"recording mission {mission.name} on the bus at {there.endpoint} in {out}; Ctrl-C ends it")
                sys.stdout.flush()

            # To be told to end is how a recording is meant to end.
            recorder = Recorder(there.bus, mission, writer, MissionClock(speed), say)
            with contextlib.suppress(asyncio.CancelledError):
                async with told_of_absence(recorder, there.endpoint):
                    await recorder.run()
            return writer


def check_extra() -> None:
    """Make sure that recordings can be used here.

    Raises:
        MissingExtraError: they cannot.
    """
    from lalliance_agents.extras import extra

    with extra("record"):
        import mcap.writer  # noqa: F401 - whether it is there


def new_recording(out: Path, path: Path, mission: "Mission") -> "RecordingWriter":
    """The recording at `out`, still empty, of the mission in the file at `path`.

    Raises:
        UserError: it cannot be written.
    """
    from mission_control.recording.writer import RecordingWriter

    return RecordingWriter(out, mission, path.read_text(encoding="utf-8", errors="replace"))


def replay(
    path: Recorded,
    rate: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Seconds of the recording per real second.")] = 1.0,
    start: Annotated[float, typer.Option(min=0.0, help="Where to begin, in seconds after the first message.")] = 0.0,
    pause: Annotated[bool, typer.Option("--pause", help="Wait for the space bar before the first message.")] = False,
    connect: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="Use the router there instead of starting one.")
    ] = None,
) -> None:
    """Play a recording onto a bus, as if the mission went on there; the space bar pauses and continues."""
    check_extra()
    from mission_control.recording.reader import information

    known = information(path)
    if start > known.duration:
        raise UserError(f"--start {start:g}: expected at most {known.duration:.1f}, the length of {path} in seconds")
    played = run_until_told(_replay(path, rate, start, pause=pause, connect=connect))
    if known.broken is not None:
        warn(known.broken)
    _tell_played(played, known.messages)


async def _replay(path: Path, rate: float, start: float, *, pause: bool, connect: str | None) -> "Played":
    from lalliance_agents.bus.credentials import SECURE
    from lalliance_agents.bus.router import free_endpoint, open_router
    from lalliance_agents.bus.zenoh_bus import open_bus
    from mission_control.recording.pace import Pace
    from mission_control.recording.player import Player, check_quiet
    from mission_control.recording.reader import Recording
    from mission_control.running import announced
    from mission_control.watch.keyboard import keyboard

    if connect is not None and connect.startswith(SECURE):
        raise UserError(
            f"--connect {connect}: a bus with keys does not take from one what many have said; expected a bus without keys"
        )
    recording = Recording(path)
    mission = recording.about.mission
    async with contextlib.AsyncExitStack() as opened:
        endpoint = connect or free_endpoint()
        if connect is None:
            await opened.enter_async_context(await open_router(endpoint))
            opened.enter_context(announced(mission, endpoint))
        bus, witness = [await opened.enter_async_context(await open_bus(endpoint)) for _ in range(2)]
        if connect is not None:
            await check_quiet(witness, mission, endpoint)
        pace = Pace(rate, paused=pause)

        def press(name: str) -> None:
            if name != " ":
                return
            pace.toggle()
            typer.echo(f"{'paused' if pace.paused else 'going on'} at {start + pace.position:.1f} s")
            sys.stdout.flush()

        has_keys = opened.enter_context(keyboard(press))
        if pause and not has_keys:
            raise UserError(
                "--pause waits for the space bar, and no key can be read here; expected a terminal, or a pipe"
            )
        typer.echo(f"replaying mission {mission} on the bus at {endpoint}{'; space pauses' if has_keys else ''}")
        sys.stdout.flush()
        return await Player(recording, bus, witness, pace, start=start).play()


def _tell_played(played: "Played", all_of_it: int) -> None:
    """Say what became of all the messages in a recording.

    Raises:
        LallianceError: not all of it was published, or has arrived.
    """
    typer.echo(
        f"{played.published:,} messages were published and {played.arrived:,} have arrived; "
        f"{played.presences:,} times somebody came or went"
        + (f"; {played.before:,} were before the start" if played.before else "")
    )
    if played.refused:
        warn(f"{played.refused:,} messages have keys or sizes that cannot be published")
    if played.lost:
        raise LallianceError(f"{played.lost:,} messages were lost on the way; expected a router that can be reached")
    if played.all != all_of_it:
        raise LallianceError(f"{played.all:,} messages were read; expected {all_of_it:,}, as the file says")


@bag.command()
def info(path: Recorded, as_json: AsJson = False) -> None:
    """See what a recording holds."""
    check_extra()
    from mission_control.recording.reader import information

    found = information(path)
    if found.broken is not None:
        warn(found.broken)
    if as_json:
        typer.echo(json.dumps(_document(found)))
        return
    from rich.console import Console

    from mission_control.recording.shown import show

    show(found, Console())


def _document(found: "Information") -> dict[str, Any]:
    return {
        "file": str(found.path),
        "size": found.size,
        "complete": found.complete,
        "mission": found.about.mission,
        "seed": found.about.seed,
        "version": found.about.version,
        "started_at": found.started_at / 1e9,
        "duration": found.duration,
        "messages": found.messages,
        "counts": found.counts,
        "ended": None if found.ending is None else found.ending.reason,
        "dropped": None if found.ending is None else found.ending.dropped,
        "gaps": [
            {
                "since": gap.since.wall / 1e9,
                "until": gap.until.wall / 1e9,
                "why": gap.why,
                "answered": gap.answered,
                "recovered": gap.recovered,
            }
            for gap in found.gaps
        ],
    }


@bag.command()
def convert(
    path: Recorded,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The new file.", show_default=False)],
) -> None:
    """Write a recording as JSON with schemas, for viewers such as Foxglove."""
    check_extra()
    from mission_control.recording.convert import convert as carry_out

    done = carry_out(path, out)
    if done.broken is not None:
        warn(done.broken)
    typer.echo(
        f"{done.messages:,} messages are in {out}, {done.unreadable:,} of them as bytes, since they are not valid"
    )
