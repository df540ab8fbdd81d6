"""Pages that name tests and kinds of faults name such as there are, and all that they must."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest
from support.documents import ROOT

from lalliance_agents.faults import Fault, LinkFault, Partition
from lalliance_study.detection.tables import reactions

DOCS = sorted((ROOT / "docs").glob("*.md"))


def kinds() -> Iterator[str]:
    """Every kind of fault of a robot, and every aspect of a link's fault, as a mission file spells it."""
    for one in get_args(Fault):
        if one is LinkFault:
            yield from one.model_fields.keys() - {"at", "until", "link", "held"}
        elif one is Partition:
            yield "partition"
        else:
            yield from get_args(one.model_fields["kind"].annotation)


def test_every_kind_of_fault_has_a_row() -> None:
    page = (ROOT / "docs" / "faults.md").read_text()
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ")]
    named = {name for first in rows for name in re.findall(r"`(\w+)`", first)}
    assert set(kinds()) <= named


@pytest.mark.parametrize("page", DOCS, ids=lambda page: page.name)
def test_tests_that_a_page_names_are_there(page: Path) -> None:
    named = set(re.findall(r"`(test_\w+)`", page.read_text()))
    there = {
        name for path in (ROOT / "tests").rglob("test_*.py") for name in re.findall(r"def (test_\w+)", path.read_text())
    }
    assert named <= there


def test_the_table_of_failures_names_a_test_for_each() -> None:
    page = (ROOT / "docs" / "faults.md").read_text()
    rows = [
        line
        for line in page.splitlines()
        if line.startswith("| ") and not line.startswith(("| fault |", "| what |", "| ---"))
    ]
    assert len(rows) > 30
    assert [row for row in rows if "`test_" not in row.split("|")[-2]] == []


def test_what_the_comparison_says_of_the_study_stands_in_its_report() -> None:
    page, report = ((ROOT / "docs" / name).read_text() for name in ("comparison.md", "study/report.md"))
    told = {"CBBA": (1.06, 0.94), "optimum, repaired": (0.88, 0.78), "ALLIANCE, set by hand": (1.43, None)}
    for who, (kept, anew) in told.items():
        rows = re.findall(rf"^\| {who} \| ([\d.]+%?)", report, flags=re.MULTILINE)
        assert rows[0] == f"{kept:.2f}"
        assert f"{kept:.2f}" in page
        assert anew is None or (rows[-1] == f"{anew:.2f}" and f"{anew:.2f}" in page)


def test_what_the_table_of_failures_says_of_scenes_stands_in_their_rows() -> None:
    scenes, _, _ = (ROOT / "docs" / "faults.md").read_text().partition("## What stands around")
    rows = reactions(ROOT / "docs" / "faults" / "rows")
    spans = set(
        re.findall(
            r"[\d.]+ s \([\d.]+ to [\d.]+\)",
            scenes.partition("| the whole team")[0] + scenes.partition("## What robots")[2],
        )
    )
    assert len(spans) >= 6
    assert [span for span in spans if span not in rows] == []
