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
            done = [processes.run(*command) for command in commands]
            assert [one.returncode for one in done] == [0] * len(done), [one.stderr for one in done]
            return "".join(one.stdout for one in done)

        path.write_text(mission)
        said = told(first)
        assert [line for line in decisions.splitlines() if line not in said] == []
        path.write_text(mission + fault)
        assert takeover in told(again)
        whole = yaml.safe_load(mission + fault) | yaml.safe_load(robots)
        path.write_text(yaml.safe_dump(whole, sort_keys=False))
        (tmp_path / "mower.py").write_text(code)
        said = told(run)
        for line in ("helper takes pick-left from picker (silence)", "valve open", "% watered", "valve closed"):
            assert line in said
        (tmp_path / "test_orchard.py").write_text(test)
        assert pytest == []
        for options in (["--lalliance-engine", "simulated"], []):
            done = processes.start_module("pytest", "-p", "no:xdist", *options)
            out, _ = done.communicate(timeout=110)
            assert done.returncode == 0, out
            assert "1 passed" in out
