"""How a mission names its environment, and what it is told when it cannot have it."""

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from lalliance_agents.config import Mission
from lalliance_agents.errors import MissionError
from world_server.environments import check_options, create, environment_class
from world_server.environments.box_pushing import BoxPushing
from world_server.environments.task_pool import TaskPool


def mission(**environment: Any) -> Mission:
    return Mission.model_validate(
        {"name": "test", "environment": environment, "tasks": {"a": {}}, "robots": {"r": {"tasks": {"a": 4}}}}
    )


def test_built_in_environments_have_one_word() -> None:
    assert environment_class("task_pool") is TaskPool
    assert environment_class("box_pushing") is BoxPushing
    assert environment_class("world_server.environments.task_pool:TaskPool") is TaskPool


def test_an_environment_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_world.py").write_text(
        "from world_server.environments.task_pool import TaskPool\nclass Mine(TaskPool): '''A pool.'''\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    mine = mission(kind="my_world:Mine", hand_over="restart")
    check_options(mine)
    assert type(create(mine, seed=1)).__name__ == "Mine"


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        (
            "task_pol",
            "'task_pol' is not a known environment; did you mean 'task_pool'?; expected task_pool, box_pushing or",
        ),
        (
            "warehouse",
            "'warehouse' is not a known environment; expected task_pool, box_pushing or package.module:Class",
        ),
        (
            "no_such_module:World",
            "cannot import 'no_such_module' for 'no_such_module:World': ModuleNotFoundError: No module",
        ),
        ("math:World", "'World' of module 'math' is not an environment; expected a class derived from"),
        ("math:pi", "'pi' of module 'math' is not an environment"),
        ("pathlib:Path.cwd", "'Path.cwd' of module 'pathlib' is not an environment"),
        ("world_server.environments.base:EventDriven", "is not an environment; expected .* with all its methods"),
    ],
)
def test_a_wrong_name_gets_a_sentence(kind: str, sentence: str) -> None:
    expected = sentence if ".*" in sentence else re.escape(sentence)
    with pytest.raises(MissionError, match=f"^environment.kind: .*{expected}"):
        check_options(mission(kind=kind))


def test_a_module_that_breaks_on_import_gets_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_world.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MissionError, match=r"cannot import 'broken_world' .*: ZeroDivisionError: division by zero"):
        environment_class("broken_world:World")


@pytest.mark.parametrize(
    ("options", "place", "kind"),
    [
        ({"hand_over": "share"}, ("hand_over",), "literal_error"),
        ({"noise": 1}, ("noise",), "less_than"),
        ({"nois": 0.1}, ("nois",), "extra_forbidden"),
        ({"kind": "box_pushing", "slack": 0}, ("slack",), "greater_than_equal"),
    ],
)
def test_a_wrong_option_is_told_with_its_place(options: dict[str, Any], place: tuple[str, ...], kind: str) -> None:
    with pytest.raises(ValidationError) as refused:
        check_options(mission(**options))
    assert [(error["loc"], error["type"]) for error in refused.value.errors()] == [(place, kind)]


def test_the_rest_of_the_mission_is_judged_too() -> None:
    with pytest.raises(PydanticCustomError, match="two ends; expected 2 tasks, not 1"):
        check_options(mission(kind="box_pushing"))


@pytest.mark.parametrize("kind", ["task_pool", "box_pushing"])
def test_every_option_is_documented_and_has_a_default(kind: str) -> None:
    options = environment_class(kind).Options
    assert all(field.description for field in options.model_fields.values())
    options()
