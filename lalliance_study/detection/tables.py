"""The tables and numbers of `docs/failure-detection.md`, made from rows and from the law."""

import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean, quantiles, stdev

from lalliance_study import markdown
from lalliance_study.detection.cost import COVERAGE, CRASH_TIMES, OWN_TIMES, ROBOTS, TASKS
from lalliance_study.detection.law import Loss, Timing, detection_quantile, dispersion, needed_windows, suspicions
from lalliance_study.detection.plan import BURST, STAIRS_LOSS, TAU_RHOS
from lalliance_study.detection.probe import RATE
from lalliance_study.detection.reactions import FAULTS, TAU_RHO
from lalliance_study.detection.rows import Cost, Detections, Reaction, Suspicions, load

Table = list[list[str]]
HOUR = 3600.0
#: False suspicions per pair of robots and hour that somebody may be ready to bear.
TOLERATED = (60.0, 6.0, 1.0, 0.1)
CHOICES = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)


def renew(page: Path, rows: Path) -> None:
    """Replace the generated parts of a page."""
    page.write_text(renewed(page.read_text(), rows))


def renewed(text: str, rows: Path) -> str:
    """A page's text with its generated parts made anew."""
    return markdown.renewed(text, {name: partial(made, rows) for name, made in PARTS.items()})


def _markdown(table: Table) -> str:
    head, *body = table
    return markdown.table(head, body, right=True)


def setup(rows: Path) -> str:
    """What was measured, in a list."""
    counted = load(rows / "suspicions.csv", Suspicions)
    timed, missions = load(rows / "detections.csv", Detections), load(rows / "costs.csv", Cost)
    scenes = load(rows / "reactions.csv", Reaction)
    manifest = json.loads((rows / "manifest.json").read_text())
    whole = [row for row in counted if row.tau_rho in TAU_RHOS and not row.jitter]
    listened = [row.seconds / HOUR for row in whole]
    lines = [
        f"ρ = {RATE:g} messages per second, control period {Timing(1.0).control:g} s; every message is 1 ms under way",
        f"bursts lose {BURST:g} messages on average",
        f"false suspicions: {len(whole)} settings of loss and τ·ρ, {min(listened):.1f} to {max(listened):.1f} hours each",
        f"detection time: {timed[0].crashes} deaths in each of {len(timed)} settings",
        f"mission cost: {len({row.seed for row in missions})} missions in {len({row[1:4] for row in missions})} settings",
        f"a mission has {ROBOTS} robots and {TASKS} tasks, of which each can be done by {COVERAGE} robots",
        f"own times are {OWN_TIMES[0]:g} to {OWN_TIMES[1]:g} s; a crash comes after {CRASH_TIMES[0]:g} to {CRASH_TIMES[1]:g} s",
        f"failures: {len({row.seed for row in scenes})} scenes for each, with τ·ρ = {TAU_RHO:g}",
        f"all from seed {manifest['seed']}, in {manifest['parts']:,} parts",
    ]
    return "".join(f"- {line}\n" for line in lines)


def choose(_: Path) -> str:
    """How to choose tau: the smallest k + 1/2 periods that keep false suspicions below what is tolerated."""
    table = [["loss p", *(f"≤ {tolerated:g} per hour" for tolerated in TOLERATED)]]
    for kind in (None, BURST):
        for share in CHOICES:
            loss = Loss(share, kind)
            counts = [needed_windows(loss, RATE, tolerated) for tolerated in TOLERATED]
            name = f"{share:.0%}" if kind is None else f"{share:.0%}, bursts of {kind:g}"
            table.append([name, *(f"{count + 0.5:g} ({(count + 0.5) / RATE:.1f} s)" for count in counts)])
    return _markdown(table)


def trade(rows: Path) -> str:
    """What the law promises against what was measured, for independent losses of 30 %."""
    counted = [
        row for row in load(rows / "suspicions.csv", Suspicions) if (row.loss, row.burst, row.jitter) == (0.3, 0, 0)
    ]
    timed = {row.tau_rho: row for row in load(rows / "detections.csv", Detections) if (row.loss, row.burst) == (0.3, 0)}
    table = [["τ·ρ", "false suspicions per pair and hour", "law", "median detection", "law", "99 %", "τ + h"]]
    for row in counted:
        if row.tau_rho not in timed:
            continue
        loss, timing = Loss(row.loss), Timing(row.tau_rho / RATE)
        seen = timed[row.tau_rho]
        table.append(
            [
                f"{row.tau_rho:g}",
                f"{row.times / row.seconds * HOUR:.3g} ({row.times} counted)",
                f"{suspicions(loss, timing) * HOUR:.3g}",
                f"{seen.p50:.2f} s",
                f"{detection_quantile(0.5, loss, timing):.2f} s",
                f"{seen.p99:.2f} s",
                f"{timing.tau + timing.control:.2f} s",
            ]
        )
    return _markdown(table)


