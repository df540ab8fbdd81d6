"""The journal: a world made again from it is the one that was never interrupted, and a file that is not sound is told of."""

import contextlib
import random
import shutil
import sqlite3
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.messages import Action, ChaosCommand, DecisionMade, DeedDone, Effect, LinkReport
from world_server.history import History, recall
from world_server.journal import APPLICATION, Journal
from world_server.world import DEAD_MAN

POOL = """
name: team
environment: {kind: task_pool, hand_over: %s, noise: 0.3}
tasks: {a: {}, b: {after: [a]}, c: {arrives: 3}}
robots:
  r0: {tasks: {a: 1, b: 2, c: 3}}
  r1: {tasks: {a: 2, b: 9}}
  r2: {joins: 4, tasks: {c: 6, a: 5}}
parameters: {trials: 2}
phases: [{learning: active, trials: 2, until: full}, {}]
faults:
  - {at: 1, robot: r0, kind: crash, restart: true, until: 5}
  - {at: 2, until: 9, robot: r1, kind: slow, factor: 3}
  - {at: 0, until: 6, link: {from: "*", to: r1}, loss: 0.5}
  - {at: 3, until: 8, robot: r1, kind: blind, delay: 1}
deadline: 40
seed: 5
"""
BOX = """
name: team
environment: {kind: box_pushing}
tasks: {a: {}, b: {}}
robots: {r0: {tasks: {a: 6, b: 6}}, r1: {tasks: {a: 7, b: 7}}, r2: {tasks: {a: 20}}}
faults:
  - {at: 2, until: 4, robot: r0, kind: hang}
  - {at: 5, robot: r1, kind: stuck, task: a}
deadline: 60
"""
MISSIONS = [POOL % hand_over for hand_over in ("shared_max", "shared_add", "restart")] + [BOX]


def mission_of(text: str) -> Mission:
    return parse_mission(text, "test.yaml")


class Driven:
    """A history that is driven by hand, on a journal or without one."""

    def __init__(self, mission: Mission, journal: Journal | None) -> None:
        self.history = History(mission, journal, lambda _: None)

    def put_in(self, deed: str, robot: str, task: str | None, number: int, now: float) -> None:
        history, trial = self.history, self.history.world.trial
        header: dict[str, Any] = {"sender": robot, "incarnation": 1 + number // 3, "seq": 1, "at": now}
        match deed:
            case "act":
                history.act(Action(**header, task=task, trial=trial, fewest=min(number, 2)), now)
            case "decided":
                made = {"verb": "activate", "cause": "silence", "other": "r0", "active_for": 0.0, "factors": {}}
                history.decided(DecisionMade(**header, **made, task=task or "a", trial=trial, teammates=[]), now)
            case "reported":
                names = [entry.name for entry in history.world.failures.entries][: number + 1]
                # Of a fault that is not yet there, and of one twice: no robot that works says so.
                names += ["5-mute", "1-crash"] if number == 4 else []
                effects = [Effect(fault=name, sender="r1", count=number) for name in names]
                counts = {"sent": 3, "received": number, "dropped": {"stale": 1}, "teammates": {}, "missed": 0}
                history.reported(LinkReport(**header, **counts, ticks=7, effects=effects), now)
            case "gone" | "there":
                history.presence(robot, deed == "there", now)
            case "launcher":
                history.launcher(number % 2 == 0, now)
            case "done":
                history.done(DeedDone(**header, number=number), now)
            case "command":
                faults = ['{"robot": "r1", "kind": "mute"}', '{"robot": "r2", "kind": "stuck"}', "{}"]
                verb, fault = ("heal", "") if number > 2 else ("inject", faults[number])
                with contextlib.suppress(UserError):
                    history.obey(ChaosCommand(**header, verb=verb, fault=fault, lasts=1.5), now)  # type: ignore[arg-type]
            case "begin":
                history.begin(now)
            case "advance":
                history.advance(now)

    def state(self) -> dict[str, Any]:
        world = self.history.world
        return {
            "summary": world.summary(), "tasks": world.tasks(), "orders": world.orders(), "rules": world.rules(),
            "blind": world.blind(), "bodies": world.bodies, "elapsed": world.elapsed, "stage": world.stage,
            "trial": world.trial, "learning": world.learning, "next": world.next_change(),
            "launcher": world.has_launcher, "missing": world.missing(), "lives": world.ledger.lives(),
        }  # fmt: skip


def crash_image(journal: Path, to: Path) -> Path:
    """What a server that is killed now leaves behind."""
    for path in (journal, journal.with_name(f"{journal.name}-wal")):
        if path.exists():
            shutil.copy(path, to.with_name(path.name.replace(journal.name, to.name)))
    return to


STEPS = st.tuples(
    st.sampled_from([0.0, 0.001, 0.05, 0.3, 1.0, 2.0, DEAD_MAN, 4.0]),
    st.sampled_from(
        [*["act"] * 6, "decided", "reported", "reported", "gone", "there", "launcher", "done", "command", "begin"]
        + ["advance"] * 4 + ["commit"] * 4 + ["kill"]
    ),
    st.sampled_from(["r0", "r1", "r2"]),
    st.sampled_from(["a", "a", "b", "c", None, "unknown"]),
    st.integers(0, 4),
)  # fmt: skip


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(MISSIONS), st.lists(STEPS, max_size=120))
def test_a_world_that_was_killed_any_number_of_times_is_the_one_that_was_not(
    text: str, steps: list[tuple[float, str, str, str | None, int]]
) -> None:
    """Only what was committed counts: the other world is given just that."""
    mission, now, lives = mission_of(text), 0.0, 1
    whole = [("there", robot, None, 0, 0.0) for robot in mission.robots] + [("begin", "r0", None, 0, 0.0)]
    with tempfile.TemporaryDirectory() as folder:
        journal = Journal(Path(folder) / "journal-1", mission)
        driven = Driven(mission, journal)
        for one in whole:
            driven.put_in(*one)
        journal.commit()
        lost: list[tuple[str, str, str | None, int, float]] = []
        for wait, deed, robot, task, number in [*steps, (0.0, "commit", "", None, 0), (0.0, "kill", "", None, 0)]:
            now += wait
            if deed == "commit":
                journal.commit()
                whole, lost = whole + lost, []
            elif deed == "kill":
                lives += 1
                image = crash_image(journal.path, journal.path.with_name(f"journal-{lives}"))
                journal.close()
                journal, lost = Journal(image, mission), []
                driven = Driven(mission, journal)
                now = driven.history.now
            else:
                driven.put_in(deed, robot, task, number, now)
                lost.append((deed, robot, task, number, now))
        journal.close()
    other = Driven(mission, None)
    for one in whole:
        other.put_in(*one)
    assert driven.state() == other.state()
    assert driven.history.now == other.history.now


