"""The journal: an SQLite file with all that ever went into a world, so that a killed world server can go on.

The world is pure and deterministic, so its inputs are its state: put into a fresh world of the same mission, each at its own
instant and in the same order, they make the same world, to the last bit. An entry is one input. It is never changed; that
the same input came again and again until some instant, as a refreshed action does, is written beside it (`lasting`), and an
entry that a later one makes idle is removed.

What is recorded is kept in memory until `commit` writes it as one transaction. The file is in WAL mode with `synchronous =
NORMAL`: what is committed outlives the process, whatever kills it. A power cut or a crash of the operating system can cost
the commits since the latest checkpoint, 4 MB of them (under a minute of a busy mission, a few minutes of a quiet one), and
never the file: the world then resumes at an earlier instant. Each entry carries a checksum, for what SQLite does not notice.

With 20 robots and 40 tasks a mission of ten minutes makes 2,700 entries, 0.2 MB, and is put in again in 0.4 s; one of an hour
makes 17,000, 0.9 MB, in 2.4 s. A commit takes 0.03 ms, and the rare one with a checkpoint some 20 ms.

This module knows files, not worlds: what an entry means is the business of `history`.
"""

import contextlib
import hashlib
import math
import sqlite3
import stat
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from zlib import crc32

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError

#: What marks the file as a journal of this project ("LAll"), and the version of its tables.
APPLICATION = 0x4C416C6C
VERSION = 1
#: The largest incarnation that a file may hold: what follows it must still fit into a message.
LARGEST_INCARNATION = 2**62

_MAGIC = b"SQLite format 3\0"
#: Where a file says which program it belongs to and which version that was: two numbers in SQLite's own header.
_HEADER, _VERSION_AT, _APPLICATION_AT = 100, 60, 68

_ANOTHER = "the journal of a world server, or a file that does not exist yet"

_TABLES = (
    "CREATE TABLE mission (name TEXT, seed INTEGER, digest TEXT, incarnation INTEGER)",
    "CREATE TABLE entry (number INTEGER PRIMARY KEY, at REAL, kind TEXT, content BLOB, checksum INTEGER)",
    "CREATE TABLE lasting (number INTEGER PRIMARY KEY, until REAL, checksum INTEGER)",
    f"PRAGMA application_id = {APPLICATION}",
    f"PRAGMA user_version = {VERSION}",
)
_ENTRIES = """
    SELECT entry.number, at, kind, content, entry.checksum, until, lasting.checksum
    FROM entry LEFT JOIN lasting USING (number) ORDER BY entry.number
"""


@dataclass(frozen=True, slots=True)
class Entry:
    """One input of a world."""

    number: int
    at: float
    """The instant, in seconds of mission time."""
    kind: str
    content: bytes
    until: float | None = None
    """The last instant at which the same came again, if it did, in seconds of mission time."""


