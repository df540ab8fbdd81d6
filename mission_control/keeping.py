"""Summaries of missions that are over: kept in a file, found there, and told."""

import json
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from lalliance_agents.errors import UserError
from lalliance_agents.whole_file import written_whole

if TYPE_CHECKING:
    from rich.console import Console

#: How often to look whether a summary is there, in seconds.
_PERIOD = 0.5
#: What a summary has at least.
_PARTS = {"mission", "complete", "makespan", "tasks", "takeovers", "faults", "trials", "messages", "control"}
_EXPECTED = "expected what `lalliance world --summary FILE` has written"


def check_place(path: Path) -> None:
    """Make sure that a summary can be kept at `path`.

    Raises:
        UserError: it cannot.
    """
    try:
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise UserError(
            f"{path}: a summary cannot be kept there ({error.strerror}); expected a folder that can be written to"
        ) from None


def keep(summary: Mapping[str, Any], path: Path) -> None:
    """Write a summary; a reader finds all of it or none."""
    with written_whole(path) as file:
        file.write(json.dumps(summary).encode())


def kept_summary(path: Path, *, wait: bool) -> dict[str, Any]:
    """The summary that was kept at `path`.

    Args:
        path: the file.
        wait: whether to wait until there is one.

    Raises:
        UserError: there is none, or what is there is no summary.
    """
    while wait and not path.exists():
        time.sleep(_PERIOD)
    try:
        summary: Any = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise UserError(f"{path}: no such file; expected a mission that is over, or --wait") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); {_EXPECTED}") from None
    except ValueError:
        raise UserError(f"{path}: this is no summary; {_EXPECTED}") from None
    if not isinstance(summary, dict) or not summary.keys() >= _PARTS:
        raise UserError(f"{path}: this is no summary; {_EXPECTED}")
    found: dict[str, Any] = summary
    return found


def tell(summary: Mapping[str, Any], *, as_json: bool, console: "Console | None" = None) -> None:
    """Print a summary, on standard output or the console, and end with the status of its mission.

    Raises:
        typer.Exit: always.
    """
    if as_json:
        typer.echo(json.dumps(summary))
    else:
        from rich.console import Console

        from mission_control.summary import show

        show(summary, Console() if console is None else console)
    raise typer.Exit(0 if summary["complete"] else 1)
