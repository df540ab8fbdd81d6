"""What the orderings change: longest first for each way in which times may be spread, and all of them for strategy II."""

from collections.abc import Sequence
from typing import Literal

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lalliance_study.drawing import BLACK, BLUE, GREY, ORANGE, PINK, SKY
from lalliance_study.report.figures.lines import (
    HAND_OVERS,
    grid,
    place,
    ratio_line,
    ratios_against_heterogeneity,
)
from lalliance_study.report.results import Measured

SPREADS = {"unrelated": BLUE, "log_uniform": SKY, "related": ORANGE}
ORDERINGS = {"derived": BLUE, "random": PINK, "longest_first": BLACK}
#: How lines are drawn where robots die, and where not.
DASHES: dict[Literal["-", ":"], str] = {"-": "robots die", ":": "nobody dies"}
BEFALLS = {"nothing befalls": (False, False), "robots die": (True, False), "robots get stuck": (False, True)}


def longest_first(found: Sequence[Measured]) -> Figure:
    """Longest first against shortest first: strategies down, hand-over across, a line for each spread of times."""
    strategies = ("I", "II", "III")
    figure, panels = grid(len(strategies), len(HAND_OVERS), (9.6, 8.0))
    levels = sorted({one.scenario.heterogeneity for one in found})
    for row, strategy in zip(panels, strategies, strict=True):
        for axes, rule in zip(row, HAND_OVERS, strict=True):
            for spread, colour in SPREADS.items():
                for dashes, dying in (("-", True), (":", False)):
                    own = [
                        one.compare(f"{strategy}/longest_first", f"{strategy}/shortest_first")
                        for one in found
                        if (one.scenario.hand_over, one.scenario.spread) == (rule, spread)
                        and (one.scenario.failures > 0, one.scenario.traps > 0) == (dying, False)
                    ]
                    if own:
                        ratio_line(axes, own, place, colour, linestyle=dashes)
        row[0].set_ylabel(f"Strategy {strategy}\ntime with longest first,\nrelative to shortest first")
    ratios_against_heterogeneity(panels, levels)
    marks = [
        Line2D([], [], color=colour, label=f"{spread.replace('_', '-')} times") for spread, colour in SPREADS.items()
    ]
    marks += [Line2D([], [], color=GREY, linestyle=dash, label=told) for dash, told in DASHES.items()]
    panels[0][0].legend(handles=marks, loc="upper left")
    return figure


def orderings(found: Sequence[Measured]) -> Figure:
    """All orderings under strategy II against shortest first, for unrelated times: what befalls down, hand-over across."""
    figure, panels = grid(len(BEFALLS), len(HAND_OVERS), (9.6, 8.0))
    levels = sorted({one.scenario.heterogeneity for one in found})
    for row, (told, befalls) in zip(panels, BEFALLS.items(), strict=True):
        for axes, rule in zip(row, HAND_OVERS, strict=True):
            own = [
                one
                for one in found
                if (one.scenario.hand_over, one.scenario.spread) == (rule, "unrelated")
                and (one.scenario.failures > 0, one.scenario.traps > 0) == befalls
            ]
            for ordering, colour in ORDERINGS.items():
                compared = [one.compare(f"II/{ordering}", "II/shortest_first") for one in own]
                if compared:
                    ratio_line(axes, compared, place, colour, label=ordering.replace("_", " "))
        row[0].set_ylabel(f"{told.capitalize()}\ntime, relative to shortest first")
    ratios_against_heterogeneity(panels, levels)
    panels[0][0].legend(title="ordering", loc="upper left")
    return figure
