"""docs/getting-started.md, done from its beginning to its end as it says."""

from pathlib import Path

import yaml
from support.documents import blocks, carried_out_by
from support.processes import Processes

PAGE = "docs/getting-started.md"


def test_all_of_it_is_as_it_says(tmp_path: Path) -> None:
    shown = carried_out_by("control/test_getting_started.py::test_all_of_it_is_as_it_says")
    [first, again, run, pytest] = [block.commands for block in shown]
    mission, fault, robots = blocks(PAGE, "yaml")
    code, test = blocks(PAGE, "python")
    decisions, takeover = blocks(PAGE, "text")
    path = tmp_path / "orchard.yaml"
    with Processes(tmp_path) as processes:

        def told(commands: list[list[str]]) -> str:
            """What commands say that run beside one another."""
            started = [processes.start(*command) for command in commands]
            said = [one.communicate(timeout=110) for one in started]
            assert [one.returncode for one in started] == [0] * len(started), said
            return "".join(out for out, _ in said)

        path.write_text(mission)
        said = told(first)
        assert [line for line in decisions.splitlines() if line not in said] == []
        path.write_text(mission + fault)
        assert takeover in told(again)
        whole = yaml.safe_load(mission + fault) | yaml.safe_load(robots)
        path.write_text(yaml.safe_dump(whole, sort_keys=False))
        (tmp_path / "mower.py").write_text(code)
        (tmp_path / "test_orchard.py").write_text(test)
        assert pytest == []
        tests = [
            processes.start_module("pytest", "-p", "no:xdist", *options)
            for options in (["--lalliance-engine", "simulated"], [])
        ]
        said = told(run)
        for line in ("helper takes pick-left from picker (silence)", "valve open", "% watered", "valve closed"):
            assert line in said
        for one in tests:
            out, _ = one.communicate(timeout=110)
            assert one.returncode == 0, out
            assert "1 passed" in out
