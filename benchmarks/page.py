"""The made parts of `docs/performance.md`, from the figures beside it.

python benchmarks/page.py             renew them
python benchmarks/page.py --check     only tell, with exit status 1, whether they are not what the figures give
"""

import argparse
import json
from collections.abc import Mapping
from functools import partial
from typing import Any

from suite import BENCHMARKS, FIGURES

from lalliance_study.markdown import renewed, table

PAGE = FIGURES.with_suffix(".md")
#: What every benchmark tells of the machine; the rest are versions of packages.
MACHINE = ("processor", "cores", "system", "python")


def kept(name: str) -> dict[str, Any] | None:
    """The figures of a benchmark; None: there are none."""
    path = FIGURES / f"{name}.json"
    found: dict[str, Any] | None = json.loads(path.read_text()) if path.exists() else None
    return found


def part(name: str) -> str:
    """The part of one benchmark: its table, and what it says under it."""
    figures = kept(name)
    if figures is None:
        return "\nNot measured yet.\n\n"
    notes = "".join(f"- {note}\n" for note in figures["notes"])
    packages = [f"{one} {version}" for one, version in figures["machine"].items() if one not in MACHINE]
    shown = table(figures["table"]["head"], figures["table"]["body"], right=True)
    return f"\n**{figures['title']}** ({', '.join(packages)})\n\n{shown}\n{notes}{notes and chr(10)}"


def machines() -> str:
    """Where the figures come from; usually a single machine."""
    told: dict[str, list[str]] = {}
    for name in BENCHMARKS:
        if figures := kept(name):
            told.setdefault(_told(figures["machine"]), []).append(f"`{name}`")
    lines = [one if len(told) == 1 else f"{one}: {', '.join(names)}" for one, names in told.items()]
    return "".join(f"- {line}\n" for line in lines) or "Nothing is measured yet.\n"


def _told(machine: Mapping[str, Any]) -> str:
    return f"{machine['processor']}, {machine['cores']} cores, {machine['system']}, Python {machine['python']}"


def made(text: str) -> str:
    """The page's text with all parts made anew."""
    return renewed(text, {"machine": machines, **{name: partial(part, name) for name in BENCHMARKS}})


def renew() -> None:
    """Renew the page."""
    PAGE.write_text(made(PAGE.read_text()))


def main() -> None:
    """Run from the command line."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--check", action="store_true", help="change nothing")
    if not arguments.parse_args().check:
        renew()
        return
    text = PAGE.read_text()
    missing = [name for name in BENCHMARKS if f"<!-- {name} -->\n" not in text]
    if missing:
        raise SystemExit(f"{PAGE.name} has no part for {', '.join(missing)}")
    if made(text) != text:
        raise SystemExit(f"{PAGE.name} is not what the figures give; expected what `python benchmarks/page.py` makes")


if __name__ == "__main__":
    main()
