"""The form that all benchmarks have: a table for people, and the same figures with machine and version for programs."""

import argparse
import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

Row = Mapping[str, Any]
#: heading -> how a row's figure is told under it
Columns = Mapping[str, Callable[[Any], str]]


def options(about: str | None) -> argparse.ArgumentParser:
    """The command line of a benchmark, with what all of them take."""
    arguments = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--json", type=Path, metavar="FILE", help="where to write the figures")
    arguments.add_argument("--quick", action="store_true", help="little of everything, to see that it works")
    return arguments


def machine(*packages: str) -> dict[str, Any]:
    """What it was measured with: processor, system, Python, lalliance, and other packages that matter."""
    model = [line.split(":", 1)[1].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")]
    return {
        "processor": model[0] if model else platform.machine(),
        "cores": os.cpu_count(),
        "system": platform.system() + " " + platform.release(),
        "python": platform.python_version(),
        **{package: version(package) for package in ("lalliance", *packages)},
    }


def publish(
    title: str,
    columns: Columns,
    rows: Sequence[Row],
    *,
    path: Path | None,
    notes: Sequence[str] = (),
    packages: Sequence[str] = (),
) -> None:
    """Print the figures as a table, and write them to a file if one is named.

    Args:
        title: what the table shows, in a line.
        columns: how a row is told.
        rows: what was measured, for programs; each has all that the columns ask for.
        path: the file.
        notes: sentences under the table, such as how a figure compares with its goal.
        packages: those whose versions matter, besides lalliance.
    """
    told = [[tell(row) for tell in columns.values()] for row in rows]
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for number, heading in enumerate(columns):
        table.add_column(heading, justify="right" if number else "left")
    for line in told:
        table.add_row(*line)
    console = Console(width=max(Console().width, 130))
    console.print(table)
    for note in notes:
        console.print(note, highlight=False)
    if path is not None:
        figures = {
            "title": title,
            "machine": machine(*packages),
            "table": {"head": list(columns), "body": told},
            "notes": list(notes),
            "rows": [dict(row) for row in rows],
        }
        path.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n")


def _lines(path: str) -> list[str]:
    """The lines of a file, none if there is no such file."""
    place = Path(path)
    return place.read_text().splitlines() if place.exists() else []
