"""The figures, drawn from rows and from nothing else, but for the law, which is drawn from itself.

Measured values are marks with their confidence interval (95 %), laws are dashed lines, real runs are black diamonds. Colours
are those of Okabe and Ito, which colour-blind readers can tell apart; every line also has its name at its end.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, PercentFormatter

from lalliance_study.detection.law import Loss, Timing, detection_quantile, suspicions
from lalliance_study.detection.probe import RATE
from lalliance_study.detection.rows import Cost, Detections, Suspicions, load
from lalliance_study.drawing import BLUE, FORMS, GREY, style, write
from lalliance_study.drawing import VERMILION as RED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Okabe and Ito's colours, the same for each tau rho in all figures; the one they lack is a dark red.
COLOURS = {
    2.01: "#D55E00",
    3.0: "#E69F00",
    4.0: "#009E73",
    5.0: "#0072B2",
    6.0: "#CC79A7",
    7.0: "#56B4E9",
    8.0: "#882255",
    10.0: "#000000",
}
HOUR = 3600.0
_REAL: dict[str, Any] = {"marker": "D", "markersize": 6.5, "color": "black", "markeredgecolor": "black", "zorder": 5}
#: Standard errors of a 95 % interval.
WIDE = 1.96


def draw(rows: Path, out: Path, forms: Sequence[str] = FORMS) -> list[Path]:
    """Draw all figures in each of `forms`; the files written."""
    counted = load(rows / "suspicions.csv", Suspicions) + load(rows / "suspicions-real.csv", Suspicions)
    timed = load(rows / "detections.csv", Detections) + load(rows / "detections-real.csv", Detections)
    costs = load(rows / "costs.csv", Cost)
    with style():
        drawn = {
            "false-suspicions": false_suspicions(counted),
            "stairs": stairs([row for row in counted if row.source == "simulated"]),
            "detection-time": detection_time(timed),
            "mission-cost": mission_cost(costs),
        }
        return write(drawn, out, forms)


def poisson_interval(count: int) -> tuple[float, float]:
    """The 95 % interval of the mean of a count, by Byar's approximation of the exact one."""
    more = count + 1
    low = count * (1 - 1 / (9 * count) - WIDE / (3 * math.sqrt(count))) ** 3 if count else 0.0
    return low, more * (1 - 1 / (9 * more) + WIDE / (3 * math.sqrt(more))) ** 3


def _name(tau_rho: float) -> str:
    return f"{tau_rho:.3g}" if tau_rho != 2.01 else "2"


def _label_ends(axes: "Axes", at: float, ends: Mapping[float, float], apart: float) -> None:
    """Name lines at their ends, at least a part `apart` of the axis from one another."""
    low, high = axes.transLimits.inverted().transform([[0, 0], [0, 1]])[:, 1]
    scaled = axes.yaxis.get_transform().transform
    places = {value: float((scaled(end) - low) / (high - low)) for value, end in ends.items()}
    rising = sorted(places, key=lambda value: (places[value], -value))
    steps = apart * np.arange(len(rising))
    wanted = np.array([places[value] for value in rising]) - steps
    # Halfway between all pushed up as far as need be, and all pushed down.
    spread = (np.maximum.accumulate(wanted) + np.minimum.accumulate(wanted[::-1])[::-1]) / 2 + steps
    for value, place in zip(rising, spread, strict=True):
        named = axes.text(at, float(place), _name(value), transform=axes.get_xaxis_transform(), va="center")
        named.set(color=COLOURS[value], fontweight="bold")
    axes.text(at, 1.02, "τ·ρ", transform=axes.get_xaxis_transform(), fontweight="bold")


def _legend(axes: "Axes", *, real: bool, measured: str, columns: int = 1) -> None:
    marks = [
        Line2D([], [], color=GREY, marker="o", markersize=4.5, linestyle="none", label=measured),
        Line2D([], [], color=GREY, linestyle="--", linewidth=1.3, label="law"),
    ]
    if real:
        marks.append(_real_mark(GREY))
    axes.legend(handles=marks, loc="lower right" if columns == 1 else "upper left", ncols=columns, columnspacing=1.2)


def _real_mark(colour: str) -> Line2D:
    return Line2D([], [], label="real runs", **_REAL | {"markerfacecolor": colour}, linestyle="none")


def _rates(axes: "Axes", rows: Sequence[Suspicions], xs: Sequence[float], **style: Any) -> None:
    """Counts as rates per pair and hour, each with its interval; where nothing was counted there is no mark."""
    seen = [(x, row) for x, row in zip(xs, rows, strict=True) if row.times]
    rates = np.array([row.times / row.seconds * HOUR for _, row in seen])
    ends = np.array([[end / row.seconds * HOUR for end in poisson_interval(row.times)] for _, row in seen])
    if seen:
        spread = np.abs(ends.T - rates)
        axes.errorbar([x for x, _ in seen], rates, yerr=spread, linestyle="none", elinewidth=1, **style)


