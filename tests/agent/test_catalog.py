"""The catalog: old or new after a crash, a robot that starts whatever it finds, and lives that only count up."""

import json
from pathlib import Path
from typing import Any

import pytest

from lalliance_agents import whole_file
from lalliance_agents.agent import catalog as module
from lalliance_agents.agent.catalog import Catalog
from lalliance_agents.errors import UserError
from lalliance_agents.model.monitor import Record
from lalliance_agents.wire.messages import Heartbeat, encode

LEARNED = {"push": {"r1": Record((4.0, 5.5), 6.0, 2), "r2": Record((9.25,))}}
MORE = {"push": {"r1": Record((4.0, 5.5, 1.0))}, "lift": {"r1": Record((), 3.0, 1)}}


def stored(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "r1.json").read_text())
    return document


def test_what_was_learned_is_there_in_the_next_life(tmp_path: Path) -> None:
    first = Catalog(tmp_path / "new" / "folder", "r1")
    assert first.learned == {}
    first.save(LEARNED)
    second = Catalog(tmp_path / "new" / "folder", "r1")
    assert second.learned == LEARNED
    assert second.incarnation > first.incarnation
    assert [path.name for path in (tmp_path / "new" / "folder").iterdir()] == ["r1.json"]


def test_where_writing_fails_what_was_learned_before_is_still_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    catalog = Catalog(tmp_path, "r1")
    catalog.save(LEARNED)
    with monkeypatch.context() as patch:
        patch.setattr(module, "written_whole", lambda path: whole_file.written_whole(path / "no folder"))
        with pytest.raises(OSError, match="Not a directory"):
            catalog.save(MORE)
    assert Catalog(tmp_path, "r1").learned == LEARNED


def test_tasks_that_this_mission_does_not_have_are_kept(tmp_path: Path) -> None:
    Catalog(tmp_path, "r1").save(LEARNED)
    Catalog(tmp_path, "r1").save({"lift": {"r1": Record((2.0,))}})
    assert Catalog(tmp_path, "r1").learned == {**LEARNED, "lift": {"r1": Record((2.0,))}}


def test_what_a_life_killed_while_writing_left_is_cleared_away_and_nothing_else(tmp_path: Path) -> None:
    Catalog(tmp_path, "r1").save(LEARNED)
    (tmp_path / ".r1.json.k3j2").write_text('{"version": 1, "rob')
    others = {".r10.json.k3j2", "r10.json", ".r1.txt"}
    for other in others:
        (tmp_path / other).write_text("")
    assert Catalog(tmp_path, "r1").learned == LEARNED
    assert {path.name for path in tmp_path.iterdir()} == {"r1.json", *others}


def document(**changes: object) -> bytes:
    learned = {"push": {"r1": {"samples": [4.0], "floor": 0.0, "floor_left": 0}}}
    return json.dumps({"version": 1, "robot": "r1", "incarnation": 3, "learned": learned} | changes).encode()


def with_record(**record: object) -> bytes:
    return document(learned={"push": {"r1": record}})


UNUSABLE = {
    "empty": b"",
    "truncated": document()[:40],
    "binary": bytes(range(256)),
    "not a map": b"[1, 2]",
    "null": b"null",
    "a later version": document(version=2),
    "no version": b'{"robot": "r1", "incarnation": 3, "learned": {}}',
    "another robot": document(robot="r2"),
    "NaN": with_record(samples=[float("nan")]),
    "infinity": with_record(samples=[float("inf")]),
    "no time": with_record(samples=[0.0]),
    "negative": with_record(samples=[-1.0]),
    "longer than can be said": with_record(samples=[1e300]),
    "infinite floor": with_record(samples=[], floor=float("inf")),
    "huge floor_left": with_record(samples=[], floor_left=10**400),
    "words": with_record(samples=["long"]),
    "unknown field": with_record(samples=[1.0], colour="red"),
    "negative incarnation": document(incarnation=-1),
    "an incarnation that does not fit into a message": document(incarnation=2**63 - 1),
    "deep": b'{"a":' * 10_000,
    "not UTF-8": document(robot="r1").replace(b"r1", b"\xff\xfe"),
}


@pytest.mark.parametrize("content", UNUSABLE.values(), ids=UNUSABLE)
def test_a_file_that_cannot_be_used_is_set_aside_and_the_robot_starts(
    tmp_path: Path, content: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "r1.json").write_bytes(content)
    catalog = Catalog(tmp_path, "r1")
    assert catalog.learned == {}
    assert encode(Heartbeat(sender="r1", incarnation=catalog.incarnation, seq=0, at=0.0, trial=0))
    [aside] = tmp_path.glob("r1.json.damaged-*")
    assert aside.read_bytes() == content
    [record] = caplog.records
    assert aside.name in record.message
    assert "starting without learned times" in record.message
    catalog.save(LEARNED)
    assert Catalog(tmp_path, "r1").learned == LEARNED


def test_a_folder_that_cannot_be_used_is_said_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(
        UserError, match=r"file: learned times cannot be stored here \(File exists\); expected a folder"
    ):
        Catalog(tmp_path / "file", "r1")
    (tmp_path / "r1.json").mkdir()
    with pytest.raises(UserError, match=r"r1\.json: cannot be read \(Is a directory\); expected a file"):
        Catalog(tmp_path, "r1")


@pytest.mark.parametrize("content", [None, b"damaged"])
def test_a_folder_that_cannot_be_written_to_is_said_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes | None
) -> None:
    """Also where the first thing that fails is to set a damaged file aside."""
    if content is not None:
        (tmp_path / "r1.json").write_bytes(content)

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "replace", refuse)
    monkeypatch.setattr(module.tempfile, "mkstemp", refuse)
    with pytest.raises(
        UserError, match=r"r1\.json: cannot be written \(Permission denied\); .* need a writable folder"
    ):
        Catalog(tmp_path, "r1")


def test_lives_count_up_also_if_the_file_is_lost_or_the_calendar_goes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lives = []
    calendar = 1_700_000_000_000_000_000
    for change in ("none", "none", "back", "back", "forth", "lost", "back"):
        calendar += {"back": -(10**18), "forth": 3 * 10**18}.get(change, 1_000_000)
        monkeypatch.setattr(module.time, "time_ns", lambda now=calendar: now)
        if change == "lost":
            (tmp_path / "r1.json").unlink()
        lives.append(Catalog(tmp_path, "r1").incarnation)
    assert lives == sorted(set(lives))


def test_a_life_is_counted_as_soon_as_it_begins(tmp_path: Path) -> None:
    assert Catalog(tmp_path, "r1").incarnation == stored(tmp_path)["incarnation"]
    (tmp_path / "r1.json").write_bytes(document(incarnation=2**61))
    catalog = Catalog(tmp_path, "r1")
    assert catalog.incarnation == 2**61 + 1
    assert encode(Heartbeat(sender="r1", incarnation=catalog.incarnation, seq=0, at=0.0, trial=0))
