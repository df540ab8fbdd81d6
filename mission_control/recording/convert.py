"""Makes a recording into one that viewers open: Foxglove and Lichtblick read messages of JSON with schemas, and no msgpack.

They take only part of JSON Schema: each field has one plain type, and nothing is referred to elsewhere. So what may be missing
is left out where it is missing, instead of being null, and definitions stand where they are used. Numbers are doubles to them:
a seed, which may be larger than those hold exactly, becomes a text. Whatever is no valid message, or cannot be told like that,
goes unchanged to one channel of its own, in base64, with what is wrong with it: nothing is left out.
"""

import base64
import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap.writer import LIBRARY_IDENTIFIER, Writer

from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.whole_file import written_whole
from lalliance_agents.wire.keys import Key, Keys
from lalliance_agents.wire.messages import Message
from mission_control.recording.format import ABOUT, CONVERTED, ENDING, MOST_CHANNELS, schema_of
from mission_control.recording.reader import Recording
from mission_control.recording.writer import check_new
from mission_control.watch.sighting import Sighting, read

#: Integers up to here are exact as doubles.
_LARGEST = 2**53 - 1
#: Below the mission's own keys.
UNREADABLE = "@unreadable"
_UNREADABLE_SCHEMA = {
    "title": "Unreadable",
    "type": "object",
    "properties": {
        "key": {"type": "string"},
        "reason": {"type": "string"},
        "payload": {"type": "string", "contentEncoding": "base64"},
    },
    "required": ["key", "reason", "payload"],
}
#: What a schema may say of a field besides its type.
_KEPT = ("description", "enum", "const", "pattern", "minimum", "maximum", "minLength", "maxLength", "contentEncoding")


_SCALARS = ("string", "integer", "number", "boolean")


@dataclass(frozen=True, slots=True)
class Converted:
    """What was converted.

    Attributes:
        messages: all that are in the new file.
        unreadable: those of them that are there as bytes.
        broken: why the recording could not be read to its end, if so.
    """

    messages: int
    unreadable: int
    broken: str | None


def convert(path: Path, out: Path) -> Converted:
    """Write the recording at `path` to `out`, which must not be there yet.

    Raises:
        UserError: there is no recording, or nothing can be written at `out`.
    """
    recording = Recording(path)
    with _new_file(out) as file:
        writer = Writer(file)
        writer.start(CONVERTED, f"lalliance {recording.about.version}; {LIBRARY_IDENTIFIER}")
        writer.add_metadata(ABOUT, recording.about.metadata())
        channels = _Channels(writer, recording.about.mission)
        messages = unreadable = 0
        for sighting in recording:
            document = channels.told(sighting)
            writer.add_message(
                document.channel,
                log_time=sighting.seen_at,
                data=json.dumps(document.content, allow_nan=False).encode(),
                publish_time=sighting.seen_at,
            )
            messages += 1
            unreadable += document.is_unreadable
        if recording.ending is not None:
            writer.add_metadata(ENDING, recording.ending.metadata())
        writer.finish()
    return Converted(messages, unreadable, recording.broken)


def plain_schema(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema as viewers take it, from one that pydantic has made."""
    return _plain(schema, schema.get("$defs", {}))


def plain_content(message: Message) -> dict[str, Any]:
    """A message as its plain schema says.

    Raises:
        ValueError: it holds a number that its readers would read as another.
    """
    content: dict[str, Any] = _without_nothing(message.model_dump(mode="json"))
    if "seed" in content:
        content["seed"] = str(content["seed"])
    _check_numbers(content)
    return content


class _Told(NamedTuple):
    channel: int
    content: Mapping[str, Any]
    is_unreadable: bool = False


class _Channels:
    """The channels of the new file."""

    def __init__(self, writer: Writer, mission: str) -> None:
        self._writer = writer
        self._keys = Keys(mission)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def told(self, sighting: Sighting) -> _Told:
        """A sighting as a message of JSON."""
        try:
            key, message = read(sighting, self._keys)
            if message is None and sighting.payload:
                raise MessageError("key", "a message where there are none")  # noqa: TRY301 - one place for all that is wrong
            content = {"present": not sighting.gone} if message is None else plain_content(message)
            return _Told(self._channel(sighting.key, key), content)
        except (MessageError, ValueError) as error:
            told = {
                "key": sighting.key,
                "reason": str(error),
                "payload": base64.b64encode(sighting.payload).decode(),
            }
            return _Told(self._unreadable(), told, is_unreadable=True)

    def _channel(self, topic: str, key: Key) -> int:
        if topic not in self._channels:
            schema = schema_of(key.kind)
            if schema is None or len(self._channels) >= MOST_CHANNELS:
                raise MessageError("key", "nothing is published on such keys")
            self._channels[topic] = self._new(topic, schema.name, plain_schema(schema.document))
        return self._channels[topic]

    def _unreadable(self) -> int:
        topic = f"{self._keys.prefix}{UNREADABLE}"
        if topic not in self._channels:
            self._channels[topic] = self._new(topic, "lalliance.Unreadable", _UNREADABLE_SCHEMA)
        return self._channels[topic]

    def _new(self, topic: str, name: str, schema: Mapping[str, Any]) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
        return self._writer.register_channel(topic, "json", self._schemas[name])


def _plain(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    while "$ref" in schema:
        schema = {**definitions[schema["$ref"].rpartition("/")[2]], **{k: v for k, v in schema.items() if k != "$ref"}}
    choices = [one for one in schema.get("anyOf", ()) if one.get("type") != "null"]
    if len(choices) > 1:
        return {"type": [kind for kind in _SCALARS if any(one.get("type") == kind for one in choices)]}
    if choices:
        schema = {**choices[0], **{k: v for k, v in schema.items() if k != "anyOf"}}
        return _plain(schema, definitions)
    plain = {"type": schema["type"], **{word: schema[word] for word in _KEPT if word in schema}}
    if schema["type"] == "array":
        plain["items"] = _plain(schema["items"], definitions)
    elif schema["type"] == "object":
        plain |= _plain_object(schema, definitions)
    return plain


def _plain_object(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    fields = schema.get("properties", {})
    plain: dict[str, Any] = {}
    if fields:
        plain["properties"] = {
            name: {"type": "string", "description": "an integer, which may be larger than a double holds exactly"}
            if name == "seed"
            else _plain(field, definitions)
            for name, field in fields.items()
        }
        may_lack = {name for name, field in fields.items() if {"type": "null"} in field.get("anyOf", ())}
        plain["required"] = [name for name in schema.get("required", ()) if name not in may_lack]
    others = [*schema.get("patternProperties", {}).values(), schema.get("additionalProperties")]
    found = next((other for other in others if isinstance(other, Mapping)), None)
    if found is not None:
        plain["additionalProperties"] = _plain(found, definitions)
    return plain


def _without_nothing(value: Any) -> Any:
    """A value without what is null in it."""
    if isinstance(value, dict):
        return {key: _without_nothing(one) for key, one in value.items() if one is not None}
    return [_without_nothing(one) for one in value] if isinstance(value, list) else value


def _check_numbers(value: Any) -> None:
    if isinstance(value, int) and abs(value) > _LARGEST:
        raise ValueError(f"{value} is larger than a double holds exactly")
    for one in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _check_numbers(one)


@contextlib.contextmanager
def _new_file(path: Path) -> Iterator[BinaryIO]:
    """A file that was not there before, and is there when all of it is."""
    check_new(path)
    try:
        with written_whole(path) as file:
            yield file
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror}); expected a place for a new file") from None
