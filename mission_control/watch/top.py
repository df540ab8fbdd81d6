"""`lalliance top`: every robot of a mission in a view that fills the terminal, sorted as its keys say."""

import asyncio
import contextlib
import json
from functools import partial
from pathlib import Path

import typer
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from lalliance_agents.clock import MissionClock
from mission_control.live import bar, can_redraw
from mission_control.reach import Reached, reached
from mission_control.watch.absence import words
from mission_control.watch.board import ORDERS, Row, Selection, rows
from mission_control.watch.explain import tell
from mission_control.watch.keyboard import keyboard
from mission_control.watch.onlooker import Onlooker, look, meet
from mission_control.watch.screen import show
from mission_control.watch.story import Story
from mission_control.watch.words import printable

#: Redraws per second.
REDRAWS = 4
#: From so many columns on there is room for what a robot wants, and how long it was not heard.
WIDE = 100
#: With fewer columns there is none for motivations and missed control periods.
NARROW = 70
#: Cells of a motivation's bar.
_BAR = 8
#: Share of missed control periods from which on it is shown as doubtful.
_MANY_MISSED = 0.01


async def top(mission: str | None, connect: str | None, keys: Path | None, *, once: bool, as_json: bool) -> None:
    """Show the mission until its viewer has seen enough; once, where there is no terminal or that is all that is wanted.

    Raises:
        UserError: there is no such mission.
    """
    console = Console()
    async with (
        reached(mission, connect, keys) as there,
        Onlooker(there.bus, there.mission, MissionClock(), motivations=True) as onlooker,
    ):
        story = Story(there.mission)
        await meet(onlooker, story)
        if once or as_json or not can_redraw(console):
            await look(onlooker, story, lambda: _is_known(story))
            view = View(there, story, onlooker, console)
            typer.echo(json.dumps(view.plain())) if as_json else console.print(view.whole())
            return
        await _go_on(View(there, story, onlooker, console), onlooker, story)


def _is_known(story: Story) -> bool:
    """Whether everybody who is there has reported."""
    there = [seen for seen in story.robots.values() if seen.present]
    return all(seen.link is not None and seen.motivations is not None for seen in there)


async def _go_on(view: "View", onlooker: Onlooker, story: Story) -> None:
    """Draw again a few times a second and at each key; all in the event loop, where the story goes on too."""
    pressed, seen_enough = asyncio.Event(), asyncio.Event()

    def press(key: str) -> None:
        if view.selection.press(key):
            seen_enough.set()
        pressed.set()

    async def follow() -> None:
        async for sighting in onlooker:
            story.take(sighting)

    following = asyncio.create_task(follow())
    try:
        with (
            Live(console=view.console, get_renderable=view.screen, auto_refresh=False, screen=True) as live,
            keyboard(press, partial(show, live)),
        ):
            while not seen_enough.is_set():
                pressed.clear()
                live.refresh()
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(1 / REDRAWS):
                        await pressed.wait()
    finally:
        following.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await following


