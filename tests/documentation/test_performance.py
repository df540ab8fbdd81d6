"""The benchmarks and the page that shows what came of them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def run(program, *options):
    return subprocess.run(
        [sys.executable, BENCHMARKS / f"{program}.py", *options],
        check=False,
        capture_output=True,
        text=True,
        timeout=110,
    )


def test_the_page_is_what_the_figures_give():
    checked = run("page", "--check")
    assert (checked.returncode, checked.stderr) == (0, "")


def test_a_benchmark_that_is_not_there_is_named():
    refused = run("all", "speed")
    assert refused.returncode == 2
    assert "speed: no such benchmark; expected team_size, " in refused.stderr


@pytest.mark.parametrize("name", ["bus", "codec", "start_up"])
def test_a_quick_run_measures_something_of_everything(name, tmp_path):
    kept = tmp_path / "figures.json"
    quick = run(name, "--quick", "--json", kept)
    assert quick.returncode == 0, quick.stderr
    figures = json.loads(kept.read_text())
    assert len(figures["table"]["body"]) == len(figures["rows"]) > 0
    assert all(value > 0 for row in figures["rows"] for key, value in row.items() if key in MEASURED[name])
    assert figures["title"] in quick.stdout


#: What must be more than nothing in every row.
MEASURED = {
    "bus": {"rate", "offered", "flood_delivered", "paced_delivered", "p50", "p99"},
    "codec": {"bytes", "seconds", "beside_seconds"},
    "start_up": {"seconds", "least", "ratio"},
}
