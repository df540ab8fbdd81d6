"""The pages: what is made in them is what the code gives, their examples are good, and their links lead somewhere."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from made.links import without_links
from made.pages import PARTS, ROOT, made
from support.documents import PAGES, blocks

from lalliance_agents.mission_file import parse_mission
from lalliance_agents.model.parameters import Parameters
from mission_control.missions import load


@pytest.mark.parametrize("page", PARTS)
def test_what_is_made_is_up_to_date(page: str) -> None:
    assert (ROOT / page).read_text() == made(page), "`make docs` makes it anew"


def test_a_part_without_a_place_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PARTS["docs/model.md"], "nowhere", lambda: "")
    with pytest.raises(ValueError, match="no place for the part 'nowhere'"):
        made("docs/model.md")


def examples(page: str) -> list[dict[str, Any]]:
    """The mission that a page begins with, and what becomes of it with each of its further examples."""
    whole, *changes = [yaml.safe_load(block) for block in blocks(page, "yaml")]
    return [whole, *({**whole, **change} for change in changes)]


@pytest.mark.parametrize("page", ["docs/missions.md", "docs/getting-started.md"])
def test_every_example_of_a_mission_is_a_good_one(page: str, tmp_path: Path) -> None:
    for number, mission in enumerate(examples(page)):
        (tmp_path / f"{number}.yaml").write_text(yaml.safe_dump(mission, sort_keys=False))
        assert load(tmp_path / f"{number}.yaml", for_team=False).warnings() == []


@pytest.mark.parametrize("page", ["docs/parameters.md", "docs/model.md"])
def test_every_example_of_parameters_is_a_good_one(page: str) -> None:
    crate = {"name": "m", "tasks": {"crate": {}}, "robots": {"r": {"tasks": {"crate": 30}}}}
    for block in blocks(page, "yaml"):
        mission = parse_mission(yaml.safe_dump({**crate, **yaml.safe_load(block)}), "example")
        assert mission.parameters != Parameters()


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_what_is_there(page: str) -> None:
    text = re.sub(r"^```.*?^```", "", (ROOT / page).read_text(), flags=re.DOTALL | re.MULTILINE)
    without_links(text, str(Path(page).parent), set(), ROOT)


def test_a_link_out_of_the_site_becomes_a_path_and_one_to_nowhere_is_told() -> None:
    text = "[`keys.py`](../lalliance_agents/wire/keys.py) [the keys](../lalliance_agents/wire/keys.py#L1) [b](b.md) [w](https://w.org)"
    shown = without_links(text, "docs", {"b.md"}, ROOT)
    assert (
        shown
        == "`lalliance_agents/wire/keys.py` the keys (`lalliance_agents/wire/keys.py`) [b](b.md) [w](https://w.org)"
    )
    with pytest.raises(FileNotFoundError, match=r"leads to lalliance_agents/wire/kees\.py"):
        without_links("[k](../lalliance_agents/wire/kees.py)", "docs", set(), ROOT)
