"""Missions that a campaign found, made small: each once showed a defect, and must hold from then on."""

from pathlib import Path

import pytest

from lalliance_agents.mission_file import load_mission
from lalliance_study.campaign import check_fully
from lalliance_study.promises import promise

FOUND = sorted((Path(__file__).parent / "found").glob("*.yaml"))


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_what_was_found_once_holds_now(path: Path) -> None:
    assert check_fully(load_mission(path)) == []


def test_missions_that_were_found_not_to_complete_are_promised_to() -> None:
    """Or their replay would prove nothing."""
    for name in ("overtaken-senses", "step-from-before-a-pause", "ghost-of-a-former-life", "a-lone-robot-turns-often"):
        mission = load_mission(Path(__file__).parent / "found" / f"{name}.yaml")
        assert 0 < (promise(mission).seconds or 0.0) < mission.deadline, name
