"""Figure 2 as a map of who wins by how much, how that grows with heterogeneity, and Figure 3."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from lalliance_study.drawing import GREY
from lalliance_study.report.comparisons import Outcome
from lalliance_study.report.figures.lines import (
    HAND_OVERS,
    STRATEGIES,
    Panels,
    grid,
    place,
    ratio_line,
    ratios_against_heterogeneity,
)
from lalliance_study.report.results import Measured

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: By how much the best are better than the next, and how much of their hue a cell has then.
STEPS = ((1.03, 0.25, "less than 3 %"), (1.10, 0.45, "3 to 10 %"), (1.30, 0.7, "10 to 30 %"), (np.inf, 1.0, "more"))
NOBODY = "#E6E6E6"
#: What the paper says, for PWW true and false.
PAPER = {
    True: "paper:\nII in all\nregions",
    False: "paper:\nIII in region 3\nand, 300 to 600 %,\nin region 2;\nelse II",
}


class Best(NamedTuple):
    """Who is best in a scenario: nobody is sure to be better than they."""

    who: tuple[str, ...]
    margin: float
    """How many times as long the best of the others takes; infinite where the others finish fewer missions."""


def best_of(one: Measured, names: Mapping[str, str]) -> Best:
    """Who is best among contenders, given by what they are to be called."""
    beaten: set[str] = set()
    margins: dict[str, list[float]] = {name: [] for name in names}
    for ours in names:
        for other in names:
            compared = one.compare(names[ours], names[other]) if ours != other else None
            if compared is None or compared.outcome() is not Outcome.BETTER:
                continue
            beaten.add(other)
            by_time = compared.ratio is not None and compared.ratio.ratio().high < 1
            margins[other].append(1 / compared.ratio.ratio().value if by_time and compared.ratio else np.inf)
    who = tuple(name for name in names if name not in beaten) or tuple(names)
    if len(who) == len(names):
        return Best(who, 1.0)
    return Best(who, min(max(margins[name]) for name in beaten if margins[name]))


def tint(colour: str, strength: float) -> tuple[float, float, float]:
    """A colour, mixed with white."""
    red, green, blue = (1 - strength * (1 - part) for part in to_rgb(colour))
    return red, green, blue


def strategy_map(found: Sequence[Measured], ordering: str = "shortest_first") -> Figure:
    """Who is best, by how much: tasks per robot and coverage within panels, heterogeneity across, hand-over and PWW down."""
    names = {strategy: f"{strategy}/{ordering}" for strategy in STRATEGIES}
    levels = sorted({one.scenario.heterogeneity for one in found})
    teams = sorted({(one.scenario.robots, one.scenario.tasks / one.scenario.robots) for one in found})
    coverages = sorted({one.scenario.coverage for one in found})
    rows = [(rule, pww) for rule in HAND_OVERS for pww in (True, False)]
    figure, panels = grid(len(rows), len(levels), (11.5, 10.2))
    for one in found:
        where = one.scenario
        row = rows.index((where.hand_over, where.traps == 0))
        column = teams.index((where.robots, where.tasks / where.robots))
        cell = (column + 0.5 * (where.robots > teams[0][0]), coverages.index(where.coverage))
        _cell(panels[row][levels.index(where.heterogeneity)], cell, best_of(one, names))
    gap = 0.5 * (teams[-1][0] > teams[0][0])
    for axes in chain(*panels):
        axes.set(xlim=(-0.1, len(teams) + gap + 0.1), ylim=(-0.1, len(coverages) + 0.1))
        axes.grid(visible=False)
        axes.tick_params(length=0, labelsize=8)
        axes.set_xticks([column + 0.5 + gap * (team > teams[0][0]) for column, (team, _) in enumerate(teams)])
        axes.set_xticklabels([f"{load:g}" for _, load in teams])
        axes.set_yticks([row + 0.5 for row in range(len(coverages))], [str(one) for one in coverages])
        for side in axes.spines.values():
            side.set_visible(False)
    _frame(panels, rows, levels)
    _key(figure, sorted({team for team, _ in teams}))
    return figure


def _cell(axes: "Axes", corner: tuple[float, float], best: Best) -> None:
    x, y = corner[0] + 0.04, corner[1] + 0.04
    wide = 0.92
    square = [(x, y), (x + wide, y), (x + wide, y + wide), (x, y + wide)]
    if best.margin == 1.0:
        axes.add_patch(Polygon(square, color=NOBODY, linewidth=0))
        return
    strength = next(share for most, share, _ in STEPS if best.margin < most or most == np.inf)
    halves = [square] if len(best.who) == 1 else [[square[0], square[2], square[3]], [square[0], square[1], square[2]]]
    for who, half in zip(best.who, halves, strict=True):
        axes.add_patch(Polygon(half, facecolor=tint(STRATEGIES[who], strength), linewidth=0))
    if best.margin == np.inf:
        axes.plot(x + wide / 2, y + wide / 2, marker="x", color="white", markersize=5, markeredgewidth=1.6)


def _frame(panels: Panels, rows: Sequence[tuple[str, bool]], levels: Sequence[float]) -> None:
    for axes, level in zip(panels[0], levels, strict=True):
        axes.set_title(f"heterogeneity {level:g} %" if axes is panels[0][0] else f"{level:g} %", loc="center")
    for (axes, *_), (rule, pww) in zip(panels, rows, strict=True):
        axes.set_ylabel(f"{rule}\n{'work progresses' if pww else 'robots get stuck'}\n\ncoverage")
    for axes in panels[-1]:
        axes.set_xlabel("tasks per robot")
    for (*_, axes), (_, pww) in zip(panels, rows, strict=True):
        axes.text(1.04, 0.5, PAPER[pww], transform=axes.transAxes, va="center", fontsize=8.5, color=GREY)


def _key(figure: Figure, teams: Sequence[int]) -> None:
    patches: list[Artist] = [
        Patch(facecolor=tint(colour, share), label=f"{strategy} by {told}")
        for strategy, colour in STRATEGIES.items()
        for _, share, told in STEPS
    ]
    patches += [
        Patch(facecolor=NOBODY, label="no one is sure to be better"),
        Patch(facecolor="white", edgecolor=GREY, label="two colours: both are ahead of the third"),
    ]
    patches.append(
        Line2D([], [], linestyle="none", marker="x", color=GREY, label="others leave more missions unfinished")
    )
    title = f"In each panel left {teams[0]} robots, right {teams[-1]} robots"
    figure.legend(handles=patches, loc="outside lower center", ncols=4, title=title, fontsize=8.5)


def strategy_ratios(found: Sequence[Measured], ordering: str = "shortest_first") -> Figure:
    """By how much I and III are slower than II, against heterogeneity, all sizes together."""
    return _against_heterogeneity(
        found,
        {"I": (f"I/{ordering}", f"II/{ordering}"), "III": (f"III/{ordering}", f"II/{ordering}")},
        "time, relative to II",
    )


def random_instead(found: Sequence[Measured]) -> Figure:
    """Figure 3: what random selection in the place of shortest first changes for each strategy, against heterogeneity."""
    pairs = {strategy: (f"{strategy}/random", f"{strategy}/shortest_first") for strategy in STRATEGIES}
    return _against_heterogeneity(found, pairs, "time with random selection,\nrelative to shortest first")


def _against_heterogeneity(found: Sequence[Measured], pairs: Mapping[str, tuple[str, str]], says: str) -> Figure:
    """Pooled ratios of pairs of contenders: hand-over across, PWW down."""
    figure, panels = grid(2, len(HAND_OVERS), (9.6, 6.0))
    levels = sorted({one.scenario.heterogeneity for one in found})
    for row, pww in enumerate((True, False)):
        for axes, rule in zip(panels[row], HAND_OVERS, strict=True):
            own = [one for one in found if (one.scenario.hand_over, one.scenario.traps == 0) == (rule, pww)]
            for strategy, pair in pairs.items():
                compared = [one.compare(*pair) for one in own]
                ratio_line(axes, compared, place, STRATEGIES[strategy], label=strategy)
        panels[row][0].set_ylabel(f"{'Work progresses' if pww else 'Robots get stuck'}\n{says}")
    ratios_against_heterogeneity(panels, levels)
    panels[0][0].legend(title="strategy", loc="upper left")
    return figure
