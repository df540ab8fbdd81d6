"""What `lalliance campaign` does with missions that fail: here all with three tasks or more are taken to."""

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest
import typer

from lalliance_agents.config import Mission
from lalliance_agents.errors import LallianceError
from lalliance_agents.mission_file import load_mission
from lalliance_study.invariants import Violation
from lalliance_study.pool import at_once
from mission_control.campaign_command import campaign
from mission_control.shell import ToldToEnd


@pytest.fixture(autouse=True)
def broken(monkeypatch: pytest.MonkeyPatch) -> None:
    def judged(mission: Mission) -> tuple[None, list[Violation]]:
        many = len(mission.tasks) >= 3
        return None, [Violation("few_tasks", f"{len(mission.tasks)}\ntasks")] if many else []

    monkeypatch.setattr("lalliance_study.campaign.try_mission", judged)


def ended(**options: Any) -> int:
    with pytest.raises(typer.Exit) as end:
        campaign(**{"missions": 6, "seed": 4, "jobs": 1, **options})
    return end.value.exit_code


def test_failures_are_told_and_written_made_small(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(out=tmp_path / "found") == 1
    out = capsys.readouterr().out
    files = sorted((tmp_path / "found").iterdir())
    assert files
    for path in files:
        mission = load_mission(path)
        assert (len(mission.tasks), mission.faults) == (3, ())
        assert len(mission.robots) <= 3
        number = mission.name.rpartition("-")[2]
        assert path.name == f"seed-4-mission-{number}-few_tasks.yaml"
        assert path.read_text().startswith("# Breaks few_tasks: ")
        assert f"lalliance campaign --seed 4 --only {number}" in out
        assert f"lalliance campaign --replay {path}" in out
    assert f"6 missions of seed 4, {len(files)} failed; " in out.splitlines()[-1]


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    assert ended(out=tmp_path) == 1
    before = {path.name: path.read_text() for path in tmp_path.iterdir()}
    first = next(iter(before))
    (tmp_path / first).write_text("mine\n")
    assert ended(out=tmp_path) == 1
    after = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert after[first] == "mine\n"
    assert len(after) == 2 * len(before)
    assert after[first.replace(".yaml", "-2.yaml")] == before[first]


def test_the_document_names_each_failure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ended(out=tmp_path, as_json=True) == 1
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    assert document["failed"] == len(document["failures"]) == len(list(tmp_path.iterdir()))
    for failure in document["failures"]:
        assert failure["invariant"] == "few_tasks"
        assert Path(failure["file"]).exists()
        assert failure["command"] == f"lalliance campaign --seed 4 --only {failure['number']}"
    assert "few_tasks" in captured.err


def test_a_file_that_fails_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "m.yaml"
    path.write_text("name: m\ntasks: {a: {}, b: {}, c: {}}\nrobots: {one: {tasks: {a: 1, b: 1, c: 1}}}\n")
    assert ended(replay=path) == 1
    assert capsys.readouterr().out == f"{path}\n  few_tasks: 3\ntasks\n"
    assert ended(replay=path, as_json=True) == 1
    assert json.loads(capsys.readouterr().out)["failures"] == [{"invariant": "few_tasks", "facts": "3\ntasks"}]


def test_ctrl_c_while_missions_are_made_small_still_writes_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        raise ToldToEnd(signal.SIGINT)

    monkeypatch.setattr("lalliance_study.campaign.make_small", interrupted)
    assert ended(out=tmp_path) == 1
    assert all(len(load_mission(path).tasks) >= 3 for path in tmp_path.iterdir())
    assert list(tmp_path.iterdir())


def test_a_process_that_is_killed_is_told() -> None:
    with pytest.raises(LallianceError, match="a process that did a part of the work was killed"):
        list(at_once(os._exit, [(3,), (3,)], 2))
