"""Run every benchmark, one after the other, each in a process of its own, and renew the page that shows what came of them.

    python benchmarks/all.py             figures into docs/performance, tables into docs/performance.md
    python benchmarks/all.py --quick     little of everything, to see that it works; nothing is kept
    python benchmarks/all.py NAME …      only these

A benchmark that fails does not keep the others from running; what was kept of it before stays, and the exit status is 1.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from page import renew
from rich.console import Console
from suite import BENCHMARKS, CHROMIUM, FIGURES, FOLDER

#: After so many seconds a benchmark hangs.
PATIENCE = 900.0
_console = Console(soft_wrap=True, highlight=False, markup=False)


def run(name: str, options: Sequence[str]) -> str:
    """Run one benchmark, which shows its table; what went wrong, if anything did."""
    command = [sys.executable, str(FOLDER / f"{name}.py"), *BENCHMARKS[name], *options]
    try:
        status = subprocess.run(command, check=False, timeout=PATIENCE).returncode  # noqa: S603 - ours
    except subprocess.TimeoutExpired:
        return f"was stopped after {PATIENCE:g} s"
    return f"ended with status {status}" if status else ""


def run_all(names: Sequence[str], folder: Path, options: Sequence[str]) -> list[str]:
    """Run those named; a sentence for each that failed."""
    folder.mkdir(parents=True, exist_ok=True)
    lasted, failed = {}, []
    for name in names:
        _console.rule(name)
        began = time.monotonic()
        wrong = run(name, ["--json", str(folder / f"{name}.json"), *options])
        lasted[name] = time.monotonic() - began
        if wrong:
            failed.append(f"{name} {wrong}")
    _console.rule()
    for name, seconds in lasted.items():
        _console.print(f"{name:12} {seconds:6.1f} s")
    _console.print(f"{'all':12} {sum(lasted.values()):6.1f} s")
    return failed


def main() -> None:
    """Run from the command line."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(BENCHMARKS)}; default: all")
    arguments.add_argument("--quick", action="store_true", help="little of everything, and nothing is kept")
    chosen = arguments.parse_args()
    names = chosen.names or list(BENCHMARKS)
    if unknown := [name for name in names if name not in BENCHMARKS]:
        arguments.error(f"{', '.join(unknown)}: no such benchmark; expected {', '.join(BENCHMARKS)}")
    if "dashboard" in names and not CHROMIUM.exists():
        _console.print(f"{CHROMIUM} is not there: the web page is measured without a browser.")
    if chosen.quick:
        with tempfile.TemporaryDirectory() as folder:
            failed = run_all(names, Path(folder), ["--quick"])
    else:
        failed = run_all(names, FIGURES, [])
        renew()
    for sentence in failed:
        _console.print(sentence)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