def false_suspicions(rows: Sequence[Suspicions]) -> Figure:
    """How often living robots are taken to be silent, against loss: independent losses, and bursts."""
    figure = Figure(figsize=(9.6, 4.9))
    left, right = figure.subplots(1, 2, sharey=True)
    burst = max((row.burst for row in rows), default=0.0)
    main = [row for row in rows if row.jitter == 0 and row.tau_rho in _main(rows)]
    for axes, length in ((left, 0.0), (right, burst)):
        own = [row for row in main if row.burst == length]
        values = sorted({row.tau_rho for row in own})
        axes.set(yscale="log", ylim=(0.3, 6e3), xlim=(0, 0.88), xlabel="share of messages lost, p")
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        ends = {value: _one_suspicion_line(axes, [row for row in own if row.tau_rho == value]) for value in values}
        _label_ends(axes, 0.82, ends, 0.037)
    left.set(title="Independent losses", ylabel="false suspicions per pair of robots and hour")
    right.set_title(f"Bursts of {burst:g} messages on average, same share lost")
    _legend(left, real=any(row.source == "real" for row in rows), measured="simulated, 95 % interval")
    return figure


def _main(rows: Sequence[Suspicions]) -> set[float]:
    """The values of tau rho at which more than one loss was measured."""
    losses: dict[float, set[float]] = {}
    for row in rows:
        losses.setdefault(row.tau_rho, set()).add(row.loss)
    return {tau_rho for tau_rho, seen in losses.items() if len(seen) > 2}


def _one_suspicion_line(axes: "Axes", rows: Sequence[Suspicions]) -> float:
    """Draw one law and what was counted; where the law ends."""
    tau_rho, burst = rows[0].tau_rho, rows[0].burst or None
    colour = COLOURS[tau_rho]
    shares = np.linspace(0.01, 0.8, 160)
    law = [suspicions(Loss(float(share), burst), Timing(tau_rho / RATE)) * HOUR for share in shares]
    axes.plot(shares, law, linestyle="--", linewidth=1.2, color=colour)
    simulated = [row for row in rows if row.source == "simulated"]
    real = [row for row in rows if row.source == "real"]
    _rates(axes, simulated, [row.loss for row in simulated], marker="o", markersize=4.5, color=colour)
    _rates(axes, real, [row.loss for row in real], **_REAL | {"markerfacecolor": colour})
    return law[-1]


def stairs(rows: Sequence[Suspicions]) -> Figure:
    """False suspicions against tau rho at one loss: the stairs of the law, and what messages that are late do to them."""
    figure = Figure(figsize=(7.4, 4.2))
    axes = figure.subplots()
    fine = [row for row in rows if row.tau_rho not in _main(rows) or row.jitter > 0]
    loss = fine[0].loss
    grid = np.linspace(2.01, 6.12, 1500)
    laws = [suspicions(Loss(loss), Timing(float(tau_rho) / RATE)) * HOUR for tau_rho in grid]
    axes.plot(grid, laws, linestyle="--", linewidth=1.3, color=BLUE, label="law")
    simple = [RATE * (1 - loss) * loss**tau_rho * HOUR for tau_rho in grid]
    axes.plot(grid, simple, linestyle=":", linewidth=1.2, color=GREY, label="ρ (1 − p) p$^{τρ}$, not rounded")
    for jitter, marker, colour in ((0.0, "o", BLUE), (max(row.jitter for row in rows), "s", RED)):
        own = sorted(
            (row for row in rows if row.jitter == jitter and row.loss == loss and not row.burst),
            key=lambda row: row.tau_rho,
        )
        own = [row for row in own if row.tau_rho <= 6]
        name = "simulated, messages on time" if jitter == 0 else f"simulated, messages late by 0 to {jitter:g} s"
        _rates(axes, own, [row.tau_rho for row in own], marker=marker, markersize=4.5, color=colour, label=name)
    axes.set(yscale="log", xlim=(1.95, 6.1), xlabel="silence timeout in periods of the announcements, τ·ρ")
    axes.set_ylabel("false suspicions per pair and hour")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title(f"{loss:.0%} of the messages lost: only whole periods count")
    axes.legend(loc="lower left")
    return figure


