"""The summary of a mission as a person reads it."""

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text


def show(summary: Mapping[str, Any], console: Console) -> None:
    """Print a summary."""
    console.print(Group(*_parts(summary)))


def _parts(summary: Mapping[str, Any]) -> Iterator[RenderableType]:
    yield _headline(summary)
    yield _tasks(summary["tasks"])
    if summary["takeovers"]:
        yield _takeovers(summary["takeovers"])
    yield from _notes(summary)


def _headline(summary: Mapping[str, Any]) -> Text:
    if summary["complete"]:
        return Text(
            f"\nMission {summary['mission']} complete: makespan {summary['makespan']:.1f} s", style="bold green"
        )
    return Text(f"\nMission {summary['mission']} not complete", style="bold red")


def _tasks(tasks: Mapping[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("task")
    table.add_column("done at", justify="right")
    table.add_column("by")
    table.add_column("attempts")
    for name, task in tasks.items():
        done = "open" if task["completed_at"] is None else f"{task['completed_at']:.1f} s"
        attempts = ", ".join(map(_attempt, task["attempts"]))
        table.add_row(name, done, " + ".join(task["by"]), attempts)
    return table


_ENDS = {
    "lost": "lost",
    "collision": "collided",
    "contender": "yielded",
    "no_success": "gave up",
    "inapplicable": "paused",
    "body_failed": "failed",
}


def _attempt(attempt: Mapping[str, Any]) -> str:
    ended = _ENDS.get(attempt["ended"] or "")
    return f"{attempt['robot']} from {attempt['at']:.1f} s" + (f" ({ended})" if ended else "")


def _takeovers(takeovers: list[dict[str, Any]]) -> Table:
    table = Table(title="Takeovers", title_justify="left", box=None, pad_edge=False, header_style="bold")
    for column in ("task", "from", "to", "cause"):
        table.add_column(column)
    for column in ("robot lost at", "noticed at", "taken at"):
        table.add_column(column, justify="right")
    for one in takeovers:
        table.add_row(
            one["task"],
            one["from"],
            one["to"],
            one["cause"],
            _instant(one.get("failed_at")),
            _instant(one["detected_at"]),
            _instant(one["taken_at"]),
        )
    return table


def _instant(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} s"


def _notes(summary: Mapping[str, Any]) -> Iterator[Text]:
    for fault in summary["faults"]:
        fired = f"fired at {fault['fired_at']:.1f} s" if fault["fired"] else "never fired"
        yield Text(f"Fault: {fault['kind']} of {fault['robot']} {fired}", style="" if fault["fired"] else "yellow")
    if len(summary["trials"]) > 1:
        times = [f"{time:.1f}" for time in summary["trials"]]
        shown = times if len(times) <= 12 else [*times[:5], "…", *times[-5:]]
        yield Text(f"Trials: {len(times)}, makespans {', '.join(shown)} s")
    messages, control = summary["messages"], summary["control"]
    dropped = ", ".join(f"{count} {reason}" for reason, count in messages["dropped"].items()) or "none"
    yield Text(f"Messages: {messages['sent']} sent, {messages['received']} received, dropped: {dropped}")
    yield Text(f"Control periods: {control['periods']} kept, {control['missed']} missed")
    if control["missed"] > 0.01 * control["periods"]:
        yield Text("Many control periods were missed: this machine is too slow for this team at this speed", "yellow")
