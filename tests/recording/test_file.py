"""The file: what is written is read, whatever became of the writer and of the file."""

import json
import tracemalloc
from pathlib import Path
from typing import BinaryIO

import jsonschema
import lz4.frame
import msgpack
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.writer import Writer
from recording.made_up import KEYS, MISSION, TEXT, activity, mixture, seen, small, write

from lalliance_agents.errors import UserError
from lalliance_agents.wire.keys import Kind
from mission_control.recording.format import ABOUT, MOST_STRANGE, PROFILE, About, Ending
from mission_control.recording.reader import Recording, information, sightings
from mission_control.recording.writer import RecordingWriter, check_new


def test_what_is_written_is_read_in_the_same_order(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", mixture())
    told: list[str] = []
    assert list(sightings(path, told.append)) == list(mixture())
    assert told == []
    found = information(path)
    assert (found.about.mission, found.about.text, found.about.seed) == ("depot", TEXT, MISSION.seed)
    assert (found.messages, found.duration, found.complete) == (12, 3.3, True)
    assert found.counts[KEYS.build(Kind.ALIVE, robot="lifter")] == 3
    assert found.ending == Ending("over", 3)


def test_its_index_says_what_reading_all_of_it_says(tmp_path: Path) -> None:
    recording = Recording(write(tmp_path / "a.mcap", mixture(), flush_each=True))
    assert recording.summarized() == recording.counted()


def test_others_read_it_and_find_each_payload_as_its_schema_says(tmp_path: Path) -> None:
    checked = 0
    with write(tmp_path / "a.mcap", mixture()).open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if schema is not None and message.data:
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "msgpack")
                jsonschema.validate(msgpack.unpackb(message.data), json.loads(schema.data))
                checked += 1
    assert checked == 9


def test_wherever_a_file_is_cut_it_gives_a_beginning_of_what_was_written(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.mcap", small(), flush_each=True).read_bytes()
    expected = list(small())
    cut = tmp_path / "cut.mcap"
    lengths = []
    refusals = set()
    for length in range(len(whole)):
        cut.write_bytes(whole[:length])
        try:
            recording = Recording(cut)
        except UserError as error:
            assert not lengths
            refusals.add(str(error).removeprefix(f"{cut}: ").partition(",")[0].partition(";")[0].partition(" at ")[0])
            continue
        got = list(recording)
        assert got == expected[: len(got)]
        assert recording.broken
        if length % 50 == 0:
            assert information(cut).messages == len(got)
        lengths.append(len(got))
    assert lengths == sorted(lengths)
    assert set(lengths) == set(range(len(expected) + 1))
    assert refusals == {
        "an empty file",
        "not an MCAP file",
        "it ends",
        "it breaks off in the middle of a record",
    }


def test_what_a_byte_of_damage_hits_is_not_made_up(tmp_path: Path) -> None:
    """Wherever a bit is turned over: what is read is a beginning of what was written, or the file is refused."""
    whole = write(tmp_path / "a.mcap", mixture(), flush_each=True).read_bytes()
    expected = list(mixture())
    first = len(TEXT) + 200
    end = whole.rindex(b"lalliance/ending")
    hurt = tmp_path / "hurt.mcap"
    for place in range(first, end, 11):
        hurt.write_bytes(whole[:place] + bytes([whole[place] ^ 0x10]) + whole[place + 1 :])
        got = list(sightings(hurt))
        assert got == expected[: len(got)], place


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "an empty file"),
        (b"\x1f\x8b\x08 something else entirely", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "it ends at byte 8 without having been closed, before its first message"),
        (
            b"\x89MCAP0\r\n" + b"\xff" * 40,
            "it breaks off in the middle of a record, at byte 48, before its first message",
        ),
        (b"\x89MCAP0\r\n\x01\x04" + bytes(11), "it is damaged at byte 8, before its first message"),
    ],
)
def test_what_is_no_recording_is_refused_in_a_sentence(tmp_path: Path, content: bytes, sentence: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    expected = f"{path}: {sentence}; expected what `lalliance record` or `lalliance run --record` writes"
    with pytest.raises(UserError) as caught:
        Recording(path)
    assert str(caught.value) == expected


def test_a_file_of_somebody_else_is_refused(tmp_path: Path) -> None:
    for profile, what in (("ros2", "an MCAP file of the profile 'ros2'"), ("", "an MCAP file of somebody else")):
        path = tmp_path / f"x{profile}.mcap"
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile)
            writer.finish()
        with pytest.raises(UserError, match=f"{what}; expected what `lalliance record`"):
            information(path)


def test_nothing_is_overwritten_and_nothing_empty_is_left(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("precious")
    with pytest.raises(UserError, match=r"a\.mcap: there is something already"):
        RecordingWriter(path, MISSION, TEXT)
    assert path.read_text() == "precious"
    with pytest.raises(UserError, match=r"no recording can be written there \(No such file or directory\)"):
        RecordingWriter(tmp_path / "nowhere" / "a.mcap", MISSION, TEXT)
    check_new(tmp_path / ("x" * 300))
    with pytest.raises(UserError, match=r"no recording can be written there \(File name too long\)"):
        RecordingWriter(tmp_path / ("x" * 300), MISSION, TEXT)
    write(tmp_path / "b.mcap", [])
    assert not (tmp_path / "b.mcap").exists()


def test_where_there_is_no_room_for_a_recording_no_file_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"

    def create(path: Path) -> BinaryIO:
        path.touch()
        return Path("/dev/full").open("wb")

    monkeypatch.setattr("mission_control.recording.writer._create", create)
    with pytest.raises(
        UserError, match=r"No space left on device\); it ends before, before its first message; expected"
    ):
        RecordingWriter(path, MISSION, TEXT)
    assert not path.exists()


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_unpacks_to_more_than_it_says_is_damage(tmp_path: Path, compression: str) -> None:
    """Whatever it packs: no more than was said is unpacked."""
    zeros = bytes(2**27)
    packed = zstandard.compress(zeros) if compression == "zstd" else lz4.frame.compress(zeros)
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start(PROFILE)
        writer.add_metadata(ABOUT, About("depot", TEXT, 1, "0").metadata())
        head = file.tell()
        writer.finish()
    builder = RecordBuilder()
    Chunk(compression, packed, 0, 0, 0, 1000).write(builder)
    path.write_bytes(path.read_bytes()[:head] + builder.end())
    tracemalloc.start()
    recording = Recording(path)
    assert list(recording) == []
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert recording.broken == f"{path}: it is damaged at byte {head}; all that stands before was read"
    assert most < 2**22


def test_who_makes_up_keys_does_not_fill_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    own = KEYS.build(Kind.ACTIVITY, robot="lifter", task="crate")
    with RecordingWriter(path, MISSION, TEXT) as writer:
        for number in range(MOST_STRANGE + 50):
            writer.add(seen(number, f"{KEYS.prefix}heartbeat/ghost-{number}", b"boo"))
        writer.add(seen(5000, own, activity(1)))
        assert (writer.refused, writer.written) == (50, MOST_STRANGE + 1)
    assert information(path).counts[own] == 1