def detection_time(rows: Sequence[Detections]) -> Figure:
    """How soon a dead robot is noticed, against loss."""
    figure = Figure(figsize=(9.6, 4.6))
    left, right = figure.subplots(1, 2, sharey=True)
    burst = max((row.burst for row in rows), default=0.0)
    shown = sorted({row.tau_rho for row in rows} & {2.01, 3.0, 5.0, 7.0, 10.0})
    for axes, length in ((left, 0.0), (right, burst)):
        axes.set(xlim=(0, 0.88), ylim=(-0.09, 2.4), xlabel="share of messages lost, p")
        axes.xaxis.set_major_formatter(PercentFormatter(1.0))
        ends = {}
        for number, tau_rho in enumerate(shown):
            own = [row for row in rows if row.tau_rho == tau_rho and row.burst == length]
            ends[tau_rho] = _one_detection_line(axes, own, (number - 2) * 0.008)
        _label_ends(axes, 0.83, ends, 0.045)
    left.set(title="Independent losses", ylabel="from death to detection, in seconds")
    right.set_title(f"Bursts of {burst:g} messages on average, same share lost")
    real = any(row.source == "real" for row in rows)
    _legend(left, real=real, measured="median, 10 % to 90 %", columns=3)
    return figure


def _one_detection_line(axes: "Axes", rows: Sequence[Detections], shift: float) -> float:
    """Draw the median by the law and what was timed, moved aside by `shift`; where the law ends."""
    tau_rho, burst = rows[0].tau_rho, rows[0].burst or None
    colour = COLOURS[tau_rho]
    shares = np.linspace(0.01, 0.8, 40)
    law = [detection_quantile(0.5, Loss(float(share), burst), Timing(tau_rho / RATE)) for share in shares]
    axes.plot(shares, law, linestyle="--", linewidth=1.2, color=colour)
    styles: dict[str, dict[str, Any]] = {
        "simulated": {"marker": "o", "markersize": 4.5, "color": colour},
        "real": _REAL | {"markerfacecolor": colour},
    }
    for source, look in styles.items():
        own = [row for row in rows if row.source == source]
        if own:
            middle = np.array([row.p50 for row in own])
            spread = np.abs(np.array([[row.p10 for row in own], [row.p90 for row in own]]) - middle)
            places = [row.loss + shift + (0.014 if source == "real" else 0.0) for row in own]
            axes.errorbar(places, middle, yerr=spread, linestyle="none", elinewidth=1, **look)
    return law[-1]


def mission_cost(rows: Sequence[Cost]) -> Figure:
    """Makespan, takeovers that were not needed and doubled work against loss, without and with a crash."""
    figure = Figure(figsize=(9.6, 7.6))
    grid = figure.subplots(3, 2, sharex=True, sharey="row")
    values = sorted({row.tau_rho for row in rows})
    middle = min(values, key=lambda value: abs(value - 5))
    reference = {row.seed: row.makespan for row in rows if not row.crash and row.loss == 0 and row.tau_rho == middle}
    for column, crash in enumerate((0, 1)):
        own = [row for row in rows if row.crash == crash and row.seed in reference]
        for tau_rho in values:
            line = [row for row in own if row.tau_rho == tau_rho]
            _means(grid[0][column], line, [row.makespan / reference[row.seed] for row in line])
            _means(grid[1][column], line, [float(row.needless) for row in line])
            _means(grid[2][column], line, [row.doubled for row in line])
        grid[0][column].set_title("Nobody fails" if not crash else "One robot crashes")
        grid[2][column].set_xlabel("share of messages lost on every link, p")
        grid[2][column].xaxis.set_major_formatter(PercentFormatter(1.0))
        grid[2][column].yaxis.set_major_formatter(PercentFormatter(1.0))
    grid[0][0].set_ylabel("makespan, relative to\nno loss and no crash")
    grid[1][0].set_ylabel("takeovers from robots\nthat had not failed")
    grid[2][0].set_ylabel("share of work that\na teammate was doing")
    marks = [Line2D([], [], color=COLOURS[value], marker="o", markersize=4, label=_name(value)) for value in values]
    grid[1][0].legend(handles=marks, title="τ·ρ", loc="upper left", ncols=2)
    return figure


def _means(axes: "Axes", rows: Sequence[Cost], values: Sequence[float]) -> None:
    """The mean of `values` at each loss, in a band that is its 95 % interval."""
    losses = sorted({row.loss for row in rows})
    groups = [np.array([value for row, value in zip(rows, values, strict=True) if row.loss == loss]) for loss in losses]
    means = np.array([group.mean() for group in groups])
    errors = np.array([WIDE * group.std(ddof=1) / math.sqrt(len(group)) for group in groups])
    colour = COLOURS[rows[0].tau_rho]
    axes.fill_between(losses, means - errors, means + errors, color=colour, alpha=0.13, linewidth=0)
    axes.plot(losses, means, color=colour, marker="o", markersize=3.5, linewidth=1.3)
