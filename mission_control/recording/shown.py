"""What a recording holds, as a person reads it."""

import datetime
from collections.abc import Iterator

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lalliance_agents.wire.keys import Keys
from mission_control.recording.reader import Information
from mission_control.watch.words import printable

#: Gaps that are printed each.
SHOWN = 10


def show(found: Information, console: Console) -> None:
    """Print what a recording holds."""
    facts = Table.grid(padding=(0, 2))
    for name, value in _facts(found):
        facts.add_row(Text(name, style="bold"), Text(printable(value)))
    console.print(facts)
    table = Table(box=None, pad_edge=False, header_style="bold")
    prefix = Keys(found.about.mission).prefix
    table.add_column(f"key below {prefix}", overflow="fold")
    table.add_column("messages", justify="right")
    table.add_column("per second", justify="right")
    for key, count in found.counts.items():
        rate = f"{count / found.duration:.1f}" if found.duration else "-"
        table.add_row(Text(printable(key.removeprefix(prefix))), f"{count:,}", rate)
    console.print(table)


def _facts(found: Information) -> Iterator[tuple[str, str]]:
    began = datetime.datetime.fromtimestamp(found.started_at / 1e9, datetime.UTC)
    yield "file", f"{found.path}, {found.size:,} bytes, {'whole' if found.complete else 'not whole'}"
    yield "mission", f"{found.about.mission}, seed {found.about.seed}"
    yield "recorded by", f"lalliance {found.about.version}"
    yield "began", f"{began:%Y-%m-%d %H:%M:%S} UTC" if found.started_at else "-"
    yield "duration", f"{found.duration:.1f} s"
    yield "messages", f"{found.messages:,} on {len(found.counts):,} keys"
    yield "ended", "-" if found.ending is None else found.ending.reason
    yield "dropped", "-" if found.ending is None else f"{found.ending.dropped:,}"
    for gap in found.gaps[:SHOWN]:
        began = datetime.datetime.fromtimestamp(gap.since.wall / 1e9, datetime.UTC)
        yield "gap", f"from {began:%Y-%m-%d %H:%M:%S} UTC: {gap}"
    if len(found.gaps) > SHOWN:
        yield "gaps", f"{len(found.gaps):,} altogether"