def agreement(rows: Path) -> str:
    """In a sentence, how well the law fits all that was counted and timed in the simulator."""
    counted = load(rows / "suspicions.csv", Suspicions)
    texts = []
    for kind, chosen in (("independent losses", 0.0), ("bursts", BURST)):
        whole = [row for row in counted if row.burst == chosen and row.jitter == 0 and row.tau_rho in TAU_RHOS]
        misses = [_deviation(row) for row in whole]
        outside = sum(abs(miss) > 1.96 for miss in misses)
        total = sum(row.times for row in whole)
        expected = sum(suspicions(*_setting(row)) * row.seconds for row in whole)
        texts.append(
            f"for {kind}, {len(misses) - outside} of {len(misses)} settings lie within 1.96 standard errors of the law, the "
            f"farthest at {max(map(abs, misses)):.1f} ({total:,} false suspicions, where the law expects {expected:,.0f})"
        )
    timed = load(rows / "detections.csv", Detections)
    far = [abs(row.p50 - detection_quantile(0.5, *_setting(row))) for row in timed]
    return (
        f"Law and simulator: {'; '.join(texts)}. The {len(far)} medians of detection time differ from the law by at most "
        f"{max(far):.2f} s, on average by {fmean(far):.3f} s.\n"
    )


def _setting(row: Suspicions | Detections) -> tuple[Loss, Timing]:
    return Loss(row.loss, row.burst or None), Timing(row.tau_rho / RATE)


def _deviation(row: Suspicions) -> float:
    """How far a count lies from the law, in standard errors (of a square root, which is nearly normal for small counts too)."""
    expected = suspicions(*_setting(row)) * row.seconds
    scatter = math.sqrt(dispersion(*_setting(row)))
    return 2 * (math.sqrt(row.times + 0.375) - math.sqrt(expected + 0.375)) / scatter


def real(rows: Path) -> str:
    """The points repeated in real runs, beside law and simulator."""
    counted = load(rows / "suspicions-real.csv", Suspicions)
    timed = {(row.loss, row.tau_rho): row for row in load(rows / "detections-real.csv", Detections)}
    model = {(row.loss, row.tau_rho): row for row in load(rows / "detections.csv", Detections) if row.burst == 0}
    table = [
        ["p, τ·ρ", "false suspicions counted", "law expects", "deaths timed", "median detection", "simulated", "law"]
    ]
    for row in counted:
        loss, timing = _setting(row)
        own = timed[row.loss, row.tau_rho]
        table.append(
            [
                f"{row.loss:g}, {row.tau_rho:g}",
                f"{row.times} in {row.seconds:.0f} s",
                f"{suspicions(loss, timing) * row.seconds:.1f}",
                str(own.crashes),
                f"{own.p50:.2f} s ({own.low:.2f} to {own.high:.2f})",
                f"{model[row.loss, row.tau_rho].p50:.2f} s",
                f"{detection_quantile(0.5, loss, timing):.2f} s",
            ]
        )
    return _markdown(table)


def pace(rows: Path) -> str:
    """Whether the real runs kept their pace."""
    notes = json.loads((rows / "real.json").read_text())
    periods, missed = (sum(note[name] for note in notes) for name in ("periods", "missed"))
    speeds = " and ".join(sorted({f"{note['speed']:g}" for note in notes}))
    return f"At speed {speeds}, {missed} of {periods:,} control periods were missed.\n"


def late(rows: Path) -> str:
    """In a sentence, what late messages cost at a whole number of periods, and half a period above it."""
    found = {
        (row.tau_rho, row.jitter): row for row in load(rows / "suspicions.csv", Suspicions) if row.loss == STAIRS_LOSS
    }
    most = max(jitter for _, jitter in found)
    texts = []
    for tau_rho in (3.0, 3.5):
        row = found[tau_rho, most]
        expected = suspicions(*_setting(row)) * row.seconds
        texts.append(f"{row.times / expected:.2f} times what the law says at τ·ρ = {tau_rho:g}")
    return f"Where messages are late by up to {most:g} s, there are {' and '.join(texts)}.\n"


