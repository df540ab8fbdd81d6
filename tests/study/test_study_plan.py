"""Which missions a study consists of, and which folders it takes for its own."""

import json
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from support.small_study import SMALL

from lalliance_agents.errors import UserError
from lalliance_agents.model.parameters import Erratum
from lalliance_study.experiments import rows
from lalliance_study.experiments.manifest import FILE, Manifest
from lalliance_study.experiments.plan import Team, numbered, parts
from lalliance_study.experiments.presets import PRESETS, preset
from lalliance_study.experiments.runner import open_study
from lalliance_study.experiments.yardsticks import times_of
from lalliance_study.scenarios import Scenario, draw_missions

presets = pytest.mark.parametrize("name", PRESETS)
EXPERIMENTS = [
    "strategies",
    "orderings",
    "optimum",
    "growth",
    "beyond",
    "rivals",
    "knowledge",
    "ablation",
    "sensitivity",
]


@presets
def test_each_preset_has_every_experiment(name: str) -> None:
    assert [one.name for one in preset(name).experiments] == EXPERIMENTS


@presets
def test_every_mission_of_every_scenario_is_in_exactly_one_part(name: str) -> None:
    chosen = preset(name)
    wanted = defaultdict(list)
    for part in parts(chosen.experiments, 7, seed=0):
        for one in part.scenarios:
            wanted[one.number] += range(part.first, part.last)
    missions = {one.name: one.missions(7) for one in chosen.experiments}
    planned = numbered(chosen.experiments)
    assert [one.number for one in planned] == list(range(len(planned)))
    assert wanted == {one.number: list(range(missions[one.experiment])) for one in planned}
    names = [part.name for part in parts(chosen.experiments, 7, seed=0)]
    assert len(set(names)) == len(names)


@presets
def test_scenarios_have_the_same_missions_if_and_only_if_they_have_the_same_team(name: str) -> None:
    planned = numbered(preset(name).experiments)
    assert len({one.draws for one in planned}) == len({Team.of(one.scenario) for one in planned})


@presets
def test_contenders_have_names_of_their_own(name: str) -> None:
    for experiment in preset(name).experiments:
        names = [one.name for one in experiment.contenders]
        assert len(set(names)) == len(names)


def test_the_optima_are_asked_for_in_more_than_the_papers_496_scenarios() -> None:
    experiment = next(one for one in preset("paper").experiments if one.name == "optimum")
    assert len({Team.of(scenario) for scenario in experiment.scenarios()}) > 496


def test_the_ablation_reads_every_erratum_the_other_way_but_that_without_a_formula() -> None:
    experiment = next(one for one in preset("mini").experiments if one.name == "ablation")
    read = {erratum for one in experiment.contenders if one.parameters for erratum in one.parameters.readings}
    assert read == set(Erratum) - {Erratum.STRATEGY_ONE}


def test_whatever_befalls_a_team_its_times_are_the_same() -> None:
    team = {"robots": 5, "tasks": 8, "coverage": 3, "heterogeneity": 400.0}
    plain = Scenario.model_validate(team)
    worse = Scenario.model_validate({**team, "failures": 0.5, "traps": 0.3, "noise": 0.2, "hand_over": "restart"})
    drawn = [draw_missions(one, 5, seed=4, number=Team.of(one).draws) for one in (plain, worse)]
    assert np.array_equal(*(times_of(missions, 5) for missions in drawn))
    assert not np.array_equal(drawn[0].life, drawn[1].life)
    times = times_of(drawn[0], 5)
    assert np.isfinite(times).sum(axis=1).tolist() == [[3] * 8] * 5
    assert times[2, drawn[0].able[2, 4, 1], 4] == drawn[0].own[2, 4, 1]


def test_a_coverage_above_the_team_is_refused() -> None:
    with pytest.raises(ValidationError, match="coverage 5 is more than the team has, which is 4 robots"):
        Scenario(robots=4, tasks=3, coverage=5)


def test_there_is_no_other_preset_or_experiment(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no preset 'huge'; expected one of mini, paper, full"):
        preset("huge")
    with pytest.raises(UserError, match="no experiment 'dull' in preset small; expected one of dear, cheap"):
        open_study(tmp_path / "out", SMALL, only=["dull"])
    assert list(tmp_path.iterdir()) == []


def test_a_study_that_is_there_is_gone_on_with_only_if_it_is_the_same(tmp_path: Path) -> None:
    begun = open_study(tmp_path, SMALL, seed=3)
    before = (tmp_path / FILE).read_bytes()
    assert open_study(tmp_path, SMALL, seed=3) == begun
    assert {part.experiment.name for part in open_study(tmp_path, SMALL, seed=3, only=["cheap"]).left} == {"cheap"}
    with pytest.raises(
        UserError, match="holds rows of seed 3, not 4; expected those of this study, or an empty folder"
    ):
        open_study(tmp_path, SMALL, seed=4)
    with pytest.raises(UserError, match="holds rows of missions 24, not 5"):
        open_study(tmp_path, SMALL, seed=3, missions=5)
    with pytest.raises(UserError, match="holds rows of preset small, not mini"):
        open_study(tmp_path, preset("mini"), seed=3)
    assert (tmp_path / FILE).read_bytes() == before


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("lalliance", "0.0.1", "holds rows of lalliance 0.0.1, not "),
        ("format", 0, "MANIFEST.json: format 0 of lalliance .*; expected format 1"),
        ("packages", {"numba": "0.1"}, "holds rows of numba 0.1, not "),
        ("scenarios", [], "holds rows of other experiments than preset small has now"),
        ("machine", None, "machine: Input should be an object; expected what lalliance study run writes"),
        ("colour", "red", "colour: Extra inputs are not permitted"),
    ],
)
def test_rows_of_another_version_are_left_alone(tmp_path: Path, field: str, value: object, says: str) -> None:
    open_study(tmp_path, SMALL)
    path = tmp_path / FILE
    path.write_text(json.dumps({**json.loads(path.read_text()), field: value}))
    before = path.read_bytes()
    with pytest.raises(UserError, match=says):
        open_study(tmp_path, SMALL)
    assert path.read_bytes() == before


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / rows.FOLDER).mkdir()
    (tmp_path / rows.FOLDER / "mine.parquet").write_text("precious")
    with pytest.raises(UserError, match=r"mine.parquet belongs to no study, as there is no MANIFEST.json"):
        open_study(tmp_path, SMALL)
    (tmp_path / "file").write_text("precious")
    with pytest.raises(UserError, match="file: Not a directory; expected a folder, or where to make one"):
        open_study(tmp_path / "file", SMALL)
    assert not (tmp_path / FILE).exists()


def test_rows_are_read_from_studies_only(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"MANIFEST.json: No such file or directory; expected the folder of a study"):
        rows.read(tmp_path)
    open_study(tmp_path, SMALL)
    assert rows.read(tmp_path).is_empty()
    assert set(rows.SCHEMA) | set(Scenario.model_fields) == set(rows.read(tmp_path).columns)
    rows.path_of(tmp_path, "cheap-00012-00000").write_text("no Parquet")
    with pytest.raises(UserError, match="rows that cannot be read"):
        rows.read(tmp_path)
    assert rows.read(tmp_path, ["dear"]).is_empty()
    assert Manifest.read(tmp_path).preset == "small"
