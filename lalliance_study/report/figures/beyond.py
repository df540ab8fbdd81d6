"""Beyond the paper: rivals, what knowledge is worth, what literal readings cost, and how much parameters matter."""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from lalliance_study.drawing import BLACK, BLUE, GREEN, GREY, ORANGE, PINK, VERMILION
from lalliance_study.report.beyond import (
    LEARNERS,
    PARAMETERS,
    RIVALS,
    against_default,
    against_exact,
    by_circumstances,
    more_unfinished,
    readings,
    values_of,
)
from lalliance_study.report.claims import circumstances
from lalliance_study.report.comparisons import Comparison, pooled
from lalliance_study.report.figures.lines import HAND_OVERS, STRATEGIES, Panels, band, change, change_axis, ratio_ticks
from lalliance_study.report.results import Measured
from lalliance_study.report.statistics import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    "nothing befalls": BLUE,
    "robots die": VERMILION,
    "robots get stuck": ORANGE,
    "knows 10 samples ± 25%": PINK,
    "knows nothing": BLACK,
    "trained in 3 trials": GREEN,
    **STRATEGIES,
    "ALLIANCE": GREY,
}
#: A share of missions that is not worth a mark.
FEW = 0.01
#: Dots by row, and within a row by what they are a mark of.
Dots = Mapping[str, Mapping[str, Sequence[Comparison]]]


def rivals(found: Sequence[Measured]) -> Figure:
    """Everybody against II with the derived ordering: heterogeneity down, hand-over across."""
    names = {name: told for name, told in RIVALS.items() if name in found[0].times}

    def dots(own: Sequence[Measured]) -> Dots:
        return {told: by_circumstances(against_default(own, name)) for name, told in names.items()}

    return _dotted(found, list(names.values()), dots, "time, relative to II derived")


def knowledge(found: Sequence[Measured]) -> Figure:
    """Each learner against itself with exact knowledge: heterogeneity down, hand-over across."""
    rows = list(dict.fromkeys(circumstances(one.scenario) for one in found))[1:]

    def dots(own: Sequence[Measured]) -> Dots:
        compared = {told: list(against_exact(own, name)) for name, told in LEARNERS.items()}
        return {
            row: {told: [one for one in all_ if circumstances(one.scenario) == row] for told, all_ in compared.items()}
            for row in rows
        }

    return _dotted(found, rows, dots, "time, relative to exact knowledge")


def ablation(found: Sequence[Measured]) -> Figure:
    """What reading an erratum otherwise costs: heterogeneity down, hand-over across."""
    names = readings(list(found[0].times))

    def dots(own: Sequence[Measured]) -> Dots:
        return {told: by_circumstances(against_default(own, name)) for name, told in names.items()}

    return _dotted(found, list(names.values()), dots, "time, relative to the default reading")


def _dotted(
    found: Sequence[Measured], rows: Sequence[str], dots: Callable[[Sequence[Measured]], Dots], says: str
) -> Figure:
    """Panels of ratios as dots with their intervals: a row for each name, heterogeneity down, hand-over across."""
    levels = sorted({one.scenario.heterogeneity for one in found})
    made = {
        (level, rule): dots(
            [one for one in found if (one.scenario.hand_over, one.scenario.heterogeneity) == (rule, level)]
        )
        for level in levels
        for rule in HAND_OVERS
    }
    groups = list(dict.fromkeys(group for panel in made.values() for name in rows for group in panel[name]))
    height = len(rows) * (0.14 + 0.045 * len(groups))
    figure = Figure(figsize=(10.4, 1.3 + len(levels) * (0.5 + height)))
    panels: Panels = figure.subplots(len(levels), len(HAND_OVERS), sharex=True, sharey=True, squeeze=False).tolist()
    for row, level in zip(panels, levels, strict=True):
        for axes, rule in zip(row, HAND_OVERS, strict=True):
            _dotted_panel(axes, made[level, rule], rows, groups)
        row[0].set_ylabel(f"heterogeneity {level:g} %")
    _dotted_axes(panels, rows, says)
    marks = [Line2D([], [], linestyle="none", marker="o", color=COLOURS[group], label=group) for group in groups]
    marks.append(Line2D([], [], linestyle="none", marker="x", color=GREY, label="leaves more than 1 % more unfinished"))
    figure.legend(handles=marks, loc="outside lower center", ncols=4)
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 0.96, 1.0))  # room for the numbers right of the last panels
    return figure


