"""The environments: what the tasks of a mission are made of, and how work on them advances.

`base` says what an environment is, `task_pool` and `box_pushing` are two, and a mission may name a class of its own as
`package.module:Class`. Everything in this room is pure: time comes in as lengths of steps, work comes in as actions, and no
messages, failures or clocks are known here. This file finds the class that a mission names and checks the mission against it.
"""

from importlib import import_module
from inspect import isabstract

from lalliance_agents.config import Mission
from lalliance_agents.errors import MissionError
from lalliance_agents.suggestions import like
from world_server.environments.base import Environment
from world_server.environments.box_pushing import BoxPushing
from world_server.environments.task_pool import TaskPool

BUILT_IN: dict[str, type[Environment]] = {"task_pool": TaskPool, "box_pushing": BoxPushing}
"""The environments that a mission names by one word."""


def environment_class(kind: str) -> type[Environment]:
    """The class that a mission's `environment.kind` names.

    Raises:
        MissionError: nothing has that name, it cannot be imported, or it is no environment.
    """
    if kind in BUILT_IN:
        return BUILT_IN[kind]
    module, colon, name = kind.partition(":")
    if not colon:
        raise MissionError(
            f"environment.kind: {kind!r} is not a known environment{like(kind, BUILT_IN)}; "
            f"expected {', '.join(BUILT_IN)} or package.module:Class"
        )
    try:
        found: object = import_module(module)
    except Exception as error:
        # A user's module can fail in any way while it is imported.
        raise MissionError(
            f"environment.kind: cannot import {module!r} for {kind!r}: {type(error).__name__}: {error}"
        ) from error
    for part in name.split("."):
        found = getattr(found, part, None)
    if not (isinstance(found, type) and issubclass(found, Environment)) or isabstract(found):
        raise MissionError(
            f"environment.kind: {name!r} of module {module!r} is not an environment; "
            "expected a class derived from world_server.environments.base.Environment, with all its methods"
        )
    return found


def check_options(mission: Mission) -> None:
    """Check the mission against the environment it names.

    Raises:
        MissionError: no such environment.
        pydantic.ValidationError: an option is wrong; places are counted from `environment`, as fields of the class's
            `Options`.
        pydantic_core.PydanticCustomError: another part of the mission does not fit (`misplaced`); its path is counted
            from the mission's root.
    """
    environment_class(mission.environment.kind).check(mission)


def create(mission: Mission, *, seed: int) -> Environment:
    """A fresh trial of `mission`, which passed `check_options`; all randomness comes from `seed`.

    Raises:
        MissionError: no such environment.
    """
    return environment_class(mission.environment.kind)(mission, seed=seed)
