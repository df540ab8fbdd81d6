"""Recordings made up for tests, without a bus."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, encode
from mission_control.recording.format import Ending
from mission_control.recording.writer import RecordingWriter
from mission_control.watch.sighting import Sighting

TEXT = """\
name: depot
tasks: {crate: {}}
robots: {lifter: {tasks: {crate: 5}}}
"""
MISSION = parse_mission(TEXT, "depot.yaml")
KEYS = Keys("depot")
#: A wall clock, in nanoseconds.
BEGIN = 1_700_000_000_000_000_000


def seen(at: float, key: str, payload: bytes = b"", *, gone: bool = False) -> Sighting:
    """A sighting, `at` seconds after the beginning."""
    return Sighting(BEGIN + round(at * 1e9), at, key, payload, gone)


def activity(seq: int) -> bytes:
    header = {"sender": "lifter", "incarnation": 1, "seq": seq, "at": 0.5}
    return encode(BODY_OF[Kind.ACTIVITY](**header, task="crate", trial=0, active_for=0.25 * seq, expected=5.0))


def event(seq: int, text: str) -> bytes:
    header = {"sender": WORLD, "incarnation": 1, "seq": seq, "at": 0.5}
    return encode(BODY_OF[Kind.EVENT](**header, kind="present", elapsed=0.0, trial=0, text=text))


def mixture() -> Iterator[Sighting]:
    """One of everything that a recording must hold: presences, messages, and what nobody can read."""
    key = KEYS.build(Kind.ACTIVITY, robot="lifter", task="crate")
    yield seen(0.0, KEYS.build(Kind.ALIVE, robot="lifter"))
    yield seen(0.1, KEYS.build(Kind.LAUNCHER))
    yield seen(0.2, KEYS.build(Kind.EVENT), event(1, "lifter is there"))
    for number in range(1, 6):
        yield seen(0.2 + 0.5 * number, key, activity(number))
    yield seen(3.0, KEYS.build(Kind.ALIVE, robot="lifter"), b"a presence does not speak")
    yield seen(3.1, f"{KEYS.prefix}of/nobody", b"\xc1 no msgpack")
    yield seen(3.2, key, b"")
    yield seen(3.3, KEYS.build(Kind.ALIVE, robot="lifter"), gone=True)


def small() -> Iterator[Sighting]:
    """Little, so that there are few places where its file can be cut."""
    yield seen(0.0, KEYS.build(Kind.ALIVE, robot="lifter"))
    for number in range(3):
        yield seen(0.5 + number, f"{KEYS.prefix}of/nobody", f"number {number}".encode())
    yield seen(3.3, KEYS.build(Kind.ALIVE, robot="lifter"), gone=True)


def write(path: Path, what: Iterable[Sighting], *, flush_each: bool = False) -> Path:
    """A recording of `what`."""
    with RecordingWriter(path, MISSION, TEXT) as writer:
        for sighting in what:
            writer.add(sighting)
            if flush_each:
                writer.flush()
        writer.ending = Ending("over", 3)
    return path
