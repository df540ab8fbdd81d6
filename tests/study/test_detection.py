"""Failure detection: the law against counting by hand and against the simulator, and figures and tables from rows."""

import dataclasses
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from lalliance_agents.errors import UserError
from lalliance_study.detection import plan, tables
from lalliance_study.detection.cost import cost, doubled
from lalliance_study.detection.law import (
    Loss,
    Timing,
    detected_within,
    detection_quantile,
    dispersion,
    needed_windows,
    suspicions,
)
from lalliance_study.detection.probe import RATE, SPEAKER, count_suspicions, hearer, probe, quantiles, time_detections
from lalliance_study.detection.reactions import FAULTS, reaction
from lalliance_study.detection.rows import Cost, Detections, Reaction, Suspicions, load, save
from lalliance_study.logbook import Line
from lalliance_study.simulator import Simulator

DOCS = Path(__file__).parents[2] / "docs"
ROWS = DOCS / "faults" / "rows"


@pytest.mark.parametrize(
    ("tau_rho", "counts"),
    [(2.01, [(2, 1.0)]), (3.0, [(3, 1.0)]), (3.5, [(3, 1.0)]), (3.75, [(3, 0.5), (4, 0.5)]), (4.0, [(4, 1.0)])],
)
def test_how_many_messages_must_be_lost(tau_rho: float, counts: list[tuple[int, float]]) -> None:
    """Only whole periods count, and the hearer's control period adds up to half of one."""
    found = Timing(tau_rho / 5.0).counts()
    assert [count for count, _ in found] == [count for count, _ in counts]
    assert [share for _, share in found] == pytest.approx([share for _, share in counts])


@pytest.mark.parametrize("loss", [Loss(0.3), Loss(0.3, 4.0), Loss(0.7, 5.0)])
def test_the_chance_of_a_row_of_losses_is_that_of_the_chain(loss: Loss) -> None:
    """Summed over all ways of the chain of a link rule, good or bad at each message, all lost when bad."""
    rule = loss.rule()
    if isinstance(rule, float):
        enter, leave = rule, 1 - rule
    else:
        enter, leave = rule["enter"], rule["leave"]
    ends = {(False, True): enter, (False, False): 1 - enter, (True, False): leave, (True, True): 1 - leave}

    def chance(way: tuple[bool, ...]) -> float:
        first = enter / (enter + leave)
        steps = math.prod(ends[pair] for pair in itertools.pairwise(way))
        return (first if way[0] else 1 - first) * steps

    for count in range(1, 6):
        ways = itertools.product((False, True), repeat=count + 2)
        summed = sum(chance(way) for way in ways if all(way[1 : count + 1]))
        assert loss.all_lost(count) == pytest.approx(summed)


def test_the_law_in_numbers() -> None:
    assert suspicions(Loss(0.3), Timing(0.6)) == pytest.approx(5 * 0.3**3 * 0.7)
    assert suspicions(Loss(0.3, 5.0), Timing(0.6)) == pytest.approx(5 * 0.3 / 5 * 0.8**2)
    assert detection_quantile(0.5, Loss(0.0), Timing(1.0)) == pytest.approx(0.951, abs=1e-3)
    assert detected_within(0.0, Loss(0.5), Timing(0.6)) == pytest.approx(0.5**3 * (0.75 + 0.25 * 0.5), rel=0.02)
    assert detected_within(0.701, Loss(0.5), Timing(0.6)) == pytest.approx(1.0)
    assert needed_windows(Loss(0.1), 5.0, 10.0) == 4


