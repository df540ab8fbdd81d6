"""The page: what `page.md` says, with everything that was measured in its places."""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from string import Template

import numpy as np

from lalliance_study.markdown import table
from lalliance_study.report.claims import REFUTED, SOMEWHERE, Claim, Finding
from lalliance_study.report.comparisons import MARGIN
from lalliance_study.report.independent import ALIKE, known
from lalliance_study.report.markdown import figure, number
from lalliance_study.report.results import FEWEST, Measured, Results
from lalliance_study.report.sections import CLAIMS, SECTIONS, Section
from lalliance_study.report.statistics import CONFIDENCE
from world_server.environments.task_pool import HAND_OVERS

Findings = Mapping[str, Mapping[str, Finding]]
"""What became of each claim, by its key and hand-over."""


def findings(results: Results) -> Findings:
    """Judge all claims."""
    return {claim.key: {rule: _finding(results, claim, rule) for rule in HAND_OVERS} for claim in CLAIMS}


def _finding(results: Results, claim: Claim, rule: str) -> Finding:
    return claim.judged(results.of(claim.experiment, lambda one: one.hand_over == rule and claim.wanted(one)))


def page(results: Results, found: Findings) -> str:
    """The whole page, in Markdown."""
    text = files("lalliance_study.report").joinpath("page.md").read_text()
    return Template(text).substitute(
        {section.name: _section(results, found, section) for section in SECTIONS},
        setup=_setup(results),
        verdicts=_verdicts(found),
        independent=_independent(results),
        measured=_measured(results),
        confidence=_percent(CONFIDENCE),
        margin=_percent(MARGIN),
        refuted=_percent(REFUTED),
        somewhere=_percent(SOMEWHERE),
        fewest=FEWEST,
    )


def _percent(share: float) -> str:
    return f"{share:.0%}".replace("%", " %")


def _command(results: Results) -> str:
    manifest = results.manifest
    return f"lalliance study run --preset {manifest.preset} --missions {manifest.missions} --seed {manifest.seed}"


def _setup(results: Results) -> str:
    """Where the numbers come from, and what is missing of them."""
    told = (
        "Made by `lalliance study report` from the rows, and nothing but the rows, of\n"
        f"`{_command(results)}`\n(lalliance {results.manifest.lalliance}).\n"
    )
    if results.missing:
        told += (
            f"\n**Incomplete: {results.missing:,} of {results.parts:,} parts are missing.** What follows is said of those that "
            "are there. The same command, with `--out` and the folder of the rows, goes on with the rest.\n"
        )
    return told


def _verdicts(found: Findings) -> str:
    """All claims in a table."""
    body = [
        [
            f"[{claim.title}](#{claim.key.lower()})",
            claim.where,
            claim.effect,
            *(_short(found[claim.key][rule]) for rule in HAND_OVERS),
        ]
        for claim in CLAIMS
    ]
    return table(["claim", "in the paper", "effect", *HAND_OVERS], body)


def _short(finding: Finding) -> str:
    told = f"**{finding.word}**"
    return told if finding.effect is None else f"{told}<br>{number(finding.effect, 2)}"


def _section(results: Results, found: Findings, section: Section) -> str:
    """Figures, claims and numbers of a section, and how to repeat it."""
    if not (own := results.of(section.experiment)):
        return f"Experiment `{section.experiment}` is not in these results.\n"
    lines = [figure(one.name, one.caption) for one in section.drawings]
    lines += [_claim(claim, found[claim.key]) for claim in section.claims]
    if section.table is not None:
        lines.append(section.table(own))
    return "\n".join([*lines, _repeat(results, section, own)])


def _claim(claim: Claim, found: Mapping[str, Finding]) -> str:
    body = [[rule, finding.word, number(finding.effect), finding.detail] for rule, finding in found.items()]
    return "\n".join(
        [
            f'<a name="{claim.key.lower()}"></a>\n\n### {claim.title}\n',
            f"*The paper* ({claim.where}): {claim.says}\n",
            f"*Test*: {claim.rule}\n",
            table(["hand-over", "verdict", claim.effect, "in numbers"], body),
        ]
    )


def _repeat(results: Results, section: Section, own: Sequence[Measured]) -> str:
    counts = sorted({one.missions for one in own})
    missions = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return (
        f"*{len(own):,} scenarios of {missions} missions. To repeat it:*\n"
        f"`{_command(results)} --only {section.experiment} --out DIR`, then `lalliance study report DIR`.\n"
    )


def _independent(results: Results) -> str:
    words = {True: "yes", False: "**no**", None: "not in these results"}
    body = [[one.what, f"{one.theirs:g}", number(one.ours), words[one.agrees]] for one in known(results)]
    return table(["", "there", "here", f"alike within {ALIKE:.0%}"], body, right=True)


def _measured(results: Results) -> str:
    """What was measured, and how many missions were not finished."""
    body = []
    for name, asked in results.asked.items():
        times = [times for one in results.of(name) for times in one.times.values()]
        runs, left = sum(map(len, times)), sum(int(np.isnan(one).sum()) for one in times)
        scenarios = f"{len(results.of(name)):,}"
        body.append([name, asked.asks, scenarios, str(len(asked.contenders)), f"{runs:,}", f"{left:,}"])
    packages = ", ".join(f"{name} {version}" for name, version in results.manifest.packages.items())
    return "\n".join(
        [
            table(["experiment", "asks", "scenarios", "contenders", "missions run", "not finished"], body),
            f"With {packages}; begun on {', '.join(results.manifest.machine.values())}.\n",
        ]
    )
