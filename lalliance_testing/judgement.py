"""What must hold of every mission that a test has run: its faults have fired, and its account is one that can be true.

The account is judged with the mission alone, so the same sentences hold for real processes and for the simulator. What only
the simulator sees is held to the invariants of campaigns on top (`lalliance_study.invariants`).
"""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from lalliance_agents.config import Mission
from lalliance_agents.model.parameters import SLACK


def unfired(faults: Collection[Mapping[str, Any]], excused: Collection[str]) -> list[str]:
    """A sentence for each fault that never fired, unless it is excused by its name or its text."""
    return [
        f"fault {fault['name']} ({fault['text']}) never fired: {_why(fault)}"
        for fault in faults
        if not fault["fired"] and not {fault["name"], fault["text"]} & set(excused)
    ]


def _why(fault: Mapping[str, Any]) -> str:
    if fault["state"] == "waiting":
        return f"it was due at {fault['at']:.1f} s, and the mission did not last until then"
    until = "" if fault["until"] is None else f" until {fault['until']:.1f} s"
    return f"it was in force from {fault['at']:.1f} s{until}, but there was nothing that it could act on"


def broken(mission: Mission, summary: Mapping[str, Any]) -> Iterator[str]:
    """What cannot be true of the account of a mission, a sentence for each."""
    yield from _tasks(mission, summary)
    yield from _takeovers(mission, summary)
    for fault in summary["faults"]:
        if fault["fired"] and fault["fired_at"] < fault["at"] - SLACK:
            yield f"fault {fault['name']} fired at {fault['fired_at']:.3f} s, before it began at {fault['at']:.3f} s"
    counts = [summary["messages"]["sent"], summary["messages"]["received"], *summary["messages"]["dropped"].values()]
    if min(counts) < 0:
        yield f"a counter is negative: {summary['messages']}"


def _tasks(mission: Mission, summary: Mapping[str, Any]) -> Iterator[str]:
    records = summary["tasks"]
    ends = [record["completed_at"] for record in records.values()]
    known = [end for end in ends if end is not None]
    if summary["complete"] != (len(known) == len(mission.tasks)):
        yield f"the mission is {'' if summary['complete'] else 'not '}complete with {len(known)} of {len(ends)} tasks"
    if summary["complete"] and abs(summary["makespan"] - max(known)) > SLACK:
        yield f"the makespan is {summary['makespan']:.3f} s, but the last task was complete at {max(known):.3f} s"
    for task, record in records.items():
        able = mission.able(task)
        for robot in {*record["by"], *(attempt["robot"] for attempt in record["attempts"])} - {*able}:
            yield f"{robot} was on {task}, which it cannot do"
        if record["completed_at"] is None:
            continue
        if not record["by"]:
            yield f"{task} was completed by nobody"
        for needed in mission.tasks[task].after:
            before = records[needed]["completed_at"]
            if before is None or before > record["completed_at"] + SLACK:
                yield f"{task} was completed at {record['completed_at']:.3f} s, before {needed}"
        if record["completed_at"] < mission.tasks[task].arrives:
            yield f"{task} was completed at {record['completed_at']:.3f} s, before it arrived"


def _takeovers(mission: Mission, summary: Mapping[str, Any]) -> Iterator[str]:
    for one in summary["takeovers"]:
        told = f"takeover of {one['task']} from {one['from']} to {one['to']} at {one['taken_at']:.3f} s"
        if one["from"] == one["to"] or not {one["from"], one["to"]} <= {*mission.able(one["task"])}:
            yield f"{told}: it is not between two robots that can do it"
        if not any(
            attempt["robot"] == one["from"] and attempt["at"] <= one["taken_at"] + SLACK
            for attempt in summary["tasks"][one["task"]]["attempts"]
        ):
            yield f"{told}: the former had not begun it"
        if one["cause"] == "silence" and one["detected_at"] is None:
            yield f"{told}: nobody had noticed the silence"
        if one["detected_at"] is not None and one["detected_at"] > one["taken_at"] + SLACK:
            yield f"{told}: the silence was noticed later, at {one['detected_at']:.3f} s"