class Journal:
    """The journal of one mission; a file that does not exist, or is empty, becomes a new one.

    While it is open nobody else can open it. One that is refused stays as it was.

    Args:
        path: the file.
        mission: the mission that it must belong to.

    Raises:
        UserError: the file cannot be used.
    """

    def __init__(self, path: Path, mission: Mission) -> None:
        self.path = path
        self._new: dict[int, tuple[float, str, bytes]] = {}
        self._lasting: dict[int, float] = {}
        self._idle: list[int] = []
        self._check_file()
        with self._told("cannot be opened", "a file that can be written to"):
            self._database = sqlite3.connect(path.absolute(), timeout=0.0, isolation_level=None)
        try:
            self._open(mission)
        except BaseException:
            self._database.close()
            raise

    def __repr__(self) -> str:
        return f"<journal {self.path}, {self._next - 1} entries so far>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _wrong(self, found: str, expected: str) -> UserError:
        return UserError(f"{self.path}: {found}; expected {expected}")

    @contextlib.contextmanager
    def _told(self, what: str, expected: str) -> Iterator[None]:
        """Turn SQLite's errors into a sentence about this file."""
        try:
            yield
        except sqlite3.Error as error:
            # Errors that Python itself finds have no number of SQLite's.
            if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_OK) & 0xFF == sqlite3.SQLITE_BUSY:
                raise self._wrong(
                    "another world server has this journal open", "one world server at a time; end that one first"
                ) from error
            raise self._wrong(f"the journal {what} ({error})", expected) from error

    def _check_file(self) -> None:
        """Look at the file as it is, before SQLite does: what is no journal is not touched."""
        try:
            mode = self.path.stat().st_mode
            if not stat.S_ISREG(mode):
                raise self._wrong("this is no file", "the path of a journal, or of a new one")
            with self.path.open("rb") as file:
                header = file.read(_HEADER)
        except FileNotFoundError:
            if not self.path.absolute().parent.is_dir():
                raise self._wrong("there is no such folder", "a journal in a folder that exists") from None
            return
        except OSError as error:
            raise self._wrong(f"the journal cannot be read ({error.strerror})", "a file that can be read") from error
        # Whoever was killed while making the file has left its beginnings, and SQLite's own note how to undo them.
        unfinished = self.path.with_name(f"{self.path.name}-journal").exists()
        if header and not unfinished:
            self._check_header(header)

    def _check_header(self, header: bytes) -> None:
        if len(header) < _HEADER or not header.startswith(_MAGIC):
            raise self._wrong("this is no journal", _ANOTHER)
        version, application = (struct.unpack_from(">I", header, where)[0] for where in (_VERSION_AT, _APPLICATION_AT))
        self._check_marks(application, version)

    def _check_marks(self, application: int, version: int) -> None:
        if application != APPLICATION:
            raise self._wrong("this is a database of another program", _ANOTHER)
        if version != VERSION:
            raise self._wrong(
                f"this journal is of version {version}, and this program knows version {VERSION}",
                "the program that wrote it, or another file for --journal",
            )

    def _open(self, mission: Mission) -> None:
        with self._told("cannot be used", "a file as this program has left it, or another one for --journal"):
            execute = self._database.execute
            # No other process can open the file from the first look at it, and SQLite needs no shared memory beside it.
            execute("PRAGMA locking_mode = EXCLUSIVE")
            execute("PRAGMA synchronous = NORMAL")
            execute("BEGIN EXCLUSIVE")
            if execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
                self._make(mission)
            execute("COMMIT")
            [(application,)], [(version,)] = execute("PRAGMA application_id"), execute("PRAGMA user_version")
            self._check_marks(application, version)
            [(sound,)] = execute("PRAGMA quick_check(1)").fetchall()
            if sound != "ok":
                raise sqlite3.DatabaseError("it is damaged")
            self._incarnation = self._check_mission(mission)
            execute("PRAGMA journal_mode = WAL")
            [(last,)] = execute("SELECT max(number) FROM entry").fetchall()
            self._next = (last or 0) + 1

    def _make(self, mission: Mission) -> None:
        for statement in _TABLES:
            self._database.execute(statement)
        identity = (mission.name, mission.seed, _digest(mission), 0)
        self._database.execute("INSERT INTO mission VALUES (?, ?, ?, ?)", identity)

    def _check_mission(self, mission: Mission) -> int:
        """Refuse the journal of another mission; the largest incarnation of those who wrote this one."""
        rows = self._database.execute("SELECT name, seed, digest, incarnation FROM mission").fetchall()
        if len(rows) != 1 or not _is_identity(*rows[0]):
            raise sqlite3.DatabaseError("it does not say whose it is")
        [(name, seed, digest, incarnation)] = rows
        another = "or another file for --journal"
        if name != mission.name:
            raise self._wrong(
                f"this is the journal of mission {name}, not of {mission.name}", f"that mission, {another}"
            )
        if digest != _digest(mission):
            raise self._wrong(
                f"mission {name} has changed since this journal began", f"the mission file as it was then, {another}"
            )
        if seed != mission.seed:
            raise self._wrong(f"this journal began with seed {seed}, not {mission.seed}", f"--seed {seed}, {another}")
        return int(incarnation)

    def next_incarnation(self, fresh: int) -> int:
        """The incarnation of a new life of the world server: `fresh`, or more if that has been before.

        Raises:
            UserError: the file cannot be written to.
        """
        self._incarnation = max(fresh, self._incarnation + 1)
        with self._told("cannot be written", "a file and a folder that can be written to"):
            self._database.execute("UPDATE mission SET incarnation = ?", (self._incarnation,))
        return self._incarnation

    def entries(self) -> Iterator[Entry]:
        """All that is committed, in order.

        Raises:
            UserError: an entry is damaged.
        """
        with self._told("cannot be read", "a file as this program has left it"):
            for number, at, kind, content, checksum, until, second in self._database.execute(_ENTRIES):
                whole = isinstance(kind, str) and isinstance(content, bytes) and _is_instant(at)
                lasts = until is None or (_is_instant(until) and second == _checksum(number, until))
                if not (whole and lasts and checksum == _checksum(number, at, kind.encode() + content)):
                    raise self.damaged(number)
                yield Entry(number, at, kind, content, until)

    def damaged(self, number: int) -> UserError:
        """The sentence about an entry that cannot be used."""
        return self._wrong(
            f"entry {number} of the journal is damaged", "a file as this program has left it, or another for --journal"
        )

    def record(self, kind: str, at: float, content: bytes) -> int:
        """Take up an input; the number of its entry."""
        number, self._next = self._next, self._next + 1
        self._new[number] = (at, kind, content)
        return number

    def prolong(self, number: int, until: float) -> None:
        """The input of entry `number` came once more, at `until`."""
        self._lasting[number] = until

    def remove(self, number: int) -> None:
        """Entry `number` no longer makes a difference. It must never have been prolonged."""
        if self._new.pop(number, None) is None:
            self._idle.append(number)

    @property
    def is_committed(self) -> bool:
        """Whether all that was recorded is in the file."""
        return not (self._new or self._lasting or self._idle)

    def commit(self) -> None:
        """Write what was recorded since the last commit, all of it or nothing.

        Raises:
            UserError: the file cannot be written any more; nothing of it is lost here.
        """
        if self.is_committed:
            return
        with self._told("cannot be written", "room, and a file that can be written to"):
            many = self._database.executemany
            self._database.execute("BEGIN")
            try:
                new = [(number, *entry, _checksum(number, entry[0], entry[1].encode() + entry[2]))
                       for number, entry in self._new.items()]  # fmt: skip
                many("INSERT INTO entry VALUES (?, ?, ?, ?, ?)", new)
                lasting = [(number, until, _checksum(number, until)) for number, until in self._lasting.items()]
                many("INSERT OR REPLACE INTO lasting VALUES (?, ?, ?)", lasting)
                many("DELETE FROM entry WHERE number = ?", [(number,) for number in self._idle])
                self._database.execute("COMMIT")
            except sqlite3.Error:
                with contextlib.suppress(sqlite3.Error):
                    self._database.execute("ROLLBACK")
                raise
        self._new.clear()
        self._lasting.clear()
        self._idle.clear()

    def close(self) -> None:
        """Close the file; what was not committed is forgotten, as when the process is killed."""
        with contextlib.suppress(sqlite3.Error):
            self._database.close()


def _digest(mission: Mission) -> str:
    """What tells two missions apart, but for their seeds."""
    return hashlib.sha256(mission.model_dump_json(exclude={"seed"}).encode()).hexdigest()


def _checksum(number: int, instant: float, content: bytes = b"") -> int:
    return crc32(struct.pack("<qd", number, instant) + content)


def _is_instant(value: Any) -> bool:
    return isinstance(value, float) and math.isfinite(value)


def _is_identity(name: Any, seed: Any, digest: Any, incarnation: Any) -> bool:
    return (
        isinstance(name, str)
        and isinstance(seed, int)
        and isinstance(digest, str)
        and isinstance(incarnation, int)
        and 0 <= incarnation <= LARGEST_INCARNATION
    )