class View:
    """Draws a mission.

    Args:
        there: the mission and its bus.
        story: the mission as seen so far.
        onlooker: who looks on.
        console: where it is drawn.
    """

    def __init__(self, there: Reached, story: Story, onlooker: Onlooker, console: Console) -> None:
        self.selection = Selection()
        self.console = console
        self._there = there
        self._story = story
        self._onlooker = onlooker

    def plain(self) -> dict[str, object]:
        """The same for programs."""
        story, status = self._story, self._story.status
        return {
            "mission": story.mission,
            "stage": None if status is None else status.mission,
            "trial": story.trial,
            "elapsed": story.elapsed(self._onlooker.now),
            "robots": [row._asdict() for row in rows(story, self._onlooker.now)],
            "tasks": {
                task.name: {"complete": task.complete, "progress": task.progress} for task in story.tasks.values()
            },
            "faults": list(story.faults.values()),
            "dropped": self._onlooker.dropped,
        }

    def whole(self) -> RenderableType:
        """Everything at once."""
        found = rows(self._story, self._onlooker.now)
        return Group(*self._head(), self._table(self.selection.of(found, len(found))))

    def screen(self) -> RenderableType:
        """What fits on the screen: robots, and below them what was decided last."""
        height = self.console.size.height
        head = self._head()
        found = rows(self._story, self._onlooker.now)
        room = max(height - len(head) - 3, 1)  # the table's header, the keys, and one line that is left free
        shown = self.selection.of(found, room)
        left = room - len(shown)
        last = self._last(left - 1) if left > 1 else []
        free = [Text()] * (left - len(last))
        return Group(*head, self._table(shown), *free[:1], *last, *free[1:], self._keys(len(found), len(shown)))

    def _head(self) -> list[RenderableType]:
        story, status = self._story, self._story.status
        if status is None:
            line = Text(f"{story.mission}: no world server is heard", style="bold")
        else:
            trial = f", trial {status.trial} of {status.trials}" if status.trials > 1 else ""
            elapsed = (
                f"{story.elapsed(self._onlooker.now):.1f} s"
                if status.mission == "running"
                else f"{status.elapsed:.1f} s"
            )
            line = Text(f"{story.mission}: {status.mission}, {elapsed}{trial}", style="bold")
        line.append(f"   {self._there.endpoint}", style="not bold dim")
        away_for = self._onlooker.away_for
        if away_for is not None:
            line = Text(f"{story.mission}: {words(away_for)} at {self._there.endpoint}", style="bold red")
        done = sum(task.complete for task in story.tasks.values())
        there = sum(seen.present is True for seen in story.robots.values())
        facts = [
            f"robots {there} of {len(story.robots)} there",
            f"tasks {done} of {len(story.tasks)} complete",
            f"takeovers {len(story.takeovers())}",
            f"messages {sum(story.messages.values()):,}",
        ]
        if dropped := self._onlooker.dropped:
            facts.append(f"not seen {dropped:,}")
        lines: list[RenderableType] = [_one_line(line), _one_line(Text("   ".join(facts)))]
        if story.faults:
            lines.append(_one_line(Text(f"in force: {'; '.join(map(printable, story.faults.values()))}", style="red")))
        return lines

    def _table(self, shown: list[Row]) -> Table:
        width = self.console.size.width
        wide, narrow = width >= WIDE, width < NARROW
        table = Table(
            box=None, pad_edge=False, show_edge=False, header_style="reverse", expand=True, padding=(0, 1, 0, 0)
        )
        table.add_column("robot", no_wrap=True, ratio=3)
        table.add_column("task", no_wrap=True, ratio=3)
        table.add_column("since", no_wrap=True, justify="right", width=7)
        if not narrow:
            table.add_column("motivation", no_wrap=True, width=_BAR + 5)
        if wide:
            table.add_column("wants", no_wrap=True, ratio=3)
        table.add_column("hears", no_wrap=True, justify="right", width=7)
        table.add_column("loss", no_wrap=True, justify="right", width=6)
        if not narrow:
            table.add_column("missed", no_wrap=True, justify="right", width=12 if wide else 6)
        if wide:
            table.add_column("silent", no_wrap=True, justify="right", width=8)
        for row in shown:
            table.add_row(*_cells(row, wide=wide, narrow=narrow))
        return table

    def _last(self, lines: int) -> list[RenderableType]:
        told = [tell(one) for one in list(self._story.happened)[-lines:]]
        return [_one_line(Text(printable(line), style="dim")) for line in told]

    def _keys(self, robots: int, shown: int) -> RenderableType:
        order = self.selection.order
        wide = self.console.size.width >= WIDE
        words = " ".join(f"{one.letter}:{one.name}" if wide else one.letter for one in ORDERS)
        part = f"   {self.selection.first + 1}-{self.selection.first + shown} of {robots}" if shown < robots else ""
        turned = ", turned" if self.selection.turned else ""
        return _one_line(
            Text(f"by {order.name}{turned}{part}   q:quit r:turn ↑↓:scroll ←→ or {words}: sort", style="dim")
        )


def _one_line(text: Text) -> Text:
    text.no_wrap, text.overflow = True, "ellipsis"
    return text


def _cells(row: Row, *, wide: bool, narrow: bool) -> list[Text]:
    away = row.present is False
    motivation = Text("" if away else f"{bar(row.motivation, _BAR)} {row.motivation:4.2f}")
    missed = Text(_missed(row, wide=wide), style="yellow" if row.missed_share > _MANY_MISSED else "")
    silent = Text("" if row.silent is None else f"{row.silent:.1f} s")
    return [
        Text(row.robot, style="dim" if away else ""),
        Text(row.state, style="red" if away else "green" if row.task else "dim"),
        Text("" if row.on_it is None else f"{row.on_it:.1f} s"),
        *([] if narrow else [motivation]),
        *([Text(row.wants or "", style="dim")] if wide else []),
        Text("" if away else f"{row.hears} of {row.heard}", style="yellow" if row.hears < row.heard else ""),
        Text("" if away else f"{row.loss:.0%}", style="yellow" if row.loss else ""),
        *([] if narrow else [missed]),
        *([silent] if wide else []),
    ]


def _missed(row: Row, *, wide: bool) -> str:
    if row.present is False:
        return ""
    return f"{row.missed} ({row.missed_share:.1%})" if wide else str(row.missed)
