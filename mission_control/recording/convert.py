"""Makes a recording into one that viewers open: Foxglove and Lichtblick read messages of JSON with schemas, and no msgpack.

What they take of JSON Schema is in `viewer_schema`. It wants to know which names there are in maps, before the first message
is written, so a recording is read twice. What may be missing is left out where it is missing, instead of being null. Numbers
are doubles to viewers: a seed, which may be larger than those hold exactly, becomes a text. Whatever is no valid message, or
cannot be told like that, goes unchanged to one channel of its own, in base64, with what is wrong with it: nothing is left out.
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
from lalliance_agents.wire.keys import Keys, Kind
from lalliance_agents.wire.messages import Message
from mission_control.recording.format import ABOUT, CONVERTED, ENDING, GAP, MOST_CHANNELS, gap_metadata, schema_of
from mission_control.recording.reader import Recording
from mission_control.recording.viewer_schema import Found, viewer_schema
from mission_control.recording.writer import check_new
from mission_control.watch.sighting import Sighting, read

#: Integers up to here are exact as doubles.
_LARGEST = 2**53 - 1
#: Below the mission's own keys.
UNREADABLE = "@unreadable"
_UNREADABLE_NAME = "lalliance.Unreadable"
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
        keys = Keys(recording.about.mission)
        channels = _Channels(writer, keys, _found(recording, keys))
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
        for gap in recording.gaps:
            writer.add_metadata(GAP, gap_metadata(gap))
        if recording.ending is not None:
            writer.add_metadata(ENDING, recording.ending.metadata())
        writer.finish()
    return Converted(messages, unreadable, recording.broken)


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


def _found(recording: Recording, keys: Keys) -> dict[Kind, Found]:
    """What is in the messages of each kind."""
    found: dict[Kind, Found] = {}
    for sighting in recording:
        with contextlib.suppress(MessageError, ValueError):
            kind, content = _read(sighting, keys)
            found.setdefault(kind, Found()).add(content)
    return found


def _read(sighting: Sighting, keys: Keys) -> tuple[Kind, dict[str, Any]]:
    """A sighting as a message of JSON, and of which kind it is.

    Raises:
        MessageError: it is no valid message.
        ValueError: it cannot be told to viewers.
    """
    key, message = read(sighting, keys)
    if message is None and sighting.payload:
        raise MessageError("key", "a message where there are none")
    return key.kind, {"present": not sighting.gone} if message is None else plain_content(message)


class _Told(NamedTuple):
    channel: int
    content: Mapping[str, Any]
    is_unreadable: bool = False


class _Channels:
    """The channels of the new file."""

    def __init__(self, writer: Writer, keys: Keys, found: Mapping[Kind, Found]) -> None:
        self._writer = writer
        self._keys = keys
        self._found = found
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def told(self, sighting: Sighting) -> _Told:
        """A sighting as a message of JSON."""
        try:
            kind, content = _read(sighting, self._keys)
            return _Told(self._channel(sighting.key, kind), content)
        except (MessageError, ValueError) as error:
            told = {
                "key": sighting.key,
                "reason": str(error),
                "payload": base64.b64encode(sighting.payload).decode(),
            }
            return _Told(self._unreadable(), told, is_unreadable=True)

    def _channel(self, topic: str, kind: Kind) -> int:
        if topic not in self._channels:
            schema = schema_of(kind)
            if schema is None or len(self._channels) >= MOST_CHANNELS:
                raise MessageError("key", "nothing is published on such keys")
            if schema.name not in self._schemas:
                self._register(schema.name, viewer_schema(schema.document, self._found.get(kind, Found())))
            self._channels[topic] = self._new(topic, schema.name)
        return self._channels[topic]

    def _unreadable(self) -> int:
        topic = f"{self._keys.prefix}{UNREADABLE}"
        if topic not in self._channels:
            self._register(_UNREADABLE_NAME, _UNREADABLE_SCHEMA)
            self._channels[topic] = self._new(topic, _UNREADABLE_NAME)
        return self._channels[topic]

    def _register(self, name: str, schema: Mapping[str, Any]) -> None:
        self._schemas[name] = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())

    def _new(self, topic: str, schema: str) -> int:
        return self._writer.register_channel(topic, "json", self._schemas[schema])


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
            check_new(path)  # to convert takes a while
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror}); expected a place for a new file") from None
