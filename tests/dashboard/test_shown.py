"""The page of a mission, shown in each of the ways that docs/dashboard.md tells."""

import re
import signal
import subprocess
from pathlib import Path
from urllib.request import urlopen

from support.documents import carried_out_by
from support.processes import MISSIONS, Processes, read_until


def test_the_page_is_shown_as_the_document_says(tmp_path: Path) -> None:
    """Beside the mission that shows itself, slowly, one that runs already is shown, and its recording; each on a free port."""
    (tmp_path / "missions").symlink_to(MISSIONS)
    [block] = carried_out_by("dashboard/test_shown.py::test_the_page_is_shown_as_the_document_says")
    run, running, recorded = block.commands
    with Processes(tmp_path) as processes:
        mission = processes.start(*run, "--port", "0", "--plain", "--record", "demo.mcap", "--speed", "0.5")
        own = address(mission)
        read_until(mission, "pusher starts")
        viewers = [processes.start(*command, "--port", "0") for command in (running, recorded)]
        for page in (own, *map(address, viewers)):
            with urlopen(f"{page}/health", timeout=30) as answer:
                assert answer.status == 200
            with urlopen(f"{page}/metrics", timeout=30) as answer:
                assert b"lalliance_mission" in answer.read()
        for one in (*viewers, mission):
            one.send_signal(signal.SIGINT)
            assert one.wait(timeout=30) == 130


def address(process: "subprocess.Popen[str]") -> str:
    """Where a page is, as its process says; without the token."""
    said = read_until(process, "http://")[-1]
    found = re.search(r"http://[\d.]+:\d+", said)
    assert found is not None, said
    return found[0]
