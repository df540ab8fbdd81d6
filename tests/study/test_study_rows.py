"""What is kept of a mission, wherever it was carried out, and however often that was interrupted."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest
from support.processes import Processes, until
from support.small_study import SMALL, carry_out

from lalliance_agents.errors import LallianceError, UserError
from lalliance_study.experiments import cluster, rows
from lalliance_study.experiments.plan import numbered
from lalliance_study.experiments.runner import here, open_study, run
from lalliance_study.scenarios import Scenario

#: Processes start slowly on a busy machine.
pytestmark = pytest.mark.timeout(300)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """The rows of the small study, carried out at once in this process."""
    out = tmp_path_factory.mktemp("whole")
    carry_out(out, here(1))
    return rows.read(out)


@pytest.fixture
def processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Processes]:
    ours = [str(Path(__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(ours))
    with Processes(tmp_path) as tree:
        yield tree


def test_rows_say_what_they_are(whole: pl.DataFrame) -> None:
    planned = numbered(SMALL.experiments)
    dear = whole.filter(pl.col("experiment") == "dear")
    assert dear.height == 24 * 6 * 3
    assert whole.height == dear.height + 6 * 3 * 1
    assert whole["seed"].unique().to_list() == [3]
    assert set(whole["scenario"]) == {one.number for one in planned}
    for one in planned:
        told = whole.filter(pl.col("scenario") == one.number).row(0, named=True)
        assert {name: told[name] for name in Scenario.model_fields} == one.scenario.model_dump()
    cheap = whole.filter(pl.col("experiment") == "cheap")
    for column in ("optimum", "bound", "proven", "shared_optimum", "ratio", "messages", "activations", "strategy"):
        assert cheap[column].null_count() == cheap.height
    assert not cheap["unfinished"].any()


def test_ratios_are_to_the_optimum_of_that_mission(whole: pl.DataFrame) -> None:
    dear = whole.filter(pl.col("experiment") == "dear")
    assert (dear["bound"] <= dear["optimum"]).all()
    assert dear["proven"].any()
    proven = dear.filter("proven")
    assert (proven["optimum"] - proven["bound"] <= 1e-4 * proven["optimum"]).all()
    told = dear.filter(pl.col("failures") == 0)
    assert (told["ratio"] > 1 - 1e-4).all()
    best = told.filter(pl.col("contender") == "optimum")
    assert best["makespan"].to_list() == pytest.approx(best["optimum"].to_list())
    assert dear["ratio"].to_list() == (dear["makespan"] / dear["optimum"]).to_list()
    # One mission has one optimum, whoever does it under whatever rules.
    assert dear.group_by("heterogeneity", "mission").agg(pl.col("optimum").n_unique())["optimum"].max() == 1
    shared = dear.group_by("hand_over").agg(pl.col("shared_optimum").null_count() == 0)
    assert dict(shared.rows()) == {"shared_max": True, "shared_add": True, "restart": False}
    assert (
        (dear.filter(pl.col("hand_over") != "restart").select(pl.col("shared_optimum") <= pl.col("optimum")))
        .to_series()
        .all()
    )


def test_deaths_cost_time_and_move_tasks(whole: pl.DataFrame) -> None:
    dear = whole.filter(pl.col("experiment") == "dear")
    assert dear.filter(pl.col("failures") == 0)["reallocations"].sum() == 0
    assert dear.filter(pl.col("failures") > 0)["reallocations"].sum() > 0
    means = dict(dear.group_by("failures").agg(pl.col("makespan").mean()).rows())
    assert means[0.3] > means[0.0]


def test_processes_give_the_same_rows(whole: pl.DataFrame, tmp_path: Path) -> None:
    came = carry_out(tmp_path, here(2))
    assert sum(came) == whole.height
    assert rows.read(tmp_path).equals(whole)
    assert carry_out(tmp_path, here(2)) == []


def test_a_run_that_is_killed_is_gone_on_with_and_gives_the_same_rows(
    whole: pl.DataFrame, tmp_path: Path, processes: Processes
) -> None:
    out = tmp_path / "out"
    for wanted in (1, 4):
        running = processes.start_module("support.small_study", out, "2")
        until(lambda wanted=wanted: len(rows.kept(out)) >= wanted)
        running.send_signal(signal.SIGKILL)
        running.wait()
        until(lambda: not processes.alive())
    kept = rows.kept(out)
    before = {part: rows.path_of(out, part).stat().st_mtime_ns for part in kept}
    left = len(open_study(out, SMALL, seed=3).left)
    assert left > 0, "it was killed too late to show anything"
    assert len(carry_out(out, here(1))) == left
    assert rows.read(out).equals(whole)
    assert {part: rows.path_of(out, part).stat().st_mtime_ns for part in kept} == before


def test_a_part_that_was_being_written_is_no_part(whole: pl.DataFrame, tmp_path: Path) -> None:
    study = open_study(tmp_path, SMALL, seed=3)
    rows.path_of(tmp_path, study.left[0].name).with_suffix(".unfinished").write_bytes(b"PAR1")
    assert open_study(tmp_path, SMALL, seed=3).left == study.left
    assert rows.read(tmp_path).is_empty()


@pytest.fixture
def scheduler(tmp_path: Path, processes: Processes) -> "tuple[subprocess.Popen[str], Path]":
    """A Dask scheduler on this machine, and the file that says where it is."""
    file = tmp_path / "scheduler.json"
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file)
    process = processes.start_module("distributed.cli.dask_scheduler", *words)
    until(lambda: file.exists() and file.read_text().endswith("}"))
    return process, file


def add_workers(processes: Processes, file: Path) -> str:
    """Two of them; the scheduler's address."""
    for _ in range(2):
        words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--scheduler-file", file)
        processes.start_module("distributed.cli.dask_worker", *words)
    address: str = json.loads(file.read_text())["address"]
    return address


