"""What several figures have in common: axes of heterogeneity, and lines in bands."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from lalliance_study.drawing import BLUE, GREEN, VERMILION
from lalliance_study.report.comparisons import Comparison, pooled
from lalliance_study.report.statistics import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Panels: TypeAlias = "list[list[Axes]]"
"""The panels of a figure, by row and column."""

HAND_OVERS = {
    "shared_max": "shared_max\nwork left belongs to the task",
    "shared_add": "shared_add\nthe same, and rates add up",
    "restart": "restart\neach attempt begins anew",
}
STRATEGIES = {"I": GREEN, "II": BLUE, "III": VERMILION}


def doubled(heterogeneity: float) -> float:
    """Where a heterogeneity stands on an axis: how often the fastest robot's time is doubled in the slowest one's."""
    return float(np.log2(1 + heterogeneity / 100))


def heterogeneity_axis(axes: "Axes", levels: Sequence[float]) -> None:
    """An axis of heterogeneities, each with its tick."""
    axes.set_xticks([doubled(level) for level in levels], [f"{level:g}" for level in levels])
    axes.tick_params(axis="x", labelrotation=45)
    axes.xaxis.set_minor_locator(NullLocator())


def change_axis(axes: "Axes") -> None:
    """An axis of ratios, logarithmic, read as changes in percent where they are small and as multiples where they are not."""
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_yticks(ratio_ticks(low, high))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: change(value)))
    axes.yaxis.set_minor_locator(NullLocator())


def ratio_ticks(low: float, high: float) -> list[float]:
    """Round ratios between two, as many as a reader can take in, and 1 where it lies between."""
    steps = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
    for step in steps:
        ticks = [1 + step * number for number in range(round(-1 / step) + 1, round(1 / step) + 1)]
        inside = [tick for tick in ticks if low <= tick <= min(high, 2.0)]
        if len(inside) <= 8 and high <= 2.0:
            return inside
    multiples: tuple[float, ...] = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
    if high < 6 * low:
        multiples = (*multiples, 0.7, 1.5, 3.0)
    return [tick for tick in multiples if low <= tick <= high]


def change(ratio: float) -> str:
    """A ratio as a change in percent, or as a multiple from 2 on."""
    if ratio >= 2:
        return f"×{ratio:.3g}"
    percent = round(100 * (ratio - 1), 6)
    return f"{percent:+.3g}%" if percent else "0%"


def band(axes: "Axes", places: Sequence[float], estimates: Sequence[Estimate], colour: str, **line: Any) -> None:
    """A line through values, in a band that is their interval."""
    values = np.array(estimates)
    axes.fill_between(places, values[:, 1], values[:, 2], color=colour, alpha=0.18, linewidth=0)
    axes.plot(places, values[:, 0], **{"color": colour, "marker": "o", "markersize": 3.2, "linewidth": 1.5, **line})


def ratio_line(
    axes: "Axes",
    comparisons: Sequence[Comparison],
    place: Callable[[Comparison], float],
    colour: str,
    **line: Any,
) -> None:
    """Pooled ratios against something; where missions cannot be compared by time the line has a gap."""
    places = sorted({place(one) for one in comparisons})
    found = [pooled([one for one in comparisons if place(one) == at]) for at in places]
    gap = Estimate(np.nan, np.nan, np.nan)
    band(axes, places, [gap if one is None else one.ratio() for one in found], colour, **line)


def place(one: Comparison) -> float:
    """Where the heterogeneity of a comparison's scenario stands on an axis."""
    return doubled(one.scenario.heterogeneity)


def ratios_against_heterogeneity(panels: Panels, levels: Sequence[float]) -> None:
    """Axes of panels of ratios against heterogeneity, a column for each hand-over."""
    for axes in chain(*panels):
        axes.axhline(1.0, color="black", linewidth=0.9, zorder=1)
        change_axis(axes)
        heterogeneity_axis(axes, levels)
    for axes, told in zip(panels[0], HAND_OVERS.values(), strict=True):
        axes.set_title(told)
    for axes in panels[-1]:
        axes.set_xlabel("heterogeneity, in percent")


def grid(
    rows: int, columns: int, size: tuple[float, float], sharey: Literal["all", "row"] = "all"
) -> tuple[Figure, Panels]:
    """A figure of panels that share their axes, those of values perhaps by row alone."""
    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, sharex=True, sharey=sharey, squeeze=False).tolist()
