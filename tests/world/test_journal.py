"""The journal: a world made again from it is the one that was never interrupted, however long it ran."""

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from support.driven import BOX, MISSIONS, Driven, crash_image, mission_of

from lalliance_agents.wire.messages import Effect, LinkReport
from world_server.bodies import DEAD_MAN
from world_server.history import History, recall
from world_server.journal import Journal

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
