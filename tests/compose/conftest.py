"""The real image, in a docker daemon that `with_docker.sh` has started."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from deployment import ROOT, Deployment, docker

#: As whom the containers run: the keys are theirs.
USER = 10001


@pytest.fixture(scope="session")
def image() -> str:
    """The image, built from the working tree."""
    words = ["buildx", "build", "--load", "--quiet", "-t", "lalliance", "-f", str(ROOT / "deploy/Dockerfile")]
    words += [
        "--build-arg",
        f"BASE_IMAGE={os.environ['BASE_IMAGE']}",
        "--secret",
        f"id=ca,src={os.environ['BUILD_CA']}",
    ]
    docker(*words, str(ROOT), timeout=600)
    return "lalliance"


@pytest.fixture(scope="session")
def lalliance() -> Callable[..., str]:
    """Runs a command of the tool, which must succeed; what it printed."""

    def run(*words: str | Path) -> str:
        command = [sys.executable, "-m", "mission_control", *map(str, words)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture
def deployed(
    image: str, lalliance: Callable[..., str], tmp_path: Path, request: pytest.FixtureRequest
) -> Iterator[Callable[[Path, Path | None], Deployment]]:
    """A deployment of a mission with new keys, from a compose file or, without one, from the one that is generated."""
    opened: list[Deployment] = []

    def deploy(mission: Path, file: Path | None = None) -> Deployment:
        keys = tmp_path / "keys"
        lalliance("keys", "init", mission, "--keys", keys)
        for path in [keys, *keys.rglob("*")]:
            shutil.chown(path, USER, USER)
        if file is None:
            file = tmp_path / "compose.yaml"
            file.write_text(lalliance("deploy", "compose", mission, "--folder", tmp_path))
        opened.append(Deployment(file, keys))
        return opened[-1]

    failed = request.session.testsfailed
    try:
        yield deploy
    finally:
        for deployment in opened:
            if request.session.testsfailed > failed:
                sys.stderr.write(deployment.state())
            deployment.take_away()


@pytest.fixture(autouse=True, scope="session")
def nothing_is_left() -> Iterator[None]:
    """After all tests there is no container, network or volume that was not there before."""
    before = present()
    yield
    assert present() == before


def present() -> dict[str, list[str]]:
    return {
        "containers": docker("ps", "--all", "--quiet").split(),
        "networks": sorted(docker("network", "ls", "--quiet").split()),
        "volumes": sorted(docker("volume", "ls", "--quiet").split()),
    }
