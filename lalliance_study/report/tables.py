"""The page's tables of numbers, each from what one experiment measured."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from lalliance_study.markdown import table
from lalliance_study.report import statistics
from lalliance_study.report.beyond import (
    LEARNERS,
    PARAMETERS,
    RIVALS,
    against_default,
    against_exact,
    by_circumstances,
    readings,
    values_of,
)
from lalliance_study.report.claims import ratio_of
from lalliance_study.report.comparisons import Comparison
from lalliance_study.report.markdown import folded, number
from lalliance_study.report.optima import DERIVED, NEAR, log_mean, proven, size
from lalliance_study.report.results import Measured
from lalliance_study.report.statistics import Floats
from world_server.environments.task_pool import HAND_OVERS


def rivals(found: Sequence[Measured]) -> str:
    """Each rival against the default."""
    names = {told: name for name, told in RIVALS.items() if name in found[0].times}
    return _by_rule(found, names, against_default, "relative to II derived")


def knowledge(found: Sequence[Measured]) -> str:
    """Each learner against itself with exact knowledge."""
    names = {told: name for name, told in LEARNERS.items() if name in found[0].times}
    return folded(
        "In numbers",
        _by_rule(found, names, lambda own, name: list(against_exact(own, name)), "relative to exact knowledge"),
    )


def ablation(found: Sequence[Measured]) -> str:
    """Each erratum read otherwise against the default."""
    names = {told: name for name, told in readings(list(found[0].times)).items()}
    return folded("In numbers", _by_rule(found, names, against_default, "relative to the default reading"))


def sensitivity(found: Sequence[Measured]) -> str:
    """Each other value of a parameter against the default."""
    contenders = list(found[0].times)
    names = {
        f"{symbol} = {value:g}": name
        for symbol in PARAMETERS
        for value, name in sorted(values_of(contenders, symbol).items())
    }
    return folded("In numbers", _by_rule(found, names, against_default, "relative to the default"))


def _by_rule(
    found: Sequence[Measured],
    rows: Mapping[str, str],
    compared: Callable[[Sequence[Measured], str], Sequence[Comparison]],
    says: str,
) -> str:
    """For each hand-over a table: a row for each contender, a column for what befalls the team or what it knows."""
    tables = []
    for rule in HAND_OVERS:
        own = [one for one in found if one.scenario.hand_over == rule]
        cells = {told: by_circumstances(compared(own, name)) for told, name in rows.items()}
        columns = list(dict.fromkeys(column for line in cells.values() for column in line))
        body = [[told, *(_cell(line.get(column, [])) for column in columns)] for told, line in cells.items()]
        if own:
            tables.append(table([f"{rule}: {says}", *columns], body, right=True))
    return "\n".join(tables)


def _cell(comparisons: Sequence[Comparison]) -> str:
    """A pooled ratio, and the share of missions left unfinished where that differs."""
    if not comparisons:
        return "–"
    ratio = ratio_of(comparisons)
    left = sum(one.only_second + one.neither for one in comparisons) / sum(one.missions for one in comparisons)
    if ratio is None:
        return f"{left:.1%} unfinished"
    same = all(one.only_first == one.only_second for one in comparisons)
    return number(ratio, 2) if same else f"{number(ratio, 2)}, {left:.1%} unfinished"


def distances(found: Sequence[Measured]) -> str:
    """How far from the optimum, for each hand-over and contender, in the scenarios in which every optimum is proven."""
    sound = proven(found)
    body = []
    for rule in HAND_OVERS:
        own = [one for one in sound if one.scenario.hand_over == rule]
        body += [_distance(rule, contender, own) for contender in (own[0].times if own else ())]
    head = ["hand-over, who", "scenarios", "mean", "p50", "p95", "largest", "missions ≤ 1.20", "scenarios ≤ 1.20"]
    return table(head, body, right=True)


def _distance(rule: str, contender: str, found: Sequence[Measured]) -> list[str]:
    samples = [ratios for one in found if len(ratios := one.ratios(contender))]
    every, missions = np.concatenate(samples), sum(one.missions for one in found)
    near = statistics.proportion(int((every <= NEAR).sum()), missions)
    means = sum(bool(sample.mean() <= NEAR) for sample in samples)
    return [
        f"{rule}, {contender}",
        str(len(found)),
        number(statistics.pooled_mean(samples)),
        number(statistics.quantile(every, 0.5)),
        number(statistics.quantile(every, 0.95)),
        f"{every.max():.2f}",
        f"{near.value:.1%} ({near.low:.1%} to {near.high:.1%})",
        f"{means} of {len(samples)}",
    ]


def growth(found: Sequence[Measured]) -> str:
    """Mean ratios at each size: of II derived, of II shortest first, and to the optimum of robots that share work."""
    sharing = [one for one in found if one.scenario.hand_over != "restart"]
    derived = _sizes(found, "II derived", lambda one: _distance_at(one, DERIVED, one.optimum))
    shortest = _sizes(found, "II shortest first", lambda one: _distance_at(one, "II/shortest_first", one.optimum))
    head = "II derived, to the optimum of robots that share work"
    shared = _sizes(sharing, head, lambda one: _distance_at(one, DERIVED, one.shared))
    return "\n".join([derived, folded("Shortest first, and another optimum", f"{shortest}\n{shared}")])


def _sizes(found: Sequence[Measured], head: str, told: Callable[[Measured], str]) -> str:
    """A row for each heterogeneity and size, a column for each hand-over."""
    rules = [rule for rule in HAND_OVERS if any(one.scenario.hand_over == rule for one in found)]
    ordered = sorted(found, key=lambda one: (one.scenario.heterogeneity, one.scenario.tasks, one.number))
    cells: dict[str, dict[str, str]] = {}
    for one in ordered:
        cells.setdefault(f"{one.scenario.heterogeneity:g} %, {size(one.scenario)}", {})[one.scenario.hand_over] = told(
            one
        )
    return table(
        [head, *rules], [[row, *(line.get(rule, "–") for rule in rules)] for row, line in cells.items()], right=True
    )


def _distance_at(one: Measured, contender: str, yardstick: Floats) -> str:
    """A mean ratio, and where the optimum is not proven what it is at most."""
    if not len(ratios := one.ratios(contender, yardstick)):
        return "–"
    told = number(log_mean(ratios).ratio())
    if yardstick is not one.optimum or one.proven.all():
        return told
    return f"{told}; {int(one.proven.sum())} of {one.missions} proven, at most {one.ratios(contender, one.bound).mean():.3f}"
