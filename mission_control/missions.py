"""Missions as the commands take them: the file checked, and the environment's own options too."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from lalliance_agents.agent.behavior import find_factory
from lalliance_agents.config import Mission
from lalliance_agents.errors import BehaviorError, MissionError
from lalliance_agents.mission_file import MissionText, load_mission_text
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
    return schema


def _options_of(kind: str) -> dict[str, Any]:
    options = BUILT_IN[kind].Options.model_json_schema()
    properties = {"kind": {}, **options.get("properties", {})}
    return {
        "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
        "then": {"properties": properties, "additionalProperties": False, "$defs": options.get("$defs", {})},
    }
