"""Files of the repository that a page shows whole, each in the part of its name."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

ROOT = Path(__file__).parents[2]
LANGUAGES = {".py": "python", ".yaml": "yaml"}

FILES = [
    "examples/greenhouse/beds.py",
    "examples/greenhouse/gardener.py",
    "examples/greenhouse/greenhouse.yaml",
    "examples/greenhouse/test_greenhouse.py",
    "examples/patrol/patrol.yaml",
    "examples/patrol/watchman.py",
    "examples/rounds/base.py",
    "examples/rounds/rounds.yaml",
]


def shown(file: str) -> str:
    """The file as a block of code."""
    path = ROOT / file
    return f"```{LANGUAGES[path.suffix]}\n{path.read_text()}```\n"


PARTS: dict[str, Callable[[], str]] = {file: partial(shown, file) for file in FILES}
