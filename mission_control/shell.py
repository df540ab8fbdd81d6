"""What the commands have in common: how their arguments are called, and how work is ended from outside."""

import asyncio
import signal
from collections.abc import Coroutine
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"

MissionPath = Annotated[Path, typer.Argument(metavar="MISSION", help="The mission file (YAML).", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output.")]

T = TypeVar("T")


def run_until_told(work: Coroutine[Any, Any, T]) -> T:
    """Run `work`; SIGINT and SIGTERM cancel it and end the process with 128 + the signal's number."""
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
        number = signal.Signals(told[0] if told else signal.SIGTERM)
        if number is signal.SIGINT:
            typer.echo("lalliance: interrupted", err=True)
        raise typer.Exit(128 + number) from None