def _dotted_panel(axes: "Axes", dots: Dots, rows: Sequence[str], groups: Sequence[str]) -> None:
    """The dots of one panel, and right of it how many missions more are left unfinished, a column for each group."""
    for place, name in enumerate(rows):
        for number, group in enumerate(groups):
            comparisons = dots[name].get(group, ())
            shift = 0.7 * ((number + 0.5) / len(groups) - 0.5)
            marker = "x" if more_unfinished(comparisons) > FEW else "o"
            _dot(axes, place + shift, comparisons, marker, COLOURS[group])
    left = {
        group: {
            place: more for place, name in enumerate(rows) if (more := more_unfinished(dots[name].get(group, ()))) > FEW
        }
        for group in groups
    }
    for number, (group, shares) in enumerate((group, shares) for group, shares in left.items() if shares):
        for place, share in shares.items():
            told = axes.text(1.02 + 0.14 * number, place, f"{100 * share:.0f}", transform=axes.get_yaxis_transform())
            told.set(color=COLOURS[group], fontsize=7, va="center")
    if any(left.values()):
        axes.text(1.02, 0.0, "% more\nunfinished", transform=axes.transAxes, va="top", fontsize=7, color=GREY)


def _dot(axes: "Axes", place: float, comparisons: Sequence[Comparison], marker: str, colour: str) -> None:
    """One pooled ratio with its interval, if there is one."""
    ratio = pooled(comparisons)
    if ratio is not None:
        value, low, high = ratio.ratio()
        axes.plot([low, high], [place, place], color=colour, linewidth=1.2)
        axes.plot(value, place, marker=marker, color=colour, markersize=4.5)


def _dotted_axes(panels: Panels, rows: Sequence[str], says: str) -> None:
    for axes in chain(*panels):
        axes.axvline(1.0, color="black", linewidth=0.9, zorder=1)
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        axes.set_xticks(ratio_ticks(low, high))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: change(value)))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_yticks(range(len(rows)), rows)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.tick_params(axis="y", length=0)
        axes.tick_params(axis="x", labelrotation=45)
    for axes, told in zip(panels[0], HAND_OVERS.values(), strict=True):
        axes.set_title(told)
    for axes in panels[-1]:
        axes.set_xlabel(says)


def sensitivity(found: Sequence[Measured]) -> Figure:
    """What other values of each parameter change: parameters down, hand-over across, a line for what befalls."""
    contenders = list(found[0].times)
    figure = Figure(figsize=(10.4, 2.1 * len(PARAMETERS)))
    panels = figure.subplots(len(PARAMETERS), len(HAND_OVERS), sharey="row", sharex="row", squeeze=False)
    for row, (symbol, (default, told)) in zip(panels, PARAMETERS.items(), strict=True):
        values = values_of(contenders, symbol)
        for axes, rule in zip(row, HAND_OVERS, strict=True):
            own = [one for one in found if one.scenario.hand_over == rule]
            for group in dict.fromkeys(circumstances(one.scenario) for one in own):
                _line_of_values(axes, [one for one in own if circumstances(one.scenario) == group], values, default)
            axes.set(xscale="log", xlabel=told if axes is row[1] else "")
            _label_values(axes, sorted([*values, default]))
            change_axis(axes)
    for axes, told in zip(panels[0], HAND_OVERS.values(), strict=True):
        axes.set_title(told)
    panels[len(panels) // 2][0].set_ylabel("time, relative to the default")
    groups = dict.fromkeys(circumstances(one.scenario) for one in found)
    marks = [Line2D([], [], marker="o", color=COLOURS[group], label=group) for group in groups]
    figure.legend(handles=marks, loc="outside lower center", ncols=4)
    return figure


def _label_values(axes: "Axes", values: Sequence[float]) -> None:
    """Ticks of a logarithmic axis at the values; labels of two that are near to one another keep apart."""
    axes.set_xticks(values, [f"{value:g}" for value in values], fontsize=8)
    axes.xaxis.set_minor_locator(NullLocator())
    labels, whole = axes.get_xticklabels(), math.log(values[-1] / values[0])
    for number, (value, following) in enumerate(pairwise(values)):
        if math.log(following / value) < 0.06 * whole:
            labels[number].set_horizontalalignment("right")
            labels[number + 1].set_horizontalalignment("left")


def _line_of_values(axes: "Axes", found: Sequence[Measured], values: Mapping[float, str], default: float) -> None:
    """One line through the default, which is 1, and all other values."""
    estimates = {default: Estimate(1.0, 1.0, 1.0)}
    for value, name in values.items():
        ratio = pooled(against_default(found, name))
        estimates[value] = Estimate(np.nan, np.nan, np.nan) if ratio is None else ratio.ratio()
    places = sorted(estimates)
    band(axes, places, [estimates[value] for value in places], COLOURS[circumstances(found[0].scenario)])
