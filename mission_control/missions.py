"""Missions as the commands take them: the file checked, and the environment's own options too."""

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from lalliance_agents.agent.behavior import find_factory
from lalliance_agents.config import Mission
from lalliance_agents.errors import BehaviorError, MissionError
from lalliance_agents.mission_file import MissionText, load_mission_text
from lalliance_agents.model.parameters import Parameters
from world_server.environments import BUILT_IN, check_options, environment_class


def load(path: Path, *, for_team: bool) -> Mission:
    """The mission in the file at `path`.

    Args:
        path: where it is.
        for_team: whether the robots are to run here too, so that their own behaviour sets must be there.

    Raises:
        MissionError: the file does not hold a mission that can be run.
    """
    text = load_mission_text(path)
    mission = text.mission()
    try:
        check_options(mission)
    except ValidationError as error:
        record = environment_class(mission.environment.kind).Options
        raise text.error(error, record, ("environment",)) from None
    except PydanticCustomError as error:
        raise text.error(error) from None
    except MissionError as error:
        raise text.wrong(("environment", "kind"), str(error).removeprefix("environment.kind: ")) from None
    if for_team:
        # What a user's module prints when it is imported is no output of the command.
        with redirect_stdout(sys.stderr):
            _check_behaviors(mission, text)
    return mission


def _check_behaviors(mission: Mission, text: MissionText) -> None:
    for name, robot in mission.robots.items():
        try:
            if robot.behaviors is not None:
                find_factory(robot.behaviors)
        except BehaviorError as error:
            raise text.wrong(("robots", name, "behaviors"), str(error)) from None


def mission_schema() -> dict[str, Any]:
    """The JSON Schema of mission files, with the options of the built-in environments."""
    schema = Mission.model_json_schema(mode="validation")
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "lalliance mission"
    choice = schema["$defs"]["EnvironmentChoice"]
    choice["allOf"] = [_options_of(kind) for kind in BUILT_IN]
    _spell_defaults(schema["$defs"]["Parameters"], Parameters().model_dump(mode="json"))
    _close(schema)
    return schema


def _spell_defaults(record: dict[str, Any], values: dict[str, Any]) -> None:
    """Give the defaults as a file spells them."""
    for name, field in record["properties"].items():
        if "default" in field:
            field["default"] = values[name]


def _close(schema: Any) -> None:
    """Where names have a pattern, say that no other names are allowed."""
    if isinstance(schema, dict):
        if "patternProperties" in schema:
            schema["additionalProperties"] = False
        for part in schema.values():
            _close(part)
    elif isinstance(schema, list):
        for part in schema:
            _close(part)


def _options_of(kind: str) -> dict[str, Any]:
    options = BUILT_IN[kind].Options.model_json_schema()
    properties = {"kind": {}, **options.get("properties", {})}
    return {
        "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
        "then": {"properties": properties, "additionalProperties": False, "$defs": options.get("$defs", {})},
    }
