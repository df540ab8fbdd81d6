"""`lalliance study run`: what it prints, what it keeps, how it is ended, and what it refuses."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes, until

from lalliance_study.experiments import rows
from lalliance_study.experiments.manifest import FILE, Manifest
from lalliance_study.experiments.presets import preset
from lalliance_study.experiments.runner import open_study
from lalliance_study.report.sections import CLAIMS


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with Processes(tmp_path) as tree:
        yield tree


@pytest.mark.timeout(600)
def test_the_smallest_study_is_carried_out_once_and_reported(processes: Processes) -> None:
    """All experiments, on all cores: less than a minute on two that are free."""
    command = ("study", "run", "--preset", "mini", "--out", "out")
    done = processes.run(*command, timeout=500)
    assert (done.returncode, done.stdout) == (0, "12320 rows of study mini are in out\n"), done.stderr
    out = processes.folder / "out"
    found = rows.read(out)
    assert found.height == 12_320
    assert found.filter(experiment="optimum")["proven"].all()
    assert Manifest.read(out).missions == 4
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    again = processes.run(*command)
    assert (again.returncode, again.stdout, again.stderr) == (0, done.stdout, "")
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    told = processes.run("study", "report", "out", timeout=300)
    assert told.returncode == 0, told.stderr
    page = (out / "report" / "report.md").read_text()
    assert all(f"### {claim.title}\n" in page for claim in CLAIMS)
    drawn = set(re.findall(r"\]\(([\w-]+)\.png\)", page))
    assert drawn
    assert all((out / "report" / f"{name}{kind}").stat().st_size > 0 for name in drawn for kind in (".png", ".svg"))


@pytest.mark.alone
@pytest.mark.parametrize("told", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("processes_at_least", [2, 4])
def test_whoever_is_told_to_end_says_how_to_go_on(
    processes: Processes, told: signal.Signals, processes_at_least: int
) -> None:
    """Also while it is still starting processes."""
    running = processes.start("study", "run", "--preset", "paper", "--out", "out", "--jobs", "2")
    until(lambda: len(processes.alive()) >= processes_at_least)
    running.send_signal(told)
    began = time.monotonic()
    out, err = running.communicate(timeout=20)
    assert time.monotonic() - began < 2.0
    assert (running.returncode, out) == (128 + told, "")
    assert err == "lalliance: interrupted; the same command goes on with what is left\n"
    until(lambda: not processes.alive())
    assert (processes.folder / "out" / FILE).exists()


BAD = {
    "no such preset": (["--preset", "huge"], "no preset 'huge'; expected one of mini, paper, full"),
    "no such experiment": (["--only", "dull"], "no experiment 'dull' in preset mini; expected one of strategies, "),
    "a file instead of a folder": (["--out", "file"], "file: Not a directory; expected a folder"),
    "a folder below a file": (["--out", "file/below"], "file/below: Not a directory; expected a folder"),
    "no missions": (["--missions", "0"], "--missions"),
    "no jobs": (["--jobs", "0"], "--jobs"),
    "a negative seed": (["--seed", "-1"], "--seed"),
    "no such backend": (["--backend", "slurm"], "--backend"),
    "a scheduler without Dask": (["--scheduler", "tcp://127.0.0.1:1"], "expected both or neither"),
    "Dask without a scheduler": (["--backend", "dask"], "expected both or neither"),
    "jobs elsewhere": (
        ["--backend", "dask", "--scheduler", "tcp://127.0.0.1:1", "--jobs", "2"],
        "--jobs counts processes of this machine",
    ),
    "a scheduler that does not answer": (
        ["--backend", "dask", "--scheduler", "tcp://127.0.0.1:1"],
        "--scheduler tcp://127.0.0.1:1: it does not answer; expected a Dask scheduler",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_a_sentence(processes: Processes, case: str) -> None:
    (processes.folder / "file").write_text("precious\n")
    arguments, says = BAD[case]
    done = processes.run("study", "run", *_defaults(arguments), *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in processes.folder.iterdir()] == ["file"]
    assert (processes.folder / "file").read_text() == "precious\n"


def _defaults(arguments: list[str]) -> list[str]:
    defaults = {"--preset": "mini", "--out": "out"}
    return [word for option, value in defaults.items() if option not in arguments for word in (option, value)]


def test_another_study_in_the_folder_is_left_alone(processes: Processes) -> None:
    out = processes.folder / "out"
    open_study(out, preset("paper"), seed=1)
    before = (out / FILE).read_bytes()
    for arguments, says in (
        (["--preset", "mini", "--seed", "1"], "out holds rows of preset paper, not mini"),
        (["--preset", "paper"], "out holds rows of seed 1, not 0"),
        (["--preset", "paper", "--seed", "1", "--missions", "3"], "out holds rows of missions 200, not 3"),
    ):
        done = processes.run("study", "run", "--out", "out", *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert f"lalliance: {says}; expected those of this study, or an empty folder\n" == done.stderr
    assert (out / FILE).read_bytes() == before


@pytest.mark.skipif("os.geteuid() == 0", reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_to_is_refused(processes: Processes) -> None:
    (processes.folder / "closed").mkdir(mode=0o500)
    done = processes.run("study", "run", "--preset", "mini", "--out", "closed")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "lalliance: closed: Permission denied; expected a folder, or where to make one\n"


@pytest.mark.parametrize(
    ("package", "extra", "more"),
    [
        ("polars", "study", ()),
        ("ortools", "study", ()),
        ("distributed", "cluster", ("--backend", "dask", "--scheduler", "tcp://127.0.0.1:1")),
    ],
)
def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, package: str, extra: str, more: tuple[str, ...]
) -> None:
    words = ["lalliance", "study", "run", "--preset", "mini", "--out", "out", *more]
    code = f"import sys; sys.modules[{package!r}] = None; sys.argv = {words!r}; from mission_control.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"lalliance: this needs the package {package}, which is not installed; "
        f"expected the {extra} extra: pip install 'lalliance[{extra}]'\n"
    )
    assert list(tmp_path.iterdir()) == []
