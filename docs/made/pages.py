"""Which parts are made, and in which pages they stand."""

from collections.abc import Callable
from pathlib import Path

from lalliance_study.markdown import renewed
from made import commands, examples, missions, model, parameters

ROOT = Path(__file__).parents[2]

#: Page -> name of a part -> what makes it.
PARTS: dict[str, dict[str, Callable[[], str]]] = {
    "README.md": {"commands": lambda: commands.overview("docs/")},
    "docs/commands.md": {"commands": commands.reference},
    "docs/missions.md": dict(missions.PARTS),
    "docs/parameters.md": dict(parameters.PARTS),
    "docs/model.md": dict(model.PARTS),
    "docs/your-robot.md": dict(examples.PARTS),
}


def made(page: str) -> str:
    """A page's text with all its parts made anew.

    Raises:
        ValueError: a part has no place in its page.
    """
    text = (ROOT / page).read_text()
    for name in PARTS[page]:
        if f"<!-- {name} -->\n" not in text:
            raise ValueError(f"{page} has no place for the part {name!r}")
    return renewed(text, PARTS[page])


def renew() -> None:
    """Write all pages anew."""
    for page in PARTS:
        (ROOT / page).write_text(made(page))
