"""A converted recording: viewers' own rules for schemas, every message by its schema, and nothing left out."""

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import jsonschema
import msgpack
import pytest
from mcap.reader import make_reader
from recording.made_up import mixture, seen, write
from wire.samples import KEYS as KEYS_OF_SAMPLES
from wire.samples import valid

from lalliance_agents.errors import UserError
from lalliance_agents.wire.messages import BODY_OF, decode_at
from mission_control.recording.convert import convert, plain_content
from mission_control.recording.format import ABOUT
from mission_control.recording.reader import Recording, information, sightings
from mission_control.watch.sighting import Sighting


def messages(path: Path) -> Iterator[tuple[str, str, dict[str, Any], Any]]:
    """Topic, name of the schema, schema and content of each message, all of which are JSON."""
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert (channel.message_encoding, schema.encoding) == ("json", "jsonschema")
            yield channel.topic, schema.name, json.loads(schema.data), json.loads(message.data)


def samples() -> Iterator[Sighting]:
    draw = Random(1)
    for number, kind in enumerate([kind for kind in BODY_OF for _ in range(10)]):
        message = valid(kind, draw)
        payload = message.payload if number % 2 else msgpack.packb(smaller(message.document))
        yield seen(number * 0.01, message.key.replace("/m/", "/depot/"), payload)


def smaller(value: Any) -> Any:
    """A document without numbers that doubles do not hold."""
    if isinstance(value, dict):
        return {key: smaller(one) for key, one in value.items()}
    if isinstance(value, list):
        return [smaller(one) for one in value]
    return min(value, 2**53 - 1) if type(value) is int else value


def is_taken(schema: dict[str, Any], place: str = "field") -> bool:
    """Whether viewers make a field of it: one that they do not take, anywhere, costs the topic."""
    match schema.get("type"):
        case "object":
            return all(map(is_taken, schema["properties"].values()))
        case "array":
            return place == "field" and is_taken(schema["items"], "item")
        case "string":
            return schema.get("contentEncoding") in ((None, "base64") if place == "field" else (None,))
        case kind:
            return kind in ("boolean", "number", "integer")


def unnamed(schema: dict[str, Any], content: Any) -> Iterator[str]:
    """What is in a message and not among the fields of its schema, so that no viewer offers it."""
    if isinstance(content, dict):
        yield from content.keys() - schema["properties"].keys()
        for name in content.keys() & schema["properties"].keys():
            yield from unnamed(schema["properties"][name], content[name])
    elif isinstance(content, list):
        for one in content:
            yield from unnamed(schema["items"], one)


def test_every_kind_of_message_is_as_its_schema_says_and_nothing_is_left_out(tmp_path: Path) -> None:
    path, out = write(tmp_path / "a.mcap", samples()), tmp_path / "json.mcap"
    done = convert(path, out)
    found = list(messages(out))
    assert done.messages == len(found) == len(BODY_OF) * 10
    assert all(schema["type"] == "object" and is_taken(schema) for _, _, schema, _ in found)
    for _, _, schema, content in found:
        jsonschema.validate(content, schema)
        assert list(unnamed(schema, content)) == []
    assert {name for _, name, _, _ in found} == {
        "lalliance.Unreadable",
        *(f"lalliance.{body.__name__}" for body in BODY_OF.values()),
    }
    bytes_of = [(one["key"], base64.b64decode(one["payload"])) for _, name, _, one in found if "Unreadable" in name]
    assert len(bytes_of) == done.unreadable
    too_large = [one for one in found if "Unreadable" in one[1] and "larger than a double" not in one[3]["reason"]]
    assert too_large == []
    assert set(bytes_of) < {(one.key, one.payload) for one in samples()}


def test_what_is_no_message_goes_unchanged_to_a_channel_of_its_own(tmp_path: Path) -> None:
    path, out = write(tmp_path / "a.mcap", mixture()), tmp_path / "json.mcap"
    done = convert(path, out)
    found = list(messages(out))
    unreadable = [content for topic, _, _, content in found if topic == "lalliance/depot/@unreadable"]
    assert (done.messages, done.unreadable, done.broken) == (12, 3, None)
    assert [(one["key"], base64.b64decode(one["payload"])) for one in unreadable] == [
        ("lalliance/depot/alive/lifter", b"a presence does not speak"),
        ("lalliance/depot/of/nobody", b"\xc1 no msgpack"),
        ("lalliance/depot/activity/crate/lifter", b""),
    ]
    assert [content for _, name, _, content in found if name == "lalliance.Presence"] == [
        {"present": True},
        {"present": True},
        {"present": False},
    ]


def test_it_keeps_when_things_were_seen_and_which_mission_it_is(tmp_path: Path) -> None:
    path, out = write(tmp_path / "a.mcap", mixture()), tmp_path / "json.mcap"
    convert(path, out)
    with out.open("rb") as file:
        reader = make_reader(file)
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
        [about] = [record.metadata for record in reader.iter_metadata() if record.name == ABOUT]
    assert times == [one.seen_at for one in sightings(path)]
    assert about["text"] == information(path).about.text
    with pytest.raises(UserError, match="one that was converted for viewers"):
        information(out)


def test_a_seed_is_told_to_its_last_digit_and_what_is_missing_is_left_out() -> None:
    draw = Random(2)
    told = set()
    for kind in BODY_OF:
        for _ in range(50):
            message = valid(kind, draw)
            try:
                content = plain_content(decode_at(KEYS_OF_SAMPLES.parse(message.key), message.payload))
            except ValueError:
                continue
            assert None not in content.values()
            if "seed" in content:
                assert content["seed"] == str(message.document["seed"])
                told.add(content["seed"])
    assert any(int(seed) > 2**53 for seed in told)


def test_nothing_is_left_of_what_could_not_be_written_and_nothing_is_overwritten(tmp_path: Path) -> None:
    path, out = write(tmp_path / "a.mcap", mixture()), tmp_path / "json.mcap"
    out.write_text("precious")
    with pytest.raises(UserError, match=r"json\.mcap: there is something already"):
        convert(path, out)
    assert out.read_text() == "precious"
    with pytest.raises(UserError, match="no such file"):
        convert(tmp_path / "none.mcap", tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()


def test_what_came_to_its_place_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    out = tmp_path / "json.mcap"

    def put_there() -> Iterator[Sighting]:
        yield from mixture()
        out.write_text("precious")

    path = write(tmp_path / "a.mcap", mixture())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Recording, "__iter__", lambda _: put_there())
        with pytest.raises(UserError, match=r"json\.mcap: there is something already"):
            convert(path, out)
    assert out.read_text() == "precious"
    assert {one.name for one in tmp_path.iterdir()} == {"a.mcap", "json.mcap"}
