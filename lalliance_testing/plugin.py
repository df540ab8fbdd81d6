"""What pytest calls: options, the marker, the fixture, and the judgement of missions after a test's own code.

Every run of pytest where this package is installed imports this module, so all that is heavy is imported by the fixture.
"""

import os
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from lalliance_testing.asking import CHOICES, Asked, engines, seed_option, speed_option

if TYPE_CHECKING:
    from lalliance_testing.launch import Launch

_LAUNCH = pytest.StashKey["Launch"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what may be asked of all missions on the command line."""
    group = parser.getgroup("lalliance", "missions of robot teams under faults")
    group.addoption(
        "--lalliance-engine",
        choices=CHOICES,
        help="run missions as real processes, simulated, or both; tests that can only run otherwise are skipped "
        "(default: what the test asks, else real)",
    )
    group.addoption(
        "--lalliance-speed",
        type=speed_option,
        metavar="X",
        help="mission seconds per real second of all missions of real processes (default: what the test asks, else 1)",
    )
    group.addoption(
        "--lalliance-seed", type=seed_option, metavar="N", help="the seed of all missions (default: each mission's own)"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker."""
    config.addinivalue_line(
        "markers",
        "lalliance(engine='real', speed=1.0): what the missions of a test run on, 'real', 'simulated' or 'both', "
        "and how many mission seconds pass in a real one.",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test once on each engine that it asks for and the command line allows."""
    if "lalliance_engine" not in metafunc.fixturenames:
        return
    try:
        asked = _asked(metafunc.definition).engine
    except ValueError as error:
        raise pytest.Collector.CollectError(f"{metafunc.definition.nodeid}: marker lalliance: {error}") from None
    option = metafunc.config.getoption("--lalliance-engine")
    skipped = pytest.mark.skip(reason=f"its missions are {asked}, and --lalliance-engine is {option}")
    metafunc.parametrize("lalliance_engine", engines(asked, option) or [pytest.param(asked, marks=skipped)])


def _asked(item: pytest.Item) -> Asked:
    marker = item.get_closest_marker("lalliance")
    return Asked.of((), {}) if marker is None else Asked.of(marker.args, marker.kwargs)


@pytest.fixture
def lalliance_engine(request: pytest.FixtureRequest) -> str:
    """What moves the missions of this test: `real` or `simulated`."""
    option: str | None = request.config.getoption("--lalliance-engine")
    return "real" if option in {None, "both"} else str(option)


@pytest.fixture
def lalliance_mission(
    request: pytest.FixtureRequest, lalliance_engine: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator["Launch"]:
    """Starts missions, from a mission file or its text; see `lalliance_testing.launch.Launch`."""
    from lalliance_testing.launch import Launch, Settings

    # Robots find the behaviour sets that the test itself could import.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path))
    config = request.config
    settings = Settings(
        engine=lalliance_engine,
        asked_speed=_asked(request.node).speed,
        speed=config.getoption("--lalliance-speed"),
        seed=config.getoption("--lalliance-seed"),
        folder=tmp_path,
        beside=request.path.parent,
    )
    launch = request.node.stash[_LAUNCH] = Launch(settings)
    try:
        yield launch
    finally:
        launch.close()


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    """Judge, after a test that has passed so far, the missions that it did not finish."""
    result = yield
    launch = pyfuncitem.stash.get(_LAUNCH, None)
    wrong = None if launch is None else launch.settle()
    if wrong is not None:
        pytest.fail(wrong, pytrace=False)
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Have a failed test tell of its missions: what happened last, and how to repeat it."""
    report = yield
    launch = item.stash.get(_LAUNCH, None)
    if launch is not None and report.failed:
        # The file of a node's id is relative to the root of the tests, which need not be where pytest was called.
        file = os.path.relpath(item.path, item.config.invocation_params.dir)
        report.sections.extend(launch.stories("".join([file, *item.nodeid.partition("::")[1:]])))
    return report
