"""The journal's file: what cannot be used is told of in a sentence, and what is not the journal's own stays as it is."""

import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
from support.driven import BOX, Driven, crash_image, mission_of

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from world_server.history import History, recall
from world_server.journal import APPLICATION, Journal


def make(path: Path, text: str = BOX) -> Path:
    """A journal with some entries, on `path`."""
    mission = mission_of(text)
    with Journal(path, mission) as journal:
        driven = Driven(mission, journal)
        for robot in mission.robots:
            driven.put_in("there", robot, None, 0, 0.0)
        driven.put_in("begin", "", None, 0, 0.0)
        for step in range(1, 300):
            driven.put_in("act", "r0", "a", step // 100, step / 100)
            driven.put_in("advance", "", None, 0, step / 100)
            journal.commit()
        crash_image(path, path.with_name("image"))
    path.with_name("image").replace(path)
    path.with_name("image-wal").replace(path.with_name(f"{path.name}-wal"))
    return path


def refusal(path: Path, mission: Mission) -> str:
    with pytest.raises(UserError) as refused:
        recall(path, mission)
    return str(refused.value)


def a_text(path: Path) -> None:
    path.write_text("name: team\n" * 40)


def a_short_text(path: Path) -> None:
    path.write_text("SQLite")


def a_database_of_another_program(path: Path) -> None:
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE entry (number)")
    database.close()


def a_newer_journal(path: Path) -> None:
    a_database_of_another_program(path)
    with sqlite3.connect(path) as database:
        database.execute(f"PRAGMA application_id = {APPLICATION}")
        database.execute("PRAGMA user_version = 2")
    database.close()


NO_JOURNAL = "this is no journal; expected the journal of a world server, or a file that does not exist yet"
FOREIGN = NO_JOURNAL.replace("no journal", "a database of another program")
NEWER = (
    "this journal is of version 2, and this program knows version 1; expected the program that wrote it, or another file "
    "for --journal"
)


@pytest.mark.parametrize(
    ("prepare", "sentence"),
    [
        (a_text, NO_JOURNAL),
        (a_short_text, NO_JOURNAL),
        (a_database_of_another_program, FOREIGN),
        (a_newer_journal, NEWER),
    ],
)
def test_what_is_no_journal_is_refused_and_stays_as_it_is(
    tmp_path: Path, prepare: Callable[[Path], None], sentence: str
) -> None:
    path = tmp_path / "file"
    prepare(path)
    before = path.read_bytes()
    assert refusal(path, mission_of(BOX)) == f"{path}: {sentence}"
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_place_where_no_journal_can_be_is_refused(tmp_path: Path) -> None:
    mission = mission_of(BOX)
    assert refusal(tmp_path, mission) == f"{tmp_path}: this is no file; expected the path of a journal, or of a new one"
    nowhere = tmp_path / "no" / "journal"
    assert (
        refusal(nowhere, mission) == f"{nowhere}: there is no such folder; expected a journal in a folder that exists"
    )
    unwritable = Path("/proc/journal")
    assert refusal(unwritable, mission).startswith(f"{unwritable}: the journal cannot be")
    assert refusal(Path("/dev/zero"), mission).startswith("/dev/zero: this is no file")


@pytest.mark.parametrize(
    ("now", "sentence"),
    [
        (BOX.replace("team", "crew"), "this is the journal of mission team, not of crew; expected that mission"),
        (BOX + "seed: 9\n", "this journal began with seed 0, not 9; expected --seed 0"),
        (
            BOX.replace("a: 20", "a: 21"),
            "mission team has changed since this journal began; expected the mission file as it was then",
        ),
    ],
)
def test_the_journal_of_another_mission_is_refused_and_still_good_for_its_own(
    tmp_path: Path, now: str, sentence: str
) -> None:
    path = make(tmp_path / "journal")
    assert refusal(path, mission_of(now)) == f"{path}: {sentence}, or another file for --journal"
    assert recall(path, mission_of(BOX)).elapsed == 2.99


def test_a_journal_is_open_once(tmp_path: Path) -> None:
    path = make(tmp_path / "journal")
    with Journal(path, mission_of(BOX)):
        assert refusal(path, mission_of(BOX)) == (
            f"{path}: another world server has this journal open; expected one world server at a time; end that one first"
        )
    assert recall(path, mission_of(BOX)).elapsed == 2.99


def test_a_file_that_was_only_just_begun_is_a_new_journal(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    path.touch()
    assert recall(path, mission_of(BOX)).elapsed == 0.0
    # Killed while making it: SQLite's note how to undo it is still there, and nothing else that is whole.
    other = tmp_path / "other"
    other.write_bytes(path.read_bytes()[:512])
    shutil.copy(other, tmp_path / "other-journal")
    assert "cannot be used" in refusal(other, mission_of(BOX))


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE entry SET at = at + 1 WHERE number = 5",
        "UPDATE entry SET at = NULL WHERE number = 5",
        "UPDATE entry SET kind = 'advance' WHERE number = 5",
        "UPDATE entry SET content = x'00' WHERE number = 5",
        "UPDATE entry SET content = 'text' WHERE number = 5",
        "UPDATE entry SET checksum = NULL WHERE number = 5",
        "UPDATE lasting SET until = until + 1 WHERE number = 5",
        "UPDATE lasting SET until = 9e999 WHERE number = 5",
        "UPDATE lasting SET checksum = 0 WHERE number = 5",
    ],
)
def test_an_entry_that_was_altered_is_told_of(tmp_path: Path, change: str) -> None:
    path = make(tmp_path / "journal")
    with sqlite3.connect(path) as database:
        assert database.execute(change).rowcount == 1
    database.close()
    assert refusal(path, mission_of(BOX)) == (
        f"{path}: entry 5 of the journal is damaged; expected a file as this program has left it, or another for --journal"
    )


