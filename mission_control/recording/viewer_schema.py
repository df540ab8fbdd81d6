"""JSON Schemas as Foxglove and Lichtblick take them. Pure.

They turn a schema into a list of fields, and read no more of JSON Schema than that: each field has one plain type, every
object says its `properties`, and nothing is referred to elsewhere. One field that they do not take makes them refuse the
whole topic, and what an object may hold besides its properties is nothing to them. So definitions stand where they are
used, and a map names as its properties what was found in its place in the messages; without that, its values could be
plotted, but no viewer would offer them.
"""

from collections.abc import Mapping
from typing import Any

#: Names that are kept of one kind of message, and how long they may be: messages can have others without end.
MOST_NAMES = 20_000
_LONGEST_NAME = 64
#: What a schema may say of a field besides its type.
_KEPT = ("description", "enum", "const", "pattern", "minimum", "maximum", "minLength", "maxLength", "contentEncoding")
_SCALARS: dict[str, type] = {"string": str, "integer": int, "number": float, "boolean": bool}
_SEED = {"type": "string", "description": "an integer, which may be larger than a double holds exactly"}


class Place:
    """What was found in one place of messages; all elements of a list are one place."""

    def __init__(self) -> None:
        self.inner: dict[str, Place] = {}
        self.types: set[type] = set()


class Found:
    """What was found in the messages of one kind.

    Args:
        most: names that are kept.
    """

    def __init__(self, most: int = MOST_NAMES) -> None:
        self.root = Place()
        self._left = most

    def add(self, content: Mapping[str, Any]) -> None:
        """One more message."""
        self._add(content, self.root)

    def _add(self, value: Any, place: Place) -> None:
        if isinstance(value, Mapping):
            for name, one in value.items():
                if (inner := self._inner(place, name)) is not None:
                    self._add(one, inner)
        elif isinstance(value, list):
            for one in value:
                self._add(one, place)
        else:
            place.types.add(type(value))

    def _inner(self, place: Place, name: str) -> Place | None:
        if name not in place.inner and self._left and len(name) <= _LONGEST_NAME:
            self._left -= 1
            place.inner[name] = Place()
        return place.inner.get(name)


def viewer_schema(schema: Mapping[str, Any], found: Found) -> dict[str, Any]:
    """A schema as viewers take it, from one that pydantic has made and what was found in such messages."""
    return _plain(schema, schema.get("$defs", {}), found.root)


def _plain(schema: Mapping[str, Any], definitions: Mapping[str, Any], place: Place) -> dict[str, Any]:
    while "$ref" in schema:
        schema = {**definitions[schema["$ref"].rpartition("/")[2]], **{k: v for k, v in schema.items() if k != "$ref"}}
    choices = [one for one in schema.get("anyOf", ()) if one.get("type") != "null"]
    if len(choices) > 1:
        return {"type": _type([one["type"] for one in choices], place)}
    if choices:
        return _plain({**choices[0], **{k: v for k, v in schema.items() if k != "anyOf"}}, definitions, place)
    plain = {"type": schema["type"], **{word: schema[word] for word in _KEPT if word in schema}}
    if schema["type"] == "array":
        plain["items"] = _plain(schema["items"], definitions, place)
    elif schema["type"] == "object":
        plain |= _plain_object(schema, definitions, place)
    return plain


def _plain_object(schema: Mapping[str, Any], definitions: Mapping[str, Any], place: Place) -> dict[str, Any]:
    fields = schema.get("properties", {})
    properties = {
        name: _SEED if name == "seed" else _plain(field, definitions, place.inner.get(name, Place()))
        for name, field in fields.items()
    }
    plain: dict[str, Any] = {}
    others = [*schema.get("patternProperties", {}).values(), schema.get("additionalProperties")]
    other = next((one for one in others if isinstance(one, Mapping)), None)
    if other is not None:
        names = sorted(place.inner.keys() - fields.keys())
        properties |= {name: _plain(other, definitions, place.inner[name]) for name in names}
        plain["additionalProperties"] = _plain(other, definitions, Place())
    plain["properties"] = {name: field for name, field in properties.items() if _is_taken(field)}
    if fields:
        may_lack = {name for name, field in fields.items() if {"type": "null"} in field.get("anyOf", ())}
        plain["required"] = [name for name in schema.get("required", ()) if name not in may_lack]
    return plain


def _type(types: list[str], place: Place) -> str | list[str]:
    """The one of several types that was found; several, if several were, or none."""
    found = [name for name in types if _SCALARS[name] in place.types] or types
    if set(found) == {"integer", "number"}:
        return "number"
    return found[0] if len(found) == 1 else found


def _is_taken(field: Mapping[str, Any]) -> bool:
    """Whether viewers have a type for a field; if not, it is better not named, and is in the messages all the same."""
    kind = field["type"]
    if kind == "array":
        return field["items"]["type"] != "array" and _is_taken(field["items"])
    return isinstance(kind, str)
