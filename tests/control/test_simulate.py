"""`lalliance simulate`: what it prints, and what it refuses."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import MISSIONS, Processes

HANDLING = MISSIONS / "material_handling.yaml"


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


def test_one_run_gives_the_summary_of_a_real_one_and_its_events(processes: Processes) -> None:
    document = processes.run_json("simulate", HANDLING, "--events")
    assert document["complete"]
    assert {"makespan", "tasks", "takeovers", "faults", "messages", "control", "seed"} <= document.keys()
    assert [one["cause"] for one in document["takeovers"]] == ["silence"]
    assert [line["what"] for line in document["events"]].count("complete") == 16  # the task in the world, and its robot


def test_many_runs_are_the_same_whatever_processes_they_run_in(processes: Processes) -> None:
    alone = processes.run_json("simulate", HANDLING, "--runs", "20", "--jobs", "1")
    together = processes.run_json("simulate", HANDLING, "--runs", "20", "--jobs", "2")
    assert alone == together
    assert alone["completed"] == 20
    assert [run["seed"] for run in alone["runs"]] == list(range(7, 27))
    assert alone["makespan"]["min"] < alone["makespan"]["median"] < alone["makespan"]["max"]
    assert alone["faults"] == [20]
    told = processes.run("simulate", HANDLING, "--runs", "20").stdout
    assert "Mission material_handling complete in 20 of 20 runs, seeds 7 to 26" in told
    assert "Fault: crash of lifter fired in 20 runs" in told


def test_a_mission_that_does_not_complete_is_status_1(processes: Processes) -> None:
    text = HANDLING.read_text().replace("deadline: 120", "deadline: 20")
    (processes.folder / "short.yaml").write_text(text)
    done = processes.run("simulate", "short.yaml", "--runs", "2", "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["makespan"] is None


ENDLESS = """\
name: endless
tasks: {a: {}}
robots: {one: {tasks: {a: 8}}}
parameters: {max_delay: 0.3}
faults: [{at: 1, robot: one, kind: crash}]
deadline: 1e9
"""


def test_a_mission_without_an_end_is_warned_of_and_shows_how_far_it_is(tmp_path: Path) -> None:
    (tmp_path / "endless.yaml").write_text(ENDLESS)
    terminal, end = os.openpty()
    words = [sys.executable, "-m", "mission_control", "simulate", str(tmp_path / "endless.yaml")]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=end) as running:
        os.close(end)
        shown = ""
        while not re.search(r"endless: \d,\d{3} s of at most 1,000,000,000 s", shown):
            shown += os.read(terminal, 4096).decode()
        running.send_signal(signal.SIGINT)
        assert running.wait(10) == 130
    os.close(terminal)
    assert "warning" in shown
    assert "tasks.a: no robot is left for it after crash of one at 1 s" in " ".join(shown.split())


PLAIN = """\
name: plain
environment: {{kind: task_pool, hand_over: {hand_over}}}
tasks: {{a: {{}}, b: {{}}, c: {{}}}}
robots:
  one: {{tasks: {{a: 6, b: 4}}}}
  two: {{tasks: {{a: 7, b: 7, c: 5}}}}
parameters: {{max_delay: 0.2}}
deadline: 100
"""


@pytest.mark.parametrize(
    ("hand_over", "optimum"), [("restart", 10.0), ("shared_max", 100 / 13), ("shared_add", 100 / 13)]
)
def test_the_optimum_is_told_where_it_is_known(processes: Processes, hand_over: str, optimum: float) -> None:
    """With one robot each, `one` does a and b; else the other does 5/13 of a."""
    (processes.folder / "plain.yaml").write_text(PLAIN.format(hand_over=hand_over))
    document = processes.run_json("simulate", "plain.yaml")
    assert document["optimum"] == pytest.approx(optimum)
    assert document["ratio"] == pytest.approx(document["makespan"] / optimum)
    assert document["ratio"] > 1
    many = processes.run_json("simulate", "plain.yaml", "--runs", "3")
    assert many["ratio"] == pytest.approx(many["makespan"]["mean"] / optimum)
    told = f"{document['ratio']:.2f} times the optimum of {optimum:.1f} s"
    assert told in processes.run("simulate", "plain.yaml").stdout
    assert f"times the optimum of {optimum:.1f} s" in processes.run("simulate", "plain.yaml", "--runs", "2").stdout


def test_no_optimum_is_told_of_a_mission_with_faults(processes: Processes) -> None:
    document = processes.run_json("simulate", HANDLING)
    assert (document["optimum"], document["ratio"]) == (None, None)
    assert "optimum" not in processes.run("simulate", HANDLING).stdout


def test_no_optimum_is_told_without_the_study_extra(tmp_path: Path) -> None:
    (tmp_path / "plain.yaml").write_text(PLAIN.format(hand_over="restart"))
    words = ["lalliance", "simulate", "plain.yaml", "--json"]
    hidden = "import sys; sys.modules['scipy'] = sys.modules['ortools'] = None"
    code = f"{hidden}; sys.argv = {words!r}; from mission_control.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout)
    assert document["complete"]
    assert (document["optimum"], document["ratio"]) == (None, None)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["no.yaml"], "lalliance: no.yaml: no such file; expected a mission file\n"),
        ([HANDLING, "--runs", "3", "--events"], "lalliance: --events shows one run; expected --runs 1, not 3\n"),
    ],
)
def test_bad_input_is_told_in_one_sentence(processes: Processes, words: list[str], sentence: str) -> None:
    done = processes.run("simulate", *words)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", sentence)


@pytest.mark.parametrize("words", [["--runs", "0"], ["--seed", "-1"], ["--jobs", "0"], ["--runs", "many"]])
def test_numbers_out_of_range_are_refused(processes: Processes, words: list[str]) -> None:
    done = processes.run("simulate", HANDLING, *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert words[0] in done.stderr
