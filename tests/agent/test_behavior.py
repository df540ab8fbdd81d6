"""Behaviour sets of one's own: how they are found, and the sentence for each way in which they do not fit."""

import sys
from pathlib import Path
from typing import Any

import pytest

from lalliance_agents.agent.behavior import (
    AutonomousBehaviorSet,
    BehaviorSet,
    TaskSense,
    complete_repertoire,
    load_behaviors,
)
from lalliance_agents.errors import BehaviorError

MODULE = """
from lalliance_agents import BehaviorSet

class Push(BehaviorSet):
    task = "push"

class Nested:
    @staticmethod
    def make():
        return iter([Push()])

class Nameless:
    def __repr__(self):
        raise ValueError

number = 7
def good(): return [Push()]
def failing(): raise RuntimeError("no robot arm")
def failing_late():
    yield Push()
    raise RuntimeError("no gripper")
def nothing(): return None
def wrong(): return [Push(), "push"]
def nameless(): return [Nameless()]
def needy(port): return [Push()]
"""


@pytest.fixture(autouse=True)
def _module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_behaviors.py").write_text(MODULE)
    (tmp_path / "broken_behaviors.py").write_text("def make(:")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("my_behaviors", "broken_behaviors"):
        monkeypatch.delitem(sys.modules, name, raising=False)


@pytest.mark.parametrize("place", ["my_behaviors:good", "my_behaviors:Nested.make"])
def test_a_factory_is_found_and_called(place: str) -> None:
    assert [repr(one) for one in load_behaviors(place)] == ["<Push for push>"]


@pytest.mark.parametrize(
    ("place", "why"),
    [
        (
            "no_such_module:make",
            "cannot be loaded: ModuleNotFoundError: No module named 'no_such_module'; expected package",
        ),
        ("broken_behaviors:make", "cannot be loaded: SyntaxError: "),
        ("my_behaviors:missing", "cannot be loaded: AttributeError: "),
        ("my_behaviors", "cannot be loaded: AttributeError: "),
        ("", "cannot be loaded: ValueError: "),
        ("my_behaviors:number", "is int, expected a function that returns behaviour sets"),
        ("my_behaviors:failing", "failed: RuntimeError: no robot arm"),
        ("my_behaviors:failing_late", "failed: RuntimeError: no gripper"),
        ("my_behaviors:nothing", "returned None, expected a list of behaviour sets"),
        ("my_behaviors:needy", "failed: TypeError: needy() missing 1 required positional argument: 'port'"),
        ("my_behaviors:wrong", "returned 'push', expected instances of BehaviorSet"),
        ("my_behaviors:nameless", "returned <Nameless>, expected instances of BehaviorSet"),
    ],
)
def test_what_cannot_be_loaded_is_said_in_a_sentence(place: str, why: str) -> None:
    with pytest.raises(BehaviorError) as refused:
        load_behaviors(place)
    assert str(refused.value).startswith(f"behaviors {place!r} {why}")


def test_tasks_without_a_set_of_ones_own_get_the_default_one_in_the_missions_order() -> None:
    own = BehaviorSet("b")
    repertoire = complete_repertoire("r1", ["a", "b", "c"], [own])
    assert list(repertoire) == ["a", "b", "c"]
    assert repertoire["b"] is own
    assert {type(one) for one in repertoire.values()} == {BehaviorSet}


class Forgetful(BehaviorSet):
    task = "a"

    def __init__(self) -> None:
        pass


class Silent(BehaviorSet):
    def __repr__(self) -> str:
        raise ValueError("no name")


@pytest.mark.parametrize(
    ("own", "why"),
    [
        ([BehaviorSet("x")], "<BehaviorSet for x> is for task 'x', which robot r1 does not have; expected one of a, b"),
        ([BehaviorSet()], "<BehaviorSet for ?> is for task '', which robot r1 does not have; expected one of a, b"),
        ([Silent("x")], "<Silent> is for task 'x', which robot r1 does not have; expected one of a, b"),
        ([BehaviorSet("a"), BehaviorSet("a")], "robot r1 has two behaviour sets for task 'a', expected one"),
        ([Forgetful()], "<Forgetful for a> did not call super().__init__()"),
        ([BehaviorSet], f"robot r1 was given {BehaviorSet!r}, expected instances of BehaviorSet"),
    ],
)
def test_sets_that_do_not_fit_are_refused_in_a_sentence(own: list[Any], why: str) -> None:
    with pytest.raises(BehaviorError) as refused:
        complete_repertoire("r1", ["a", "b"], own)
    assert str(refused.value) == why


def test_the_default_set_believes_the_world_and_the_autonomous_one_itself() -> None:
    ours, own = BehaviorSet("a"), AutonomousBehaviorSet("a")
    assert (ours.applicable(), ours.complete()) == (False, False)
    assert (own.applicable(), own.complete()) == (True, False)
    ours.sensed = own.sensed = TaskSense(applicable=True, complete=True, progress=1.0)
    assert (ours.applicable(), ours.complete()) == (True, True)
    assert (own.applicable(), own.complete()) == (True, False)
    ours.returned = own.returned = True
    assert (own.applicable(), own.complete()) == (False, True)
