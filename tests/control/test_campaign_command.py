"""`lalliance campaign`: what it prints, what it writes, and how it ends."""

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes, until

STUCK = """\
name: stuck
tasks: {a: {}}
robots: {one: {tasks: {a: 1}}}
parameters: {collision_window: 0}
faults: [{at: 0, robot: one, kind: slow, factor: 19}]
deadline: 400
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


def refused(done: "subprocess.CompletedProcess[str]") -> str:
    assert done.returncode == 2
    assert done.stdout == ""
    return done.stderr


def test_a_campaign_says_what_it_saw(processes: Processes) -> None:
    done = processes.run("campaign", "--missions", "30", "--seed", "5", "--jobs", "2")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["fault", "scheduled", "fired", "had", "nothing", "to", "strike"]
    assert any(line.startswith("Takeovers: ") for line in lines)
    assert lines[-1].startswith("30 missions of seed 5, 0 failed; ")
    assert "missions/s" in lines[-1]
    assert "virtual hours" in lines[-1]
    assert list(processes.folder.iterdir()) == []


def test_the_document_is_the_same_for_any_number_of_jobs(processes: Processes) -> None:
    documents = []
    for jobs in ("1", "2"):
        done = processes.run("campaign", "--missions", "40", "--json", "--jobs", jobs)
        document = json.loads(done.stdout)
        assert document.pop("seconds") > 0
        assert document.pop("rate") > 0
        documents.append(document)
    assert documents[0] == documents[1]
    assert documents[0]["missions"] == 40
    assert documents[0]["failures"] == []
    assert len(documents[0]["digest"]) == 16


def test_one_mission_alone(processes: Processes) -> None:
    done = processes.run("campaign", "--seed", "5", "--only", "123456", "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["missions"] == 1


def test_a_file_is_checked(processes: Processes) -> None:
    path = processes.folder / "m.yaml"
    path.write_text(STUCK)
    done = processes.run("campaign", "--replay", path)
    assert (done.returncode, done.stdout) == (0, f"{path}: everything holds\n")
    document = json.loads(processes.run("campaign", "--replay", path, "--json").stdout)
    assert (document["why"], document["failures"]) == ("all progress", [])


BAD = {
    "no missions": (["--missions", "0"], "--missions"),
    "a negative seed": (["--seed", "-1"], "--seed"),
    "a negative number": (["--only", "-3"], "--only"),
    "no jobs": (["--jobs", "0"], "--jobs"),
    "a folder below a file": (["--out", "file/below"], "file/below: missions that fail cannot be written there"),
    "a file instead of a folder": (["--out", "file"], "expected a folder, or where to make one"),
    "a file that is not there": (["--replay", "missing.yaml"], "missing.yaml: no such file"),
    "a file that is no mission": (["--replay", "file"], "file:1: the file holds text; expected a mapping"),
    "two missions at once": (["--replay", "file", "--only", "3"], "expected one of the two"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_a_sentence(processes: Processes, case: str) -> None:
    arguments, says = BAD[case]
    (processes.folder / "file").write_text("something\n")
    assert says in refused(processes.run("campaign", "--missions", "1", *arguments))
    assert len(list(processes.folder.iterdir())) == 1


@pytest.mark.alone
def test_ctrl_c_ends_it_within_two_seconds_and_it_tells_what_it_has(processes: Processes) -> None:
    running = processes.start("campaign", "--missions", "1000000", "--jobs", "2")
    time.sleep(4.0)
    running.send_signal(signal.SIGINT)
    told = time.monotonic()
    out, err = running.communicate(timeout=20)
    assert time.monotonic() - told < 2.0
    assert running.returncode == 128 + signal.SIGINT
    assert err == "lalliance: interrupted\n"
    assert "0 failed" in out.splitlines()[-1]
    until(lambda: not processes.alive())
