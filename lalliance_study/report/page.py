"""The page: claims with their verdicts first, then a section for each question."""

from collections.abc import Iterator, Mapping, Sequence

from lalliance_study.report.claims import REFUTED, SOMEWHERE, Claim, Finding
from lalliance_study.report.comparisons import MARGIN
from lalliance_study.report.independent import ALIKE, known
from lalliance_study.report.markdown import bullets, figure, number, table
from lalliance_study.report.results import FEWEST, Results
from lalliance_study.report.sections import SECTIONS, Section
from lalliance_study.report.tables import HAND_OVERS

Findings = Mapping[str, Mapping[str, Finding]]


def findings(results: Results) -> Findings:
    """What became of each claim, by its key and hand-over."""
    return {
        claim.key: {rule: claim.judged(_found(results, claim, rule)) for rule in HAND_OVERS}
        for section in SECTIONS
        for claim in section.claims
    }


def _found(results: Results, claim: Claim, rule: str) -> list["Measured"]:
    return results.of(claim.experiment, lambda one: one.hand_over == rule and claim.wanted(one))