def reactions(rows: Path) -> str:
    """For each failure: who notices, how, after how long, and what it costs."""
    found = load(rows / "reactions.csv", Reaction)
    table = [["failure", "counted as silent after", "first decision that follows", "after", "mission longer by"]]
    for fault in FAULTS:
        own = [row for row in found if row.fault == fault]
        words = Counter(f"{row.who}: {row.what}" if row.what else "nobody" for row in own)
        what = "; ".join(
            word if count == len(own) else f"{word} ({count} of {len(own)})" for word, count in words.most_common()
        )
        spans = [
            _span([value for value in values if not math.isnan(value)], len(own))
            for values in ([row.silent for row in own], [row.decided for row in own], [row.delay for row in own])
        ]
        table.append([fault, spans[0], what, spans[1], spans[2]])
    return _markdown(table)


def _span(values: Sequence[float], scenes: int) -> str:
    """Median, and from the 5th to the 95th percentile; and in how many scenes, if not in all."""
    if len(values) < 2:
        return "never"
    cut = quantiles(values, n=20, method="inclusive")
    if max(map(abs, values)) < 0.005:
        return "0 s"
    told = ".2f" if cut[9] < 5 else ".1f"
    span = f"{cut[9]:{told}} s ({cut[0]:{told}} to {cut[18]:{told}})"
    return span if len(values) == scenes else f"{span}, in {len(values)} of {scenes}"


def costs(rows: Path) -> str:
    """Makespan, needless takeovers and doubled work for some losses, relative to the same missions without loss or crash."""
    found = load(rows / "costs.csv", Cost)
    values = sorted({row.tau_rho for row in found})
    middle = min(values, key=lambda value: abs(value - 5))
    reference = {row.seed: row.makespan for row in found if not row.crash and row.loss == 0 and row.tau_rho == middle}
    table = [["crash, p", *(f"τ·ρ = {value:g}" for value in values)]]
    for crash in (0, 1):
        for loss in (0.0, 0.3, 0.6, 0.8):
            line = [f"{'one crash' if crash else 'none'}, {loss:.0%}"]
            for value in values:
                own = [row for row in found if (row.crash, row.loss, row.tau_rho) == (crash, loss, value)]
                ratio = fmean(row.makespan / reference[row.seed] for row in own)
                line.append(
                    f"{ratio:.3f} / {fmean(row.needless for row in own):.1f} / {fmean(row.doubled for row in own):.1%}"
                )
            table.append(line)
    return _markdown(table)


def pairs(rows: Path) -> str:
    """By how much makespans differ between two settings, mission by mission, with 95 % intervals."""
    makespans = {(row.seed, row.crash, row.loss, row.tau_rho): row.makespan for row in load(rows / "costs.csv", Cost)}
    seeds = sorted({key[0] for key in makespans})

    def change(one: tuple[int, float, float], other: tuple[int, float, float]) -> str:
        changes = [makespans[seed, *one] / makespans[seed, *other] - 1 for seed in seeds]
        return f"{fmean(changes):+.1%} ± {1.96 * stdev(changes) / math.sqrt(len(changes)):.1%}"

    table = [["crash, p", "τ·ρ = 2.01 against 5", "τ·ρ = 10 against 5", "loss against none, τ·ρ = 5"]]
    for crash in (0, 1):
        for loss in (0.0, 0.3, 0.5, 0.6, 0.7, 0.8):
            plain = (crash, loss, 5.0)
            others = [
                change((crash, loss, 2.01), plain), change((crash, loss, 10.0), plain), change(plain, (crash, 0.0, 5.0))
            ]  # fmt: skip
            table.append([f"{'one crash' if crash else 'none'}, {loss:.0%}", *others])
    return _markdown(table)


PARTS: dict[str, Callable[[Path], str]] = {
    "setup": setup,
    "late": late,
    "pace": pace,
    "agreement": agreement,
    "trade": trade,
    "choose": choose,
    "reactions": reactions,
    "costs": costs,
    "pairs": pairs,
    "real": real,
}
