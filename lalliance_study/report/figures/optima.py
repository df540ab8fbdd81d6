"""How far from the optimum: the distribution, where in the grid, and how that grows with the size of the problem."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator, PercentFormatter

from lalliance_study.drawing import BLUE, GREEN, GREY, SKY, VERMILION
from lalliance_study.report.figures.lines import HAND_OVERS, band, grid
from lalliance_study.report.optima import DERIVED, NEAR, log_mean, proven
from lalliance_study.report.results import Measured
from lalliance_study.scenarios import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TICKS = (1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0)
LINES = {
    "II/derived": (BLUE, "-", "II, derived ordering"),
    "II/shortest_first": (SKY, "-", "II, shortest first"),
    "I/derived": (GREEN, "--", "I, derived ordering"),
    "III/derived": (VERMILION, "--", "III, derived ordering"),
}
#: shared_add is drawn broad and below shared_max, from which it hardly differs.
RULES = {"shared_add": (SKY, 3.6), "shared_max": (BLUE, 1.5), "restart": (VERMILION, 1.5)}
ORDERINGS: dict[str, Literal["-", "--"]] = {"II/derived": "-", "II/shortest_first": "--"}


def distribution(found: Sequence[Measured]) -> Figure:
    """What share of single missions comes how near to the optimum: where all robots hear all others, and where not."""
    figure = Figure(figsize=(9.6, 4.4))
    panels = figure.subplots(1, 2, sharey=True)
    sound = proven(found)
    for axes, everybody in zip(panels, (True, False), strict=True):
        own = [one for one in sound if (one.scenario.coverage >= one.scenario.robots) == everybody]
        for rule, (colour, width) in RULES.items():
            for contender, dashes in ORDERINGS.items():
                missions = [one for one in own if one.scenario.hand_over == rule]
                if missions:
                    _share_within(axes, missions, contender, {"color": colour, "linewidth": width, "linestyle": dashes})
        axes.axvline(NEAR, color="black", linewidth=0.9)
        axes.set(xscale="log", xlim=(0.85, 3.0), ylim=(0, 1.01), xlabel="makespan, in multiples of the optimum")
        axes.set_xticks([1.0, 1.1, 1.2, 1.5, 2.0, 3.0])
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(PercentFormatter(1.0))
        axes.set_title("Every robot can do every task" if everybody else "Some tasks are not for all robots")
    panels[0].set_ylabel("share of the missions\nwhose ratio is at most this")
    marks = [Line2D([], [], color=colour, linewidth=width, label=rule) for rule, (colour, width) in RULES.items()]
    named = {"II/derived": "derived", "II/shortest_first": "shortest first"}
    marks += [Line2D([], [], color=GREY, linestyle=dash, label=named[name]) for name, dash in ORDERINGS.items()]
    panels[1].legend(handles=marks, loc="lower right")
    panels[0].annotate("within 20 %", (NEAR, 0.03), xytext=(4, 0), textcoords="offset points", fontsize=8.5)
    return figure


def _share_within(axes: "Axes", found: Sequence[Measured], contender: str, style: dict[str, Any]) -> None:
    """The share of missions below each ratio; what was not finished is below none."""
    ratios = np.sort(np.concatenate([one.ratios(contender) for one in found]))
    missions = sum(one.missions for one in found)
    shares = np.arange(1, len(ratios) + 1) / missions
    thin = np.unique(np.linspace(0, len(ratios) - 1, 400).astype(np.intp))
    axes.plot(ratios[thin], shares[thin], **style)


def _load(scenario: Scenario) -> tuple[float, str]:
    nearest = min((1.0, 1.5, 2.0, 2.5, 3.0, 4.0), key=lambda load: abs(load - scenario.tasks / scenario.robots))
    return nearest, f"{nearest:g}"


def _able(scenario: Scenario) -> tuple[float, str]:
    share = scenario.coverage / scenario.robots
    if share >= 1:
        return 3, "all"
    if share >= 0.75:
        return 2, "3/4 or more"
    return (1, "1/2 to 3/4") if share >= 0.5 else (0, "below 1/2")


def by_region(found: Sequence[Measured], contender: str = DERIVED) -> Figure:
    """The mean ratio by heterogeneity, and by tasks per robot or by the share of robots that can do a task."""
    figure = Figure(figsize=(10.4, 6.4))
    panels = figure.subplots(2, len(HAND_OVERS), sharex=True, sharey="row", squeeze=False)
    sound = proven(found)
    levels = sorted({one.scenario.heterogeneity for one in sound})
    for row, (told, of) in zip(
        panels, {"tasks per robot": _load, "share of robots able to do a task": _able}.items(), strict=True
    ):
        for axes, rule in zip(row, HAND_OVERS, strict=True):
            _heat(axes, [one for one in sound if one.scenario.hand_over == rule], of, levels, contender)
        row[0].set_ylabel(told)
    for axes, told in zip(panels[0], HAND_OVERS.values(), strict=True):
        axes.set_title(told)
    for axes in panels[1]:
        axes.set_xticks(range(len(levels)), [f"{level:g}" for level in levels], rotation=45)
        axes.set_xlabel("heterogeneity, in percent")
    return figure


def _heat(
    axes: "Axes",
    found: Sequence[Measured],
    of: Callable[[Scenario], tuple[float, str]],
    levels: Sequence[float],
    contender: str,
) -> None:
    """Mean ratios as cells with their numbers: heterogeneity across, another property down."""
    groups = sorted({of(one.scenario) for one in found})
    means = np.full((len(groups), len(levels)), np.nan)
    for row, group in enumerate(groups):
        for column, level in enumerate(levels):
            own = [
                ratios.mean()
                for one in found
                if of(one.scenario) == group
                and one.scenario.heterogeneity == level
                and len(ratios := one.ratios(contender))
            ]
            means[row, column] = np.mean(own) if own else np.nan
    axes.imshow(np.log(means), cmap="cividis", vmin=0.0, vmax=np.log(2.0), aspect="auto", origin="lower")
    axes.grid(visible=False)
    axes.tick_params(length=0)
    axes.set_yticks(range(len(groups)), [name for _, name in groups])
    for (row, column), mean in np.ndenumerate(means):
        if np.isfinite(mean):
            dark = mean < 1.45
            axes.text(
                column, row, f"{mean:.2f}", ha="center", va="center", fontsize=8, color="white" if dark else "black"
            )


def growth(found: Sequence[Measured]) -> Figure:
    """The centrepiece: the mean ratio against the size of the problem, for each hand-over and heterogeneity."""
    levels = sorted({one.scenario.heterogeneity for one in found})
    figure, panels = grid(len(levels), len(HAND_OVERS), (10.4, 3.6 * len(levels)))
    sizes = sorted({(one.scenario.robots, one.scenario.tasks) for one in found})
    for row, level in zip(panels, levels, strict=True):
        for axes, rule in zip(row, HAND_OVERS, strict=True):
            own = sorted(
                (one for one in found if (one.scenario.hand_over, one.scenario.heterogeneity) == (rule, level)),
                key=lambda one: one.scenario.robots,
            )
            _growth_panel(axes, own)
        row[0].set_ylabel(f"Heterogeneity {level:g} %\nmean of makespan / optimum")
    for axes, told in zip(panels[0], HAND_OVERS.values(), strict=True):
        axes.set_title(told)
    for axes in panels[-1]:
        axes.set_xlabel("robots, and tasks")
        axes.set_xticks([robots for robots, _ in sizes], [f"{robots}\n{tasks}" for robots, tasks in sizes])
        axes.xaxis.set_minor_locator(NullLocator())
    panels[0][0].legend(loc="upper left")
    near = panels[0][0].text(0.99, NEAR, "20 %", transform=panels[0][0].get_yaxis_transform(), ha="right", va="bottom")
    near.set(fontsize=8.5, color=GREY)
    return figure


def _growth_panel(axes: "Axes", found: Sequence[Measured]) -> None:
    """All contenders in one panel; `found` in the order of size."""
    axes.set(xscale="log", yscale="log")
    axes.axhline(NEAR, color="black", linewidth=0.9, linestyle=":")
    for contender, (colour, dashes, told) in LINES.items():
        own = [one for one in found if len(one.ratios(contender)) > 1]
        places = [one.scenario.robots for one in own]
        if not own:
            continue
        means = [log_mean(one.ratios(contender)).ratio() for one in own]
        band(axes, places, means, colour, linestyle=dashes, label=told)
        most = [one.ratios(contender, one.bound).mean() for one in own]
        axes.fill_between(places, [mean.value for mean in means], most, color=colour, alpha=0.35, linewidth=0)
    low, high = axes.get_ylim()
    axes.set_yticks([tick for tick in TICKS if low <= tick <= high])
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