def test_what_robots_repeat_each_second_does_not_make_the_journal_grow(tmp_path: Path) -> None:
    mission = mission_of(BOX.replace("deadline: 60", "deadline: 1000"))
    with Journal(tmp_path / "journal", mission) as journal:
        driven = Driven(mission, journal)
        for robot in mission.robots:
            driven.put_in("there", robot, None, 0, 0.0)
        driven.put_in("begin", "", None, 0, 0.0)
        for second in range(1, 501):
            for robot in mission.robots:
                driven.put_in("act", robot, None, 0, float(second))
                driven.put_in("reported", robot, None, 0, float(second))
            journal.commit()
        kinds = [entry.kind for entry in journal.entries()]
    assert sorted(kinds) == ["act"] * 3 + ["begin"] + ["presence"] * 3 + ["reported"] * 3
    assert recall(tmp_path / "journal", mission).bodies["r0"].refreshed == 500.0


def test_counters_of_every_life_and_when_a_fault_was_first_seen_to_fire_are_kept(tmp_path: Path) -> None:
    mission = mission_of(BOX.replace("deadline", "  - {at: 1, link: {from: '*', to: r1}, loss: 0.5}\ndeadline"))
    counts = {"received": 0, "dropped": {}, "teammates": {}, "ticks": 0, "missed": 0}
    with Journal(tmp_path / "journal", mission) as journal:
        history = History(mission, journal, lambda _: None)
        history.presence("r0", True, 0.0)
        history.begin(0.0)
        for second in range(1, 9):
            effects = [Effect(fault="3-link", sender="r0", count=second)]
            header = {"sender": "r1", "incarnation": second // 4, "seq": second, "at": 0.0}
            history.reported(LinkReport(**header, **counts, sent=10 * second, effects=effects), float(second))
        journal.commit()
        summary = history.world.summary()
        assert [entry.at for entry in journal.entries() if entry.kind == "reported"] == [1.0, 3.0, 7.0, 8.0]
    assert recall(tmp_path / "journal", mission).summary() == summary
    assert summary["messages"]["sent"] == 30 + 70 + 80
    assert [(one["count"], one["fired_at"]) for one in summary["faults"]][2] == (18, 1.0)


def test_a_world_that_waits_for_its_team_does_not_make_the_journal_grow(tmp_path: Path) -> None:
    mission = mission_of(BOX)
    with Journal(tmp_path / "journal", mission) as journal:
        driven = Driven(mission, journal)
        for second in range(1000):
            driven.put_in("advance", "", None, 0, float(second))
            driven.put_in("act", "r0", None, 0, float(second))
            driven.put_in("reported", "r0", None, 0, float(second))
        journal.commit()
        assert len(list(journal.entries())) == 4
        assert History(mission, journal, lambda _: None).now == 999.0


def test_lives_are_numbered_upwards_whatever_the_calendar_says(tmp_path: Path) -> None:
    numbers = []
    for fresh in (100, 90, 500, 500):
        with Journal(tmp_path / "journal", mission_of(BOX)) as journal:
            numbers.append(journal.next_incarnation(fresh))
    assert numbers == [100, 101, 500, 501]


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
