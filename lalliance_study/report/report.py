"""Makes the report: a page and its figures, all of them or none."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from lalliance_agents.errors import UserError
from lalliance_study.drawing import style, write
from lalliance_study.report.page import findings, page
from lalliance_study.report.results import Results
from lalliance_study.report.sections import SECTIONS

PAGE = "report.md"


def report(results: Results, out: Path, advance: Callable[[int, str], None]) -> Path:
    """Write the report into a folder; what is there of an older one is replaced when all is made, and else left alone.

    Args:
        results: what is reported.
        out: the folder, which is made if need be.
        advance: told that one of the `steps` is done.

    Returns:
        The page.

    Raises:
        UserError: rows cannot be read, or the folder cannot be written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out, prefix=".unfinished-") as place:
            made = _make(results, Path(place), advance)
            for path in made:
                path.replace(out / path.name)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}; expected a folder that can be written to") from error
    return out / PAGE


def steps() -> int:
    """How many steps it takes."""
    return len(SECTIONS) + 1


def _make(results: Results, place: Path, advance: Callable[[int, str], None]) -> list[Path]:
    made = []
    with style():
        for section in SECTIONS:
            if own := results.of(section.experiment):
                made += write({one.name: one.draw(own) for one in section.drawings}, place)
            advance(1, section.name)
    path = place / PAGE
    path.write_text(page(results, findings(results)))
    advance(1, PAGE)
    return [*made, path]
