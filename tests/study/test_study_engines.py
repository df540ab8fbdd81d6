"""The kernel and the exact simulator tell the same of a contender, and a part may be cut anywhere."""

import numpy as np
import polars as pl
import pytest

from lalliance_agents.model.parameters import Erratum, Ordering, Strategy
from lalliance_study.experiments import engines
from lalliance_study.experiments.contenders import DEFAULT, Contender, alliance, by_hand
from lalliance_study.experiments.plan import Experiment, Grid, parts
from lalliance_study.experiments.presets import DYING, PLAIN, STUCK
from lalliance_study.experiments.work import carry_out
from lalliance_study.scenarios import Scenario, draw_missions

#: The first test to need the kernel waits until it is compiled.
pytestmark = pytest.mark.timeout(600)

CONTENDERS = (
    DEFAULT,
    alliance(Strategy.III, Ordering.MODIFIED_RANDOM),
    alliance(Strategy.II, Ordering.DERIVED, "literal 4", readings={Erratum.IDLE_HEARTBEAT: "literal"}),
    by_hand(),
)


@pytest.mark.parametrize("befalls", [PLAIN, DYING, STUCK, {"samples": 0, "training": 2}])
@pytest.mark.parametrize("contender", CONTENDERS, ids=lambda one: one.name)
def test_both_engines_tell_the_same(contender: Contender, befalls: dict[str, float]) -> None:
    scenario = Scenario.model_validate(
        {"robots": 4, "tasks": 6, "coverage": 3, "heterogeneity": 200.0, "cap": 0.5, **befalls}
    )
    missions = draw_missions(scenario, 3, seed=2)
    assert contender.parameters is not None
    fast = engines.of_minds(scenario, contender.parameters, missions)
    exact = engines.by_the_simulator(scenario, contender.parameters, missions)
    assert fast.makespan == pytest.approx(exact.makespan, abs=1e-9, nan_ok=True)
    assert np.array_equal(fast.reallocations, exact.reallocations)
    assert np.array_equal(fast.activations, exact.activations)
    assert (fast.messages > 0).all()
    assert np.isnan(exact.messages).all()


def test_what_the_kernel_cannot_run_runs_in_the_simulator() -> None:
    """A team larger than the kernel's memory."""
    scenario = Scenario(robots=24, tasks=24, coverage=2)
    missions = draw_missions(scenario, 1)
    assert np.isfinite(engines.of_minds(scenario, DEFAULT.parameters, missions).makespan).all()  # type: ignore[arg-type]


def test_rows_do_not_depend_on_how_missions_are_cut_into_parts() -> None:
    def rows_of(part: int) -> pl.DataFrame:
        grid = Grid(((4, 6, 2),), (100.0,), circumstances=(DYING, STUCK))
        experiment = Experiment("cut", "Where?", (grid,), (DEFAULT,), part=part)
        return pl.concat(carry_out(one) for one in parts([experiment], 7, seed=5)).sort("scenario", "mission")

    whole = rows_of(7)
    assert whole.height == 7 * 6
    assert whole["makespan"].null_count() < whole.height
    assert rows_of(3).equals(whole)