def test_a_scheduler_with_two_workers_gives_the_same_rows(
    whole: pl.DataFrame, tmp_path: Path, processes: Processes, scheduler: "tuple[subprocess.Popen[str], Path]"
) -> None:
    out = tmp_path / "out"
    came = carry_out(out, cluster.at_workers_of(add_workers(processes, scheduler[1])))
    assert sum(came) == whole.height
    assert rows.read(out).equals(whole)


def test_a_run_whose_scheduler_is_lost_is_gone_on_with(
    whole: pl.DataFrame, tmp_path: Path, processes: Processes, scheduler: "tuple[subprocess.Popen[str], Path]"
) -> None:
    out, (process, file) = tmp_path / "out", scheduler
    hand_out = cluster.at_workers_of(add_workers(processes, file))

    def lose(_: int) -> None:
        process.kill()

    with pytest.raises(LallianceError, match="is lost; the same command goes on with what is left"):
        run(open_study(out, SMALL, seed=3), hand_out, lose)
    assert 0 < len(rows.kept(out)) < 25
    carry_out(out, here(1))
    assert rows.read(out).equals(whole)


def test_a_scheduler_without_workers_is_told_of(
    scheduler: "tuple[subprocess.Popen[str], Path]", monkeypatch: pytest.MonkeyPatch
) -> None:
    address = json.loads(scheduler[1].read_text())["address"]
    monkeypatch.setattr(cluster, "PATIENCE", 2.0)
    with pytest.raises(UserError, match=f"--scheduler {address}: it has no workers; expected at least one dask worker"):
        cluster.at_workers_of(address)


def test_a_scheduler_that_does_not_answer_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(
        UserError, match=r"--scheduler tcp://127.0.0.1:1: it does not answer; expected a Dask scheduler"
    ):
        cluster.at_workers_of("tcp://127.0.0.1:1")
    with pytest.raises(UserError, match=r"--scheduler nonsense://x: .*expected a Dask scheduler"):
        cluster.at_workers_of("nonsense://x")
