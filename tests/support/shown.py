"""Pages that show files of this repository, each in a made part of its name; `python tests/support/shown.py` renews all."""

from pathlib import Path

from lalliance_study.markdown import renewed

ROOT = Path(__file__).parents[2]
LANGUAGES = {".py": "python", ".yaml": "yaml"}

#: Which files a page shows, whole.
SHOWN = {
    "docs/your-robot.md": [
        "examples/greenhouse/beds.py",
        "examples/greenhouse/gardener.py",
        "examples/greenhouse/greenhouse.yaml",
        "examples/greenhouse/test_greenhouse.py",
        "examples/patrol/patrol.yaml",
        "examples/patrol/watchman.py",
    ]
}


def shown(file: str) -> str:
    """The file as a block of code."""
    path = ROOT / file
    return f"```{LANGUAGES[path.suffix]}\n{path.read_text()}```\n"


def page_with(page: str, files: list[str]) -> str:
    """The page as it must be."""
    text = (ROOT / page).read_text()
    assert [file for file in files if f"<!-- {file} -->\n" not in text] == []
    return renewed(text, {file: lambda file=file: shown(file) for file in files})  # type: ignore[misc]


if __name__ == "__main__":
    for name, files in SHOWN.items():
        (ROOT / name).write_text(page_with(name, files))
