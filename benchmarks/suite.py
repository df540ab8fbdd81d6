"""Which benchmarks there are, and where their figures are kept."""

from pathlib import Path

FOLDER = Path(__file__).parent
#: For each benchmark a file `NAME.json`, which `page.py` makes tables of.
FIGURES = FOLDER.parent / "docs" / "performance"

CHROMIUM = Path("/usr/bin/chromium")

#: In the order in which they run and are shown: the name of the program, and what it is told besides `--json` or `--quick`.
BENCHMARKS: dict[str, list[str]] = {
    "team_size": [],
    "failover": [],
    "start_up": [],
    "bus": [],
    "codec": [],
    "simulator": [],
    "kernel": [],
    "peers": [],
    "dashboard": ["--browser"] if CHROMIUM.exists() else [],
    "optimum": ["--missions", "3"],
}
