"""What the README and the pages show: their blocks of code, and which test carries out which commands.

A block is known by its page and its first line. Each block of commands has a test, which gets what it runs from here, or is
done alike somewhere else for a reason that is told; `documentation/test_shown_commands.py` holds both against the pages.
"""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ["README.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md"))]

EACH = "control/test_readme.py::test_each_block_of_commands_works"
WATCHING = "system/test_watching.py::test_every_command_that_is_shown_works_beside_a_mission"
RECORDING = "system/test_recording.py::test_nothing_that_the_robots_sent_is_missing"
KEYS = "control/test_readme.py::test_a_mission_runs_with_keys"
STARTED = "control/test_getting_started.py::test_all_of_it_is_as_it_says"
PAGE = "dashboard/test_shown.py::test_the_page_is_shown_as_the_document_says"

#: Page -> the first line of each block of commands -> the test that carries out its `lalliance` lines.
RUN_BY = {
    "README.md": {
        ". .venv/bin/activate": EACH,
        "lalliance chaos missions/material_handling.yaml inject kind=hang robot=pusher for=3": (
            "control/test_readme.py::test_faults_are_injected_and_healed_while_a_mission_runs"
        ),
        "lalliance why carrier crate-2": WATCHING,
        "lalliance simulate missions/material_handling.yaml": EACH,
        "lalliance run two-rooms.yaml --speed 2": (
            "control/test_readme.py::test_a_robot_of_ones_own_performs_and_takes_the_task_over"
        ),
        "lalliance keys init missions/material_handling.yaml": KEYS,
        "lalliance run missions/material_handling.yaml --speed 4 --record demo.mcap": RECORDING,
    },
    "docs/campaign.md": {"lalliance campaign --missions 200 --seed 1": EACH},
    "docs/dashboard.md": {"lalliance run missions/material_handling.yaml --dashboard": PAGE},
    "docs/deployment.md": {
        "lalliance router --listen tcp/127.0.0.1:7447": "control/test_readme.py::test_the_single_processes_make_a_team",
        "lalliance deploy compose my-mission.yaml > compose.yaml": EACH,
        "lalliance deploy kubernetes missions/material_handling.yaml --out deploy/kubernetes": EACH,
    },
    "docs/getting-started.md": {
        "lalliance check orchard.yaml": STARTED,
        "lalliance simulate orchard.yaml": STARTED,
        "lalliance run orchard.yaml --speed 4": STARTED,
        "pip install pytest": STARTED,
    },
    "docs/recording.md": {"lalliance run missions/material_handling.yaml --speed 4 --record demo.mcap": RECORDING},
    "docs/security.md": {"lalliance keys init missions/material_handling.yaml": KEYS},
    "docs/watching.md": {
        "lalliance why": WATCHING,
        "lalliance echo 'heartbeat/*' --once": WATCHING,
        "lalliance top": WATCHING,
    },
}

#: The same for what is not carried out word for word: what does alike, a test or what CI runs.
DONE_ALIKE = {
    "README.md": {"make demo": ".ci/run"},
    # The token is of one start, and the test speaks HTTP itself.
    "docs/dashboard.md": {
        'curl -H "Authorization: Bearer $TOKEN" -d \'{"fault": {"kind": "hang", "robot": "pusher"}, "lasts": 3}\' '
        "http://127.0.0.1:8080/chaos/inject": "dashboard/test_site.py"
    },
    "docs/deployment.md": {
        # In a docker daemon of its own, with a project's name for each test.
        "docker build -f deploy/Dockerfile -t lalliance .": (
            "compose/test_compose.py::test_the_demo_mission_is_completed_although_a_container_is_killed"
        ),
        # In two network namespaces, whose addresses stand for the two machines.
        "lalliance keys init team.yaml --host left.example --host right.example": (
            "system/test_two_routers.py::test_a_team_on_two_machines_goes_on_whatever_happens_between_them"
        ),
    },
    # Hours of simulation: the test takes few rows the same way.
    "docs/failure-detection.md": {
        "python -m lalliance_study.detection run --out docs/faults/rows": (
            "study/test_detection.py::test_figures_are_drawn_from_rows_and_from_nothing_else"
        )
    },
    # An environment of one's own from a package index is what every run of CI begins with.
    "docs/getting-started.md": {"python3 -m venv my-team": "Makefile"},
    # An hour of simulation: the test takes the preset `mini`.
    "docs/study/README.md": {
        "pip install 'lalliance[study]'": (
            "control/test_study_command.py::test_the_smallest_study_is_carried_out_once_and_reported"
        )
    },
    "docs/testing.md": {
        "pip install PATH_OF_THE_CHECKOUT pytest": (
            "testing/test_documentation.py::test_the_example_runs_in_an_empty_folder"
        )
    },
    # The examples are copied; their own tests run the mission, real and simulated, and the router listens on a free port.
    "docs/your-robot.md": {
        "cd examples/greenhouse": "examples/test_examples.py::test_the_greenhouse_passes_its_own_tests",
        "lalliance simulate greenhouse.yaml --runs 20": (
            "examples/test_examples.py::test_the_greenhouse_passes_its_own_tests"
        ),
        "lalliance router --listen tcp/127.0.0.1:7447": (
            "examples/test_examples.py::test_a_watchman_without_a_world_goes_on_where_another_one_died"
        ),
        "lalliance robot rounds.yaml --connect tcp/10.0.0.1:7447 --name red --without-world": (
            "examples/test_examples.py::test_bases_under_ros_share_their_rounds_and_stop_when_their_robot_does"
        ),
    },
    # The mission of the test lasts for as long as it is looked at.
    "docs/watching.md": {"lalliance run missions/material_handling.yaml --record mission.mcap": WATCHING},
}


@dataclass(frozen=True)
class Shown:
    """A block of commands of a page."""

    page: str
    text: str

    @property
    def first(self) -> str:
        """Its first line, without a remark."""
        return re.split(r"\s+#", self.text.partition("\n")[0])[0]

    @property
    def commands(self) -> list[list[str]]:
        """The arguments of each `lalliance` in it; what comes of it may be written to a file."""
        lines = [line for line in self.text.splitlines() if line.startswith("lalliance ")]
        return [shlex.split(line.partition(" > ")[0], comments=True)[1:] for line in lines]


def blocks(page: str, language: str) -> list[str]:
    """All blocks of code of a page in a language."""
    text = (ROOT / page).read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


def shown(page: str) -> list[Shown]:
    """All blocks of commands of a page."""
    return [Shown(page, text) for text in blocks(page, "console")]


def carried_out_by(test: str) -> list[Shown]:
    """The blocks that a test carries out; of those with the same commands, the first."""
    found = [one for page in RUN_BY for one in shown(page) if RUN_BY[page].get(one.first) == test]
    return [one for at, one in enumerate(found) if one.commands not in [other.commands for other in found[:at]]]