@pytest.mark.parametrize("loss", [Loss(0.5), Loss(0.3, 4.0)], ids=lambda loss: loss.kind)
def test_suspicions_scatter_as_much_as_the_law_says(loss: Loss) -> None:
    """Counted in many long rows of messages, drawn side by side."""
    chance, rows, length, count = np.random.default_rng(1), 4000, 500, 2
    rule = loss.rule()
    enter, stay = (rule, rule) if isinstance(rule, float) else (rule["enter"], 1 - rule["leave"])
    lost = [chance.random(rows) < loss.share]
    for _ in range(length):
        lost.append(chance.random(rows) < np.where(lost[-1], stay, enter))
    found = sum((~lost[at] & lost[at + 1] & lost[at + 2]).astype(int) for at in range(length - 1))
    assert np.var(found) / np.mean(found) == pytest.approx(dispersion(loss, Timing(count / 5.0)), rel=0.1)


@pytest.mark.parametrize("loss", [Loss(0.5), Loss(0.3, 5.0)], ids=lambda loss: loss.kind)
def test_false_suspicions_are_as_many_as_the_law_says(loss: Loss) -> None:
    tau_rhos = (2.01, 3.0, 4.0)
    counts, seconds = count_suspicions(tau_rhos, loss, 0.0, 600.0, seed=3)
    for tau_rho, count in zip(tau_rhos, counts, strict=True):
        expected = suspicions(loss, Timing(tau_rho / RATE)) * seconds
        assert expected > 30
        assert abs(2 * (math.sqrt(count) - math.sqrt(expected))) < 3


def test_suspicions_are_the_same_if_every_step_is_made() -> None:
    mission = probe((2.01, 4.0), Loss(0.5), lasts=60.0, seed=5)
    found = []
    for every_step in (False, True):
        simulator = Simulator(mission, every_step=every_step)
        simulator.run()
        heard = [simulator.members[hearer(number)].mind.hearing.presences[SPEAKER] for number in (0, 1)]
        found.append([(one.lapses, one.lapsed_at) for one in heard])
    assert found[0] == found[1]
    assert found[0][0][0] > found[0][1][0] > 0


def test_a_death_is_noticed_when_the_law_says() -> None:
    tau_rhos = (3.0, 5.0)
    loss = Loss(0.5)
    for tau_rho, times in zip(tau_rhos, time_detections(tau_rhos, loss, range(60)), strict=True):
        timing = Timing(tau_rho / RATE)
        assert max(times) <= timing.tau + timing.control + timing.delay
        seen = quantiles(times)
        assert seen["low"] <= detection_quantile(0.5, loss, timing) <= seen["high"]


def test_loss_brings_takeovers_that_nobody_needs() -> None:
    quiet, lossy = cost(1, 0.0, 2.01, crash=False), cost(1, 0.7, 2.01, crash=False)
    assert (quiet.needless, quiet.needed) == (0, 0)
    assert quiet.doubled < 0.01
    assert lossy.needless > 0
    assert lossy.doubled > 0.01
    assert cost(1, 0.0, 5.0, crash=True).needed == 1


def test_doubled_work_is_what_a_second_robot_does_on_a_task() -> None:
    log = [
        Line(1.0, "a", "activate", "x", "free", None),
        Line(3.0, "b", "activate", "x", "silence", "a"),
        Line(4.0, "a", "yield", "x", "contender", "b"),
        Line(5.0, "a", "activate", "y", "free", None),
        Line(7.0, "b", "complete", "x", "x completed by b", None),
        Line(7.1, "b", "complete", "x", "sensed", None),
        Line(8.0, "a", "gone", None, "a is gone", None),
    ]
    # a on x for 3 s, b on x for 4 s, a on y for 3 s; of these 10 s, 1 s is double.
    assert doubled(log, 9.0) == pytest.approx(0.1)


def test_a_crash_is_noticed_by_a_teammate_and_a_stuck_robot_makes_one_impatient() -> None:
    crash, stuck = reaction(1, "crash"), reaction(1, "stuck")
    assert crash.silent < 1.2
    assert (crash.who, crash.what) == ("teammate", "activate: silence")
    assert math.isnan(stuck.silent)
    assert (stuck.who, stuck.what) == ("teammate", "activate: impatience")


