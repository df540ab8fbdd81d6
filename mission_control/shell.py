"""What the commands have in common: how their arguments are called, and how work is ended from outside."""

import asyncio
import signal
from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

if TYPE_CHECKING:
    from lalliance_agents.config import Mission

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"

MissionPath = Annotated[Path, typer.Argument(metavar="MISSION", help="The mission file (YAML).", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output.")]

T = TypeVar("T")


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
    """Run `work`; SIGINT and SIGTERM cancel it.

    Raises:
        ToldToEnd: one of them came.
    """
    told: list[int] = []

    async def supervised() -> T:
        task = asyncio.ensure_future(work)
        loop = asyncio.get_running_loop()

        def stop(number: int) -> None:
            told.append(number)
            task.cancel()

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop, number)
        return await task

    try:
        return asyncio.run(supervised())
    except asyncio.CancelledError:
        raise ToldToEnd(told[0] if told else signal.SIGTERM) from None
    finally:
        end_when_told()
