"""The report: a page and its figures from rows alone, and sentences for bad input that leave an older report as it was."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest
from support.made_up_study import make_up
from support.processes import Processes

from lalliance_agents.errors import UserError
from lalliance_agents.extras import MissingExtraError
from lalliance_study.drawing import style, write
from lalliance_study.report.claims import Claim
from lalliance_study.report.page import findings, page
from lalliance_study.report.report import report
from lalliance_study.report.results import Results
from lalliance_study.report.sections import CLAIMS, SECTIONS, Section
from lalliance_study.scenarios import Scenario
from mission_control import study_command


def factor(scenario: Scenario, contender: str) -> float:
    """Some finish nothing, some are slower; whatever it is, there is a report."""
    if contender == "alliance" and scenario.hand_over == "restart":
        return float("nan")
    return 1.1 + 0.1 * len(contender) / 10 + scenario.heterogeneity / 10_000


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A small study, whole."""
    return Results(make_up(tmp_path_factory.mktemp("made-up") / "study", factor, missions=4))


@pytest.fixture(scope="module")
def text(results: Results) -> str:
    """Its page."""
    return page(results, findings(results))


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A study of which only one experiment was run."""
    return make_up(tmp_path / "study", factor, missions=4, only=("growth",))


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A folder with an older report, which must stay as it is."""
    folder = tmp_path / "old"
    folder.mkdir()
    (folder / "report.md").write_text("old")
    return folder


def made(study: Path, out: Path) -> dict[str, bytes]:
    """The files of a report."""
    report(Results(study), out, lambda *_: None)
    return {path.name: path.read_bytes() for path in out.iterdir()}


def refused(study: Path, old: Path) -> str:
    """What is said of a study that cannot be reported; nothing is overwritten."""
    with pytest.raises(UserError) as caught:
        study_command.report(study, old)
    assert [path.name for path in old.iterdir()] == ["report.md"]
    assert (old / "report.md").read_text() == "old"
    return str(caught.value)


def test_the_same_rows_give_the_same_report(study: Path, tmp_path: Path) -> None:
    """Byte by byte, in both forms."""
    first = made(study, tmp_path / "first")
    assert first == made(study, tmp_path / "second")
    assert first.keys() == {"report.md", "growth.png", "growth.svg"}


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
def test_each_section_draws_its_figures(section: Section, results: Results, tmp_path: Path) -> None:
    own = results.of(section.experiment)
    with style():
        paths = write({one.name: one.draw(own) for one in section.drawings}, tmp_path, ["svg"])
    assert all(path.stat().st_size for path in paths)


def test_the_page_begins_with_the_claims_and_leads_to_each(text: str) -> None:
    assert next(re.finditer(r"^## (.*)$", text, re.MULTILINE))[1] == "Claims and verdicts"
    for claim in CLAIMS:
        assert f"](#{claim.key.lower()})" in text
        assert f'<a name="{claim.key.lower()}"></a>' in text
    assert "$" not in text


def test_the_page_shows_every_figure(text: str) -> None:
    shown = re.findall(r"\]\(([^)#]+)\.png\)", text)
    assert shown == [one.name for section in SECTIONS for one in section.drawings]


def test_too_few_missions_are_said_to_be_too_few(text: str) -> None:
    assert "4 missions a scenario; a verdict needs 20." in text
    assert "**reproduced**" not in text


def test_missions_that_were_not_finished_are_told(text: str) -> None:
    assert "| ALLIANCE, set by hand | 100.0% unfinished |" in text


def test_an_experiment_that_was_not_run_is_said_to_be_missing(study: Path, tmp_path: Path) -> None:
    files = made(study, tmp_path / "out")
    assert "Experiment `strategies` is not in these results." in files["report.md"].decode()
    assert files.keys() == {"report.md", "growth.png", "growth.svg"}


