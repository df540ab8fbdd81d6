"""The benchmarks of real processes do what they say; how fast anything is, is not looked at."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def measured(folder: Path, *names: str) -> list[dict[str, Any]]:
    """What quick runs of benchmarks, all at the same time, write."""
    running = {}
    for name in names:
        command = [sys.executable, BENCHMARKS / f"{name}.py", "--quick", "--json", folder / name]
        running[name] = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        for process in running.values():
            _, err = process.communicate(timeout=120)
            assert process.returncode == 0, err
    finally:
        for process in running.values():
            process.kill()
            process.communicate()
    return [json.loads((folder / name).read_text()) for name in names]


def test_teams_are_measured_beside_bare_processes_and_failures_by_silence_and_by_zenoh(tmp_path: Path) -> None:
    sizes, failures = measured(tmp_path, "team_size", "failover")
    for figures in (sizes, failures):
        assert all(len(line) == len(figures["table"]["head"]) for line in figures["table"]["body"])
        assert figures["machine"].keys() >= {"lalliance", "eclipse-zenoh", "cores"}
        assert figures["notes"]

    teams = {(row["kind"], row["robots"], row["processes"]): row for row in sizes["rows"]}
    assert list(teams) == [("bare, idle", 3, 3), ("bare", 3, 3), ("robots", 3, 3), ("robots", 6, 2)]
    assert all(row["cpu"] > 0 and row["pss"] > 1 for row in teams.values())
    assert all(row["periods"] > 0 and row["delivered"] > 0 for row in sizes["rows"][2:])

    rows = {(row["method"], row["fault"]): row for row in failures["rows"]}
    methods = ("silence", "Zenoh, lease 0.5 s", "Zenoh, lease 2 s, as here")
    assert list(rows) == [(method, fault) for method in methods for fault in ("SIGKILL", "SIGSTOP")]
    assert all(row["faults"] > 0 and row["noticed_p50"] > 0 for row in rows.values())
    assert rows["silence", "SIGKILL"]["taken_p50"] > rows["silence", "SIGKILL"]["noticed_p50"] > 0.5
    assert rows["Zenoh, lease 2 s, as here", "SIGSTOP"]["noticed_p50"] > 1.0
