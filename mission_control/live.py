"""The live view: who is on what, how motivated, how far. Where there is no terminal, one line per event."""

import signal
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from types import TracebackType
from typing import Self

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from lalliance_agents.config import Mission
from mission_control.watch.screen import show, stoppable
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story
from mission_control.watch.words import printable

_BAR = 16


def bar(share: float, width: int = _BAR) -> str:
    """A bar of blocks for a share between 0 and 1."""
    filled = round(min(max(share, 0.0), 1.0) * width)
    return "█" * filled + "░" * (width - filled)


def can_redraw(console: Console) -> bool:
    """Whether what was drawn can be drawn over: a terminal can, unless it is one that only prints (TERM=dumb)."""
    return console.is_terminal and not console.is_dumb_terminal


class Lines:
    """A view for where there is no terminal: each event as a line.

    Args:
        mission: the mission's name.
        console: where to write.
    """

    def __init__(self, mission: str, console: Console) -> None:
        self._console = console
        self._story = Story(mission)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def take(self, sighting: Sighting) -> None:
        """Show what was seen of the mission."""
        happened = self._story.take(sighting)
        if happened is not None:
            self.say(str(happened))

    def locate(self, mission: str, endpoint: str) -> None:
        """Show where the mission's bus is."""
        self.say(f"mission {mission} runs on the bus at {endpoint}")

    def pin(self, text: str) -> None:
        """Show a remark that is to stay in sight."""
        self.say(text)

    def say(self, text: str) -> None:
        """Show a remark that is no message of the mission."""
        try:
            self._console.print(printable(text), highlight=False, markup=False, soft_wrap=True)
        except SystemExit:  # nobody reads it any more: the run ends as it does when it is told to
            signal.raise_signal(signal.SIGTERM)


#: Events shown once more when the live view is left, so that the story is not gone with it.
RETOLD = 60


class LiveView(Lines):
    """A view that fills the terminal and is redrawn a few times a second; when it is left, the last events stay.

    Args:
        mission: the mission it shows.
        console: a terminal.
    """

    def __init__(self, mission: Mission, console: Console) -> None:
        super().__init__(mission.name, console)
        self._mission = mission
        self._said: deque[str] = deque(maxlen=RETOLD)
        self._name_width = max(map(len, [*mission.robots, *mission.tasks]))
        self._endpoint = ""
        self._pinned = ""
        self._live = Live(console=console, get_renderable=self._render, refresh_per_second=5, screen=True)
        self._shown = ExitStack()

    def __enter__(self) -> Self:
        """Show it; only in an event loop."""
        self._shown.enter_context(self._live)
        self._shown.enter_context(stoppable(partial(show, self._live)))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._shown.close()
        for line in self._said:
            super().say(line)

    def take(self, sighting: Sighting) -> None:
        """Go on with the story; it shows at the next redraw."""
        super().take(sighting)

    def locate(self, mission: str, endpoint: str) -> None:
        """Show where the mission's bus is, for as long as the view lasts."""
        del mission
        self._endpoint = endpoint

    def pin(self, text: str) -> None:
        """Show a remark for as long as the view lasts, and when it is left."""
        self._pinned = printable(text)
        self.say(text)

    def say(self, text: str) -> None:
        """Show a remark among the events."""
        self._said.append(printable(text))

    def _render(self) -> RenderableType:
        height = self._console.size.height
        parts: list[Callable[[int], RenderableType]] = [self._headline, self._robots, self._tasks]
        rows = [1, min(len(self._mission.robots), height // 3) + 2, min(len(self._mission.tasks), height // 3) + 2]
        if self._story.faults:
            parts.insert(1, self._faults)
            rows.insert(1, 1)
        if self._pinned:
            parts.insert(1, lambda _: Text(self._pinned, "dim", no_wrap=True))
            rows.insert(1, 1)
        left = max(height - sum(rows) - 2, 3)
        return Group(*(part(row) for part, row in zip(parts, rows, strict=True)), self._events(left))

    def _headline(self, _: int) -> Text:
        status = self._story.status
        if status is None:
            line = Text(f"{self._mission.name}: starting {len(self._mission.robots)} robots …", style="bold")
        else:
            trial = f", trial {status.trial} ({status.learning} learning)" if status.trials > 1 else ""
            line = Text(f"{self._mission.name}: {status.mission}, {status.elapsed:.1f} s{trial}", style="bold")
        return line.append(f"   {self._endpoint}", style="not bold dim")

    def _faults(self, _: int) -> Text:
        return Text(
            f"in force: {'; '.join(map(printable, list(self._story.faults.values())))}",
            "red",
            no_wrap=True,
            overflow="ellipsis",
        )

    def _robots(self, rows: int) -> Table:
        table = Table(box=None, pad_edge=False, header_style="dim", show_edge=False)
        widest = max(map(len, self._mission.tasks))
        table.add_column("robot", no_wrap=True, min_width=self._name_width)
        table.add_column("on", no_wrap=True, min_width=max(widest, len("not there")))
        table.add_column("most motivated for", no_wrap=True, min_width=widest + len(" (waiting)"))
        table.add_column("motivation", no_wrap=True)
        status = self._story.status
        facts = status.robots if status else {}
        for robot in list(self._mission.robots)[: rows - 2]:
            fact = facts.get(robot, {})
            if not fact.get("present"):
                table.add_row(Text(robot, style="dim"), Text("not there", style="red" if status else "dim"), "", "")
                continue
            task = fact.get("task")
            table.add_row(
                robot, Text(str(task), style="green") if task else Text("idle", style="dim"), *self._wish(robot)
            )
        return table

    def _wish(self, robot: str) -> tuple[str, str]:
        seen = self._story.robots.get(robot)
        strongest = None if seen is None else seen.strongest
        if strongest is None:
            return "", ""
        task, factors = strongest
        theta = self._mission.parameters_of(robot).threshold
        motivation = factors.get("motivation")
        share = motivation / theta if isinstance(motivation, int | float) else 0.0
        if factors.get("pace") == "working":
            return "", bar(1.0)
        return (f"{task} ({factors.get('pace')})" if share > 0 else ""), bar(share)

    def _tasks(self, rows: int) -> Table:
        table = Table(box=None, pad_edge=False, header_style="dim", show_edge=False)
        table.add_column("task", no_wrap=True, min_width=self._name_width)
        table.add_column("progress", no_wrap=True)
        table.add_column("", no_wrap=True, min_width=len("not yet"))
        table.add_column("robots", no_wrap=True)
        status = self._story.status
        facts = status.tasks if status else {}
        open_first = sorted(self._mission.tasks, key=lambda task: bool(facts.get(task, {}).get("complete")))
        for task in open_first[: rows - 2]:
            fact = facts.get(task, {})
            progress = fact.get("progress")
            share = float(progress) if isinstance(progress, int | float) else 0.0
            state = "done" if fact.get("complete") else ("" if fact.get("applicable") else "not yet")
            style = "dim" if state else ""
            table.add_row(Text(task, style=style), bar(share), Text(state, style=style), ", ".join(self._working(task)))
        return table

    def _working(self, task: str) -> list[str]:
        """The robots whose bodies work on `task`."""
        robots = self._story.status.robots if self._story.status else {}
        return [robot for robot, facts in robots.items() if facts.get("task") == task and facts.get("present")]

    def _events(self, rows: int) -> Text:
        return Text("\n".join(list(self._said)[-rows:]), style="dim", no_wrap=True, overflow="ellipsis")
