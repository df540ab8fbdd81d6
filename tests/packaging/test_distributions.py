"""The wheel and the sources that a release consists of, in environments where nothing else is installed."""

import os
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml
from support.documents import blocks

REPOSITORY = Path(__file__).parents[2]
CONSTRAINTS = REPOSITORY / "constraints.txt"
#: Work for the missions of the repository only, which no release is for.
NOT_RELEASED = (".ci/", ".gitignore")

#: extra -> what a user of it does first, in the order in which it works
USES = {
    "record": [["run", "two-rooms.yaml", "--speed", "4", "--record", "bag.mcap"], ["bag", "info", "bag.mcap"]],
    "deploy": [["keys", "init", "two-rooms.yaml"]],
    "dashboard": [["run", "two-rooms.yaml", "--speed", "4", "--dashboard"]],
    "study": [["study", "report", "rows"]],
    "cluster": [
        ["study", "run", "--preset", "mini", "--out", "rows", "--backend", "dask", "--scheduler", "tcp://127.0.0.1:9"]
    ],
}

Environment = Callable[..., Path]


def run(*command: str | Path, cwd: Path, status: int = 0) -> str:
    """What a command prints, on either stream; it ends with the status."""
    done = subprocess.run(command, check=False, cwd=cwd, capture_output=True, text=True, timeout=100, env=outside(cwd))
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def outside(home: Path) -> dict[str, str]:
    """The environment of someone who has never seen this repository."""
    kept = {
        name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "LALLIANCE", "VIRTUAL"))
    }
    return kept | {"XDG_RUNTIME_DIR": str(home), "MPLCONFIGDIR": str(home)}


def uv(*arguments: str | Path) -> None:
    run(sys.executable, "-m", "uv", "--quiet", *arguments, cwd=REPOSITORY)


@pytest.fixture(scope="module")
def release(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sources, and the wheel that was built from them."""
    folder = tmp_path_factory.mktemp("release")
    uv("build", "--out-dir", folder, REPOSITORY)
    return folder


@pytest.fixture(scope="module")
def environment(release: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    """Makes an environment with the wheel and some extras; where its programs are."""
    [wheel] = release.glob("*.whl")

    def made(*extras: str, beside: tuple[str, ...] = ()) -> Path:
        place = tmp_path_factory.mktemp("environment")
        uv("venv", "--python", sys.executable, place)
        wanted = f"lalliance[{','.join(extras)}] @ {wheel.as_uri()}"
        uv("pip", "install", "--python", place, "--constraint", CONSTRAINTS, wanted, *beside)
        uv("pip", "check", "--python", place)
        return place / "bin"

    return made


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A folder outside the repository with a mission file."""
    [mission] = blocks("README.md", "yaml")
    plain = yaml.safe_load(mission)
    del plain["robots"]["all-rounder"]["behaviors"]
    (tmp_path / "two-rooms.yaml").write_text(yaml.safe_dump(plain))
    return tmp_path


def tracked() -> set[str]:
    """The files of the repository."""
    listed = subprocess.run(["git", "ls-files"], cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout
    return {name for name in listed.splitlines() if (REPOSITORY / name).exists()}


def test_the_sources_are_the_repository_and_the_wheel_its_packages(release: Path) -> None:
    [sources] = release.glob("*.tar.gz")
    with tarfile.open(sources) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert {name for name in tracked() - held if not name.startswith(NOT_RELEASED)} == set()
    [wheel] = release.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:
        names = set(packed.namelist())
    installed = {name for name in names if ".dist-info/" not in name}
    packages = {name.partition("/")[0] for name in installed}
    assert packages == {"lalliance_agents", "lalliance_study", "lalliance_testing", "mission_control", "world_server"}
    assert {name for name in tracked() if name.partition("/")[0] in packages} == installed
    assert {f"{package}/py.typed" for package in packages} <= installed
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)


def test_the_wheel_alone_checks_simulates_and_runs_a_mission_from_elsewhere(
    environment: Environment, home: Path
) -> None:
    lalliance = environment() / "lalliance"
    assert run(lalliance, "--version", cwd=home) == f"lalliance {version('lalliance')}\n"
    assert "two-rooms.yaml is a good mission" in run(lalliance, "check", "two-rooms.yaml", cwd=home)
    assert "Mission two-rooms complete" in run(lalliance, "simulate", "two-rooms.yaml", cwd=home)
    assert "Mission two-rooms complete" in run(lalliance, "run", "two-rooms.yaml", "--speed", "4", cwd=home)
    for extra, uses in USES.items():
        before = sorted(home.iterdir())
        said = run(lalliance, *uses[0], cwd=home, status=2)
        assert f"pip install 'lalliance[{'study' if extra == 'cluster' else extra}]'" in said
        assert len(said.splitlines()) == 1
        assert sorted(home.iterdir()) == before


@pytest.mark.parametrize("extra", ["record", "deploy", "dashboard"])
def test_an_extra_is_all_that_its_commands_need(environment: Environment, home: Path, extra: str) -> None:
    lalliance = environment(extra) / "lalliance"
    for use in USES[extra]:
        run(lalliance, *use, cwd=home)


def test_the_extra_of_the_study_is_all_that_a_study_on_one_machine_needs(environment: Environment, home: Path) -> None:
    lalliance = environment("study") / "lalliance"
    [used] = USES["study"]
    assert "expected the folder of a study" in run(lalliance, *used, cwd=home, status=2)
    (home / "free.yaml").write_text("{name: free, tasks: {mop: {}}, robots: {broom: {tasks: {mop: 6}}}}")
    assert "times the optimum of 6.0 s" in run(lalliance, "simulate", "free.yaml", cwd=home)
    [used] = USES["cluster"]
    assert "pip install 'lalliance[cluster]'" in run(lalliance, *used, cwd=home, status=2)
    assert "scheduler" in run(environment("cluster") / "lalliance", *used, cwd=home, status=2)


def test_the_pytest_plugin_needs_pytest_and_nothing_else(environment: Environment, home: Path) -> None:
    programs = environment(beside=("pytest",))
    (home / "test_mine.py").write_text(
        "def test_mine(lalliance_mission):\n"
        '    mission = lalliance_mission("two-rooms.yaml")\n'
        '    assert mission.finish()["complete"]\n'
    )
    assert "1 passed" in run(
        programs / "python", "-m", "pytest", "-q", "--lalliance-engine", "simulated", "test_mine.py", cwd=home
    )
