"""What the commands have in common: how their arguments are called, and how work is ended from outside."""

import asyncio
import os
import select
import signal
from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

if TYPE_CHECKING:
    from lalliance_agents.bus.credentials import Credentials
    from lalliance_agents.config import Mission

#: Where a router is that nobody named: without keys, and with them.
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
SECURE_ENDPOINT = "tls/127.0.0.1:7447"

MissionPath = Annotated[Path, typer.Argument(metavar="MISSION", help="The mission file (YAML).", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output.")]
#: The bus of a mission that runs, for whoever looks at it or disturbs it.
Connect = Annotated[
    str | None,
    typer.Option(
        metavar="ENDPOINT",
        envvar="LALLIANCE_CONNECT",
        help=f"The router to connect to; default: that of the mission if it runs on this machine, else {DEFAULT_ENDPOINT}.",
    ),
]
Keys = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        envvar="LALLIANCE_KEYS",
        help="Keys of `lalliance keys init`: with them the bus is encrypted and knows who is who.",
    ),
]

Speed = Annotated[float, typer.Option(min=0.01, max=1000.0, help="Mission seconds per real second.")]
Seed = Annotated[
    int | None, typer.Option(min=0, max=2**63 - 1, help="All randomness; default: the mission's own seed.")
]
Learned = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Where robots keep what they learned; default: nowhere.")
]
JournalPath = Annotated[
    Path | None,
    typer.Option("--journal", metavar="FILE", help="What happens is kept there; if it is there, the mission goes on."),
]

T = TypeVar("T")

#: How long the event loop may take to notice that it is to end before it is looked whether it can, in seconds.
STUCK = 1.0


def endpoint_of(given: str | None, keys: Path | None) -> str:
    """Where the router is: the usual place if nobody says."""
    if given is not None:
        return given
    return DEFAULT_ENDPOINT if keys is None else SECURE_ENDPOINT


def credentials_from(keys: Path | None, name: str) -> "Credentials | None":
    """The checked credentials of `name` in the folder of keys, if there is one.

    Raises:
        KeysError: they cannot be used.
    """
    if keys is None:
        return None
    from lalliance_agents.extras import extra

    with extra("deploy"):
        from lalliance_agents.bus.certificates import checked_credentials

    return checked_credentials(keys, name)


def warn(text: str) -> None:
    """Tell something doubtful on standard error."""
    typer.echo(f"lalliance: warning: {text}", err=True)


def warn_of(path: Path, mission: "Mission") -> None:
    """Tell what is doubtful in the mission in the file at `path`."""
    for warning in mission.warnings():
        warn(f"{path}: {warning}")


class ToldToEnd(BaseException):
    """This process got a signal that asks it to end; whatever is open is closed on the way.

    Attributes:
        number: which signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = signal.Signals(number)


def _tell(number: int, _frame: object) -> None:
    raise ToldToEnd(number)


def end_when_told() -> None:
    """Have SIGINT and SIGTERM raise `ToldToEnd` from now on; who is to ignore one goes on doing so."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _tell)


def run_until_told(work: Coroutine[Any, Any, T]) -> T:
    """Run `work`; SIGINT and SIGTERM cancel it, also where it waits for somebody to read what it prints.

    Raises:
        ToldToEnd: one of them came.
    """
    told: list[int] = []

    async def supervised() -> T:
        task = asyncio.ensure_future(work)
        loop = asyncio.get_running_loop()

        def stop(number: int) -> None:
            signal.setitimer(signal.ITIMER_REAL, 0)
            told.append(number)
            task.cancel()

        def tell(number: int, _frame: object) -> None:
            if loop.is_closed():
                raise ToldToEnd(number)
            signal.signal(signal.SIGALRM, lambda *_: _look_whether_stuck(number))
            signal.setitimer(signal.ITIMER_REAL, STUCK)
            loop.call_soon_threadsafe(stop, number)

        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, tell)
        return await task

    try:
        return asyncio.run(supervised())
    except asyncio.CancelledError:
        raise ToldToEnd(told[0] if told else signal.SIGTERM) from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        end_when_told()


def _look_whether_stuck(number: int) -> None:
    """Go on with ending a process whose event loop has not come to it for a moment.

    Raises:
        ToldToEnd: nobody reads what it prints.
    """
    stuck = [stream for stream in (1, 2) if _is_full(stream)]
    if not stuck:  # it is only busy
        signal.setitimer(signal.ITIMER_REAL, STUCK)
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in stuck:
        os.dup2(nowhere, stream)
    raise ToldToEnd(number)


def _is_full(descriptor: int) -> bool:
    try:
        return not select.select([], [descriptor], [], 0)[1]
    except (OSError, ValueError):  # it is closed
        return False


def load_part(path: Path, seed: int | None, *, part: Literal["team", "world", "robot"]) -> "Mission":
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
