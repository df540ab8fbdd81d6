"""The kernel and the exact simulator make the same of every mission: the same decisions, at the same instants."""

import subprocess
import sys

import numpy as np
import pytest
from study.kernel_pairs import LITERAL, difference

from lalliance_agents.errors import UserError
from lalliance_agents.model.parameters import Parameters
from lalliance_study.kernel import RESULTS, run_in_threads, run_missions
from lalliance_study.kernel_state import rules_of
from lalliance_study.logbook import Timing
from lalliance_study.scenarios import Missions, Scenario, draw_missions, mission_of

#: The first test to need the kernel waits until it is compiled.
pytestmark = pytest.mark.timeout(600)

PLAIN = {"failures": 0, "traps": 0, "readings": {}, "architecture": "l-alliance"}


@pytest.mark.parametrize("seed", range(15))
def test_plain_missions_are_the_same(seed: int) -> None:
    assert difference(seed, **PLAIN) is None


@pytest.mark.parametrize("seed", range(15))
def test_missions_in_which_robots_die_are_the_same(seed: int) -> None:
    assert difference(seed, **{**PLAIN, "failures": 0.6}) is None


@pytest.mark.parametrize("seed", range(15))
def test_missions_in_which_bodies_get_stuck_are_the_same(seed: int) -> None:
    assert difference(seed, **{**PLAIN, "traps": 0.5}) is None


@pytest.mark.parametrize("seed", range(8))
def test_missions_after_active_learning_are_the_same(seed: int) -> None:
    assert difference(seed, missions=1, training=4, samples=0, heterogeneity=100.0) is None


@pytest.mark.parametrize("reading", LITERAL)
def test_missions_with_a_literal_reading_are_the_same(reading: str) -> None:
    """Among them some in which robots die, know nothing, or have one task each."""
    literal = {"readings": {reading: "literal"}}
    assert difference(1, **{**PLAIN, **literal}) is None
    assert (
        difference(2, **{"architecture": "l-alliance", "failures": 0.6, "samples": 0, "training": 1, **literal}) is None
    )
    assert difference(3, missions=1, robots=4, tasks=2, coverage=2, **literal) is None


@pytest.mark.parametrize("seed", range(50))
def test_missions_of_all_kinds_are_the_same(seed: int) -> None:
    """Of any number more, `python -m study.kernel_pairs` tells."""
    assert difference(1000 + seed) is None


def test_a_large_mission_is_the_same() -> None:
    assert difference(1, missions=1, robots=20, tasks=40, coverage=4, failures=0.3, traps=0.2) is None


def test_threads_and_the_missions_before_change_nothing() -> None:
    scenario = Scenario(robots=5, tasks=10, coverage=3, failures=0.3, traps=0.2, noise=0.1)
    missions = draw_missions(scenario, 300)
    rules = rules_of(mission_of(scenario, Parameters(), missions, 0)[0])
    results = run_missions(rules, missions)
    assert np.array_equal(results, run_in_threads(rules, missions, 2), equal_nan=True)
    backwards = run_missions(rules, Missions._make(part[::-1].copy() for part in missions))
    assert np.array_equal(results, backwards[::-1], equal_nan=True)
    assert np.isfinite(results[:, RESULTS.index("makespan")]).mean() > 0.9


def test_what_the_kernel_cannot_run_is_refused_with_a_reason() -> None:
    scenario = Scenario(robots=3, tasks=3, coverage=2)
    missions = draw_missions(scenario, 1)
    with pytest.raises(UserError, match="the kernel cannot run mission scenario: it is too large"):
        rules_of(mission_of(scenario, Parameters(trials=20), missions, 0)[0])
    with pytest.raises(UserError, match="half a control step"):
        rules_of(mission_of(scenario, Parameters(), missions, 0)[0], Timing(message_delay=0.06))


def test_no_function_is_compiled_more_than_once() -> None:
    """Each more would cost every process time, as no compiled code is kept."""
    test_threads_and_the_missions_before_change_nothing()
    times = {
        f"{name}.{function.__name__}": len(function.signatures)
        for name, module in sys.modules.items()
        if name.startswith("lalliance_study.kernel")
        for function in vars(module).values()
        if hasattr(function, "signatures")
    }
    assert len(times) > 50
    assert {name for name, count in times.items() if count > 1} == set()


def test_the_simulator_does_not_need_the_compiler() -> None:
    code = "import sys, lalliance_study.simulator, lalliance_study.scenarios; sys.exit('numba' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
