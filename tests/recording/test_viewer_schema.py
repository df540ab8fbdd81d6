"""Schemas as viewers take them, with the names that were found in maps."""

from typing import Any

import jsonschema

from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import BODY_OF
from mission_control.recording.viewer_schema import Found, viewer_schema

SCALARS = ["string", "integer", "number", "boolean"]


def schema(kind: Kind, *contents: dict[str, Any]) -> dict[str, Any]:
    found = Found()
    for content in contents:
        found.add(content)
    return viewer_schema(BODY_OF[kind].model_json_schema(), found)


def sets(*contents: dict[str, Any]) -> Any:
    return schema(Kind.MOTIVATION, *({"sets": content} for content in contents))["properties"]["sets"]


def test_a_map_names_what_was_found_in_it() -> None:
    found = sets({"push": {"motivation": 0, "pace": "fast"}}, {"lift": {}, "push": {"motivation": 0.5, "heard": True}})
    others = {"type": SCALARS}
    named = {"heard": {"type": "boolean"}, "motivation": {"type": "number"}, "pace": {"type": "string"}}
    assert found == {
        "type": "object",
        "additionalProperties": {"type": "object", "additionalProperties": others, "properties": {}},
        "properties": {
            "lift": {"type": "object", "additionalProperties": others, "properties": {}},
            "push": {"type": "object", "additionalProperties": others, "properties": named},
        },
    }


def test_every_object_says_its_properties_also_where_nothing_was_found() -> None:
    found = schema(Kind.DECISION)["properties"]
    assert (found["factors"]["properties"], found["teammates"]["items"]["properties"]) == ({}, {})


def test_what_is_now_of_one_type_and_now_of_another_is_not_named() -> None:
    found = sets({"push": {"level": 1, "other": "lifter"}}, {"push": {"level": 2.5, "other": 3}})
    assert found["properties"]["push"]["properties"] == {"level": {"type": "number"}}
    jsonschema.validate({"push": {"level": 1, "other": 3}, "pull": {"level": "high"}}, found)


def test_elements_of_a_list_are_one_place() -> None:
    found = schema(Kind.DECISION, {"teammates": [{"robot": "lifter"}, {"present": False}]})
    assert found["properties"]["teammates"]["items"]["properties"] == {
        "present": {"type": "boolean"},
        "robot": {"type": "string"},
    }


def test_a_structure_in_a_map_stands_at_every_name() -> None:
    teammates = schema(Kind.LINK, {"teammates": {"lifter": {"received": 3}}})["properties"]["teammates"]
    assert teammates["properties"]["lifter"] == teammates["additionalProperties"]
    assert teammates["properties"]["lifter"]["properties"]["silence"]["type"] == "number"


def test_names_without_end_are_not_kept() -> None:
    found = Found(most=5)
    found.add({"sets": {"push": {"motivation": 0.5}, "x" * 65: {}, "lift": {"motivation": 0.5}, "pull": {}}})
    document = viewer_schema(BODY_OF[Kind.MOTIVATION].model_json_schema(), found)["properties"]["sets"]
    assert list(document["properties"]) == ["lift", "push"]
    jsonschema.validate({"pull": {"motivation": 0.5}}, document)