def test_an_incomplete_study_is_reported_and_says_so(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    next((study / "rows").iterdir()).unlink()
    study_command.report(study, tmp_path / "out")
    found = re.search(r"\*\*Incomplete: (\d+) of (\d+) parts are missing", (tmp_path / "out" / "report.md").read_text())
    assert found is not None
    missing, every = map(int, found.groups())
    assert every - missing == len(list((study / "rows").iterdir()))
    assert capsys.readouterr().err == (
        f"lalliance: warning: {missing} of {every} parts are missing; "
        f"lalliance study run --preset mini --missions 4 --seed 0 --out {study} goes on with them\n"
    )


def test_a_study_of_which_nothing_was_done_is_reported_too(study: Path, tmp_path: Path) -> None:
    shutil.rmtree(study / "rows")
    study_command.report(study, tmp_path / "out")
    assert (tmp_path / "out" / "report.md").read_text().count("is not in these results.") == len(SECTIONS)


def test_by_default_the_report_is_in_the_folder_of_the_study(study: Path) -> None:
    study_command.report(study)
    assert (study / "report" / "report.md").exists()


def test_an_older_report_is_replaced(study: Path, old: Path) -> None:
    study_command.report(study, old)
    assert (old / "report.md").read_text().startswith("# The study")


def test_a_folder_that_is_no_study_is_refused(tmp_path: Path, old: Path) -> None:
    assert refused(tmp_path / "nowhere", old) == (
        f"{tmp_path / 'nowhere' / 'MANIFEST.json'}: No such file or directory; expected the folder of a study"
    )
    (tmp_path / "MANIFEST.json").write_text("{}")
    assert "expected what lalliance study run writes" in refused(tmp_path, old)
    (tmp_path / "MANIFEST.json").write_text("[1")
    assert "expected what lalliance study run writes" in refused(tmp_path, old)


def test_results_of_another_version_are_refused(study: Path, old: Path) -> None:
    path = study / "MANIFEST.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "lalliance": "0.0.9"}))
    assert refused(study, old) == f"{path}: results of lalliance 0.0.9; expected lalliance {manifest['lalliance']}"
    path.write_text(json.dumps({**manifest, "format": 99, "new": 1}))
    assert refused(study, old).startswith(f"{path}: format 99 of lalliance {manifest['lalliance']}; expected format ")


def test_results_of_other_experiments_than_this_version_has_are_refused(study: Path, old: Path) -> None:
    path = study / "MANIFEST.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "experiments": manifest["experiments"][1:]}))
    assert refused(study, old) == (
        f"{path}: other experiments than preset mini has in this version; expected results of this version"
    )


def test_rows_that_were_cut_off_are_refused(study: Path, old: Path) -> None:
    path = sorted((study / "rows").iterdir())[-1]
    path.write_bytes(path.read_bytes()[:-100])
    said = refused(study, old)
    assert said.startswith(f"{study}: rows that cannot be read (")
    assert said.endswith("); expected what lalliance study run wrote")


@pytest.mark.parametrize("module", ["matplotlib", "polars", "scipy"])
def test_a_missing_package_is_named(module: str, study: Path, old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"the package {module}, .* pip install 'lalliance\[study\]'"):
        study_command.report(study, old)
    assert (old / "report.md").read_text() == "old"


def test_a_report_that_fails_midway_leaves_the_old_one(study: Path, old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def break_(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr(Claim, "judged", break_)
    with pytest.raises(RuntimeError):
        study_command.report(study, old)
    assert [path.name for path in old.iterdir()] == ["report.md"]
    assert (old / "report.md").read_text() == "old"


def test_a_place_that_is_no_folder_is_refused(study: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(UserError, match="expected a folder that can be written to"):
        study_command.report(study, tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"


def test_bad_input_ends_with_2_and_one_sentence(tmp_path: Path) -> None:
    with Processes(tmp_path) as processes:
        done = processes.run("study", "report", str(tmp_path / "nowhere"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"lalliance: {tmp_path / 'nowhere' / 'MANIFEST.json'}: No such file or directory; expected the folder of a study\n"
    )