def test_every_part_has_its_seed_from_the_one_seed() -> None:
    assert plan.parts(plan.QUICK, 1) == plan.parts(plan.QUICK, 1)
    assert plan.parts(plan.QUICK, 1) != plan.parts(plan.QUICK, 2)


def test_rows_outlive_their_file(tmp_path: Path) -> None:
    rows = [Suspicions("simulated", 0.3, 0.0, 0.0, 3.0, 2, 400.0, 38)]
    save(tmp_path / "rows.csv", rows, Suspicions)
    assert load(tmp_path / "rows.csv", Suspicions) == rows
    assert load(tmp_path / "none.csv", Suspicions) == []


def small_rows(folder: Path) -> None:
    """Rows as a run writes them, made up."""
    suspected = [
        Suspicions("simulated", loss, burst, 0.0, tau_rho, 2, 1000.0, 40)
        for burst in (0.0, 5.0)
        for loss in (0.3, 0.5, 0.6)
        for tau_rho in (2.01, 3.0)
    ]
    suspected += [Suspicions("simulated", 0.5, 0.0, jitter, 2.5, 2, 1000.0, 40) for jitter in (0.0, 0.1)]
    save(folder / "suspicions.csv", suspected, Suspicions)
    timed = [
        Detections("simulated", loss, burst, tau_rho, 10, 0, 0.3, 0.4, 0.5, 0.6, 0.35, 0.45)
        for burst in (0.0, 5.0)
        for loss in (0.3, 0.6)
        for tau_rho in (2.01, 3.0)
    ]
    save(folder / "detections.csv", timed, Detections)
    costs = [
        Cost(seed, crash, loss, 5.0, 60.0 + seed + crash, 0, crash, 0.01)
        for seed in (1, 2)
        for crash in (0, 1)
        for loss in (0.0, 0.5)
    ]
    save(folder / "costs.csv", costs, Cost)
    save(folder / "reactions.csv", [Reaction("crash", 1, 1.0, 1.1, "teammate", "activate: silence", 2.0)], Reaction)


def test_rows_of_one_kind_are_renewed_beside_others_of_the_same_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small_rows(tmp_path)
    (tmp_path / "manifest.json").write_text('{"seed": 1, "quick": true, "parts": 4294}')
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(plan, "QUICK", dataclasses.replace(plan.QUICK, scenes=1))
    with pytest.raises(UserError, match="have seed 1; expected 2 for those beside them"):
        plan.run(tmp_path, quick=True, seed=2, jobs=1, only="react")
    done = plan.run(tmp_path, quick=True, seed=1, jobs=1, only="react")
    after = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert {name for name, rows in after.items() if rows != before[name]} == {"reactions.csv", "manifest.json"}
    assert done["parts"] == len(load(tmp_path / "reactions.csv", Reaction)) == len(FAULTS)


def test_figures_are_drawn_from_rows_and_from_nothing_else(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from lalliance_study.detection import figures  # noqa: PLC0415 - needs the extra `study`

    small_rows(tmp_path)
    before = {path.name: path.read_bytes() for path in figures.draw(tmp_path, tmp_path / "before", ["svg"])}
    assert sorted(before) == [
        f"{name}.svg" for name in ("detection-time", "false-suspicions", "mission-cost", "stairs")
    ]
    rows = load(tmp_path / "costs.csv", Cost)
    save(tmp_path / "costs.csv", [row._replace(doubled=row.doubled * (1 + row.loss)) for row in rows], Cost)
    after = {path.name: path.read_bytes() for path in figures.draw(tmp_path, tmp_path / "after", ["svg"])}
    assert {name for name, image in after.items() if image != before[name]} == {"mission-cost.svg"}


def test_the_page_says_what_the_rows_say() -> None:
    page = (DOCS / "failure-detection.md").read_text()
    assert all(f"<!-- {name} -->\n" in page for name in tables.PARTS)
    assert tables.renewed(page, ROWS) == page
