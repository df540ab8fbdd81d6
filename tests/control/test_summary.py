"""What a person is told of faults."""

from io import StringIO
from typing import Any

from rich.console import Console

from lalliance_agents.mission_file import read_fault
from mission_control.summary import SHOWN_FAULTS, fault_lines, faults_table, show

SUMMARY: dict[str, Any] = {
    "mission": "pair",
    "complete": True,
    "makespan": 30.0,
    "tasks": {},
    "takeovers": [],
    "trials": [30.0],
    "messages": {"sent": 9, "received": 8, "dropped": {"lost": 3, "stale": 1}, "drops": []},
    "control": {"periods": 100, "missed": 60},
}


def fault(number: int, kind: str, text: str, state: str, fired_at: float | None, count: int = 1) -> dict[str, Any]:
    times = {"at": 2.0, "until": None if kind == "crash" else 20.0}
    fired = {"fired": fired_at is not None, "fired_at": fired_at, "count": count if fired_at is not None else 0}
    return {"name": f"{number}-{kind}", "kind": kind, "robot": None, "text": text, "state": state, **times, **fired}


FAULTS = [
    fault(1, "link", "loss 30% from * to pusher", "over", 2.1, 214),
    fault(2, "mute", "mute of lifter", "on", 5.0),
    fault(3, "crash", "crash of lifter", "on", 14.04),
    fault(4, "stuck", "stuck of lifter", "on", None),
    fault(5, "hang", "hang of pusher", "waiting", None),
]


def printed(summary: dict[str, Any]) -> list[str]:
    file = StringIO()
    show(summary, Console(width=100, file=file, color_system="standard", force_terminal=True))
    return file.getvalue().splitlines()


def test_each_fault_is_told_with_what_it_did_and_what_never_fired_stands_out() -> None:
    lines = [line for line in printed(SUMMARY | {"faults": FAULTS}) if "Fault" in line]
    assert lines == [
        "Fault: loss 30% from * to pusher: fired, 214 messages, first reported at 2.1 s",
        "Fault: mute of lifter: fired, 1 message, first reported at 5.0 s",
        "Fault: crash of lifter: fired at 14.0 s",
        "\x1b[33mFault: stuck of lifter: never fired\x1b[0m",
        "\x1b[33mFault: hang of pusher: never began, it was due at 2.0 s\x1b[0m",
    ]


def test_of_very_many_faults_the_latest_are_told_one_by_one() -> None:
    many = [fault(number, "stuck", f"stuck of r{number}", "over", None) for number in range(1000)]
    lines = [line for line in printed(SUMMARY | {"faults": many}) if "Fault" in line]
    assert len(lines) == SHOWN_FAULTS + 1
    assert (
        lines[0]
        == f"Faults: {1000 - SHOWN_FAULTS} earlier ones are not listed, {1000 - SHOWN_FAULTS} of them never fired"
    )
    assert "r999" in lines[-1]


def test_a_machine_is_not_called_slow_for_what_a_hang_has_missed() -> None:
    hung = fault(1, "hang", "hang of pusher", "over", 2.1)
    told = "".join(printed(SUMMARY | {"faults": []}))
    assert "too slow" in told
    assert "behaviour set blocks" in told
    assert not any("too slow" in line for line in printed(SUMMARY | {"faults": [hung]}))


def test_the_faults_of_a_running_mission_are_a_table() -> None:
    file = StringIO()
    Console(width=120, file=file).print(faults_table(FAULTS))
    assert [line.rstrip() for line in file.getvalue().splitlines()] == [
        "name     fault                      since     until  state    effect",
        "1-link   loss 30% from * to pusher  2.0 s    20.0 s  over     fired, 214 messages, first reported at 2.1 s",
        "2-mute   mute of lifter             2.0 s    20.0 s  on       fired, 1 message, first reported at 5.0 s",
        "3-crash  crash of lifter            2.0 s  for good  on       fired at 14.0 s",
        "4-stuck  stuck of lifter            2.0 s    20.0 s  on       none reported yet",
        "5-hang   hang of pusher             2.0 s    20.0 s  waiting",
    ]


def test_planned_faults_are_listed_with_their_times() -> None:
    faults = [
        read_fault('{"at": 4, "until": 9, "robot": "a", "kind": "crash", "restart": true}'),
        read_fault('{"at": 2.5, "robot": "a", "kind": "blind"}'),
    ]
    assert list(fault_lines(faults)) == ["  at 4 s, until 9 s: crash of a", "  at 2.5 s: blind of a"]


def test_who_was_cut_off_is_told() -> None:
    drops = [
        {"at": "lifter", "of": "pusher", "reason": "stale", "count": 3},
        {"at": "@world", "of": "lifter", "reason": "cut off", "count": 40},
    ]
    messages = SUMMARY["messages"] | {"drops": drops}
    lines = printed(SUMMARY | {"faults": [], "messages": messages})
    assert len([line for line in lines if "cut off" in line]) == 1
    assert any("lifter was cut off at @world: 40 messages, older than one that was made up" in line for line in lines)
