"""The summary of a mission as a person reads it, and its faults while it still runs."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from lalliance_agents.bus.drops import CUT_OFF
from lalliance_agents.faults import Fault, describe

#: Faults that are shown one by one: the latest.
SHOWN_FAULTS = 30


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
        told = f"\nMission {summary['mission']} complete: makespan {summary['makespan']:.1f} s"
        if summary.get("ratio") is not None:
            told += f", {summary['ratio']:.2f} times the optimum of {summary['optimum']:.1f} s"
        return Text(told, style="bold green")
    return Text(f"\nMission {summary['mission']} not complete", style="bold red")


def _tasks(tasks: Mapping[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("task")
    table.add_column("done at", justify="right")
    table.add_column("by")
    table.add_column("attempts")
    for name, task in tasks.items():
        done = "open" if task["completed_at"] is None else f"{task['completed_at']:.1f} s"
        attempts = ", ".join(_attempts(task["attempts"]))
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


def _attempts(attempts: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Attempts in words; those of one robot that follow one another and end alike, in one."""
    for (robot, end), same in groupby(attempts, lambda one: (one["robot"], _ENDS.get(one["ended"] or ""))):
        instants = [f"{one['at']:.1f} s" for one in same]
        often = f"{robot} {len(instants)} times, from {instants[0]} to {instants[-1]}"
        told = f"{robot} from {', '.join(instants)}" if len(instants) < 4 else often
        yield f"{told} ({end})" if end else told


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


def fault_lines(faults: Sequence[Fault]) -> Iterator[str]:
    """The faults that a mission plans, one line for each."""
    for fault in faults:
        until = "" if fault.end == math.inf else f", until {fault.end:g} s"
        yield f"  at {fault.at:g} s{until}: {describe(fault)}"


def _faults(faults: Sequence[Mapping[str, Any]]) -> Iterator[Text]:
    if len(faults) > SHOWN_FAULTS:
        idle = sum(not fault["fired"] for fault in faults[:-SHOWN_FAULTS])
        yield Text(f"Faults: {len(faults) - SHOWN_FAULTS} earlier ones are not listed, {idle} of them never fired")
    for fault in faults[-SHOWN_FAULTS:]:
        if fault["state"] == "waiting":
            outcome = f"never began, it was due at {fault['at']:.1f} s"
        else:
            outcome = _effect(fault) or "never fired"
        yield Text(f"Fault: {fault['text']}: {outcome}", style="" if fault["fired"] else "yellow")


#: Faults of which every message that they touch is counted.
_COUNTED = {"link", "partition", "mute", "deaf", "blind"}


def _effect(fault: Mapping[str, Any]) -> str:
    """What a fault has done; empty: nothing so far."""
    if not fault["fired"]:
        return ""
    if fault["kind"] not in _COUNTED:
        return f"fired at {fault['fired_at']:.1f} s"
    messages = f"{fault['count']} message{'' if fault['count'] == 1 else 's'}"
    return f"fired, {messages}, first reported at {fault['fired_at']:.1f} s"


_STYLES = {"waiting": "dim", "on": "red", "over": ""}


def faults_table(faults: Sequence[Mapping[str, Any]]) -> Table:
    """The faults of a mission that runs, as the world tells them."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("name", "fault"):
        table.add_column(column)
    for column in ("since", "until"):
        table.add_column(column, justify="right")
    for column in ("state", "effect"):
        table.add_column(column)
    for fault in faults:
        until = "for good" if fault["until"] is None else f"{fault['until']:.1f} s"
        state = Text(fault["state"], style=_STYLES.get(fault["state"], ""))
        effect = _effect(fault) or {"waiting": "", "on": "none reported yet", "over": "never fired"}[fault["state"]]
        table.add_row(fault["name"], Text(fault["text"]), f"{fault['at']:.1f} s", until, state, effect)
    return table


def _notes(summary: Mapping[str, Any]) -> Iterator[Text]:
    yield from _faults(summary["faults"])
    if len(summary["trials"]) > 1:
        times = [f"{time:.1f}" for time in summary["trials"]]
        shown = times if len(times) <= 12 else [*times[:5], "…", *times[-5:]]
        yield Text(f"Trials: {len(times)}, makespans {', '.join(shown)} s")
    messages, control = summary["messages"], summary["control"]
    dropped = ", ".join(f"{count} {reason}" for reason, count in messages["dropped"].items()) or "none"
    yield Text(f"Messages: {messages['sent']} sent, {messages['received']} received, dropped: {dropped}")
    for drop in messages["drops"]:
        if drop["reason"] == CUT_OFF:
            yield Text(
                f"{drop['of']} was cut off at {drop['at']}: {drop['count']} messages, older than one that was made up or that "
                "another process of this name sent",
                "yellow",
            )
    yield Text(f"Control periods: {control['periods']} kept, {control['missed']} missed")
    # A robot that hung has missed its periods whatever the machine.
    hung = any(fault["kind"] == "hang" and fault["fired"] for fault in summary["faults"])
    if control["missed"] > 0.01 * control["periods"] and not hung:
        yield Text(
            "Many control periods were missed: this machine is too slow for this team at this speed, or the code of a "
            "behaviour set blocks",
            "yellow",
        )