@pytest.mark.parametrize("kind", ["act", "decided", "reported", "done", "command", "presence", "unknown"])
def test_an_entry_that_says_nothing_known_is_told_of(tmp_path: Path, kind: str) -> None:
    with Journal(tmp_path / "journal", mission_of(BOX)) as journal:
        journal.record(kind, 1.0, b"\xff\xc1")
        journal.commit()
    assert "entry 1 of the journal is damaged" in refusal(tmp_path / "journal", mission_of(BOX))


@pytest.mark.parametrize("change", ["DELETE FROM mission", "UPDATE mission SET seed = 'x'", "DROP TABLE lasting"])
def test_a_journal_without_what_every_journal_has_is_told_of(tmp_path: Path, change: str) -> None:
    path = make(tmp_path / "journal")
    with sqlite3.connect(path) as database:
        database.execute(change)
    database.close()
    assert refusal(path, mission_of(BOX)).startswith(f"{path}: the journal cannot be ")


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("part", ["", "-wal"])
def test_a_damaged_file_is_told_of_or_resumes_earlier(tmp_path: Path, seed: int, part: str) -> None:
    """What SQLite cannot tell, checksums do: the world is one that has been, or there is a sentence."""
    path = make(tmp_path / "journal")
    if part == "" and seed % 2:
        recall(path, mission_of(BOX))  # all of it is in the file itself now
    broken = path.with_name(f"journal{part}")
    content = bytearray(broken.read_bytes())
    draw = random.Random(seed)
    if seed % 4 < 2:
        del content[draw.randrange(len(content)) :]
    else:
        for _ in range(3):
            content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    broken.write_bytes(content)
    try:
        world = recall(path, mission_of(BOX))
    except UserError:
        assert "expected" in refusal(path, mission_of(BOX)).removeprefix(f"{path}: ")
        return
    assert world.elapsed == round(world.elapsed, 2) <= 2.99
    # A box that is pushed at one end jams at a tenth of the way.
    assert world.tasks()["a"].progress == pytest.approx(min(max(world.elapsed - 0.01, 0.0) / 6, 0.1))


def test_a_journal_that_cannot_be_written_any_more_says_so_and_keeps_what_it_has(tmp_path: Path) -> None:
    mission = mission_of(BOX)
    with Journal(tmp_path / "journal", mission) as journal:
        journal._database.execute("PRAGMA max_page_count = 6")
        history = History(mission, journal, lambda _: None)
        for number in range(1000):
            history.presence("r0", number % 2 == 0, float(number))
        for _ in range(2):
            with pytest.raises(UserError, match=r"cannot be written \(database or disk is full\); expected room, and"):
                history.commit()
        journal._database.execute("PRAGMA max_page_count = 100")
        history.commit()
        assert len(list(journal.entries())) == 1000
