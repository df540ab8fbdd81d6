"""Writes a recording, so that whatever ends the writer, what it was given until a moment ago can be read."""

import contextlib
import os
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

import msgpack
from mcap.writer import LIBRARY_IDENTIFIER, Writer

from lalliance_agents.config import Mission
from lalliance_agents.errors import LallianceError, MessageError, UserError
from lalliance_agents.wire.keys import Key, Keys, Kind
from mission_control.recording.format import (
    ABOUT,
    ENDING,
    GAP,
    MOST_CHANNELS,
    MOST_STRANGE,
    PROFILE,
    About,
    Ending,
    gap_metadata,
    schema_of,
)
from mission_control.watch.gaps import Gap
from mission_control.watch.sighting import PRESENCES, Sighting

#: How long what was added may wait before the system has it, in real seconds.
FLUSH_PERIOD = 0.5
#: Room for what waits, in bytes: the head of a file goes to the system as one piece.
_BUFFER = 2**21
_NANOSECONDS = 1_000_000_000


class RecordingError(LallianceError):
    """A recording that cannot be written any more."""


class RecordingWriter:
    """A recording that is being written; leaving its context ends it.

    Args:
        path: the file, which must not be there yet.
        mission: the mission.
        text: the mission's file.

    Attributes:
        written: sightings in the file.
        refused: messages that are not in it, because they came on more keys than it takes.
        gaps: times in which nothing could be heard, as far as it was told.
        missing: how long they were together, in real seconds.

    Raises:
        UserError: there is something at `path`, or nothing can be written there.
    """

    def __init__(self, path: Path, mission: Mission, text: str) -> None:
        self.path = path
        self.written = 0
        self.refused = 0
        self.gaps = 0
        self.missing = 0.0
        self.ending = Ending("unknown")
        self._mission = mission
        self._keys = Keys(mission.name)
        #: By key, and whether it is for presences.
        self._channels: dict[tuple[str, bool], int] = {}
        self._schemas: dict[Kind, int] = {}
        self._strange = 0
        self._flush_due = 0.0
        #: Whether something could not be written: what follows would belong to nothing.
        self._is_broken = False
        self._file = _create(path)
        self._writer = Writer(self._file)
        try:
            self._begin(text)
        except RecordingError as error:
            self._let_go()
            path.unlink(missing_ok=True)
            raise UserError(f"{error}, before its first message; expected room for a recording") from None

    def __repr__(self) -> str:
        return f"<recording of {self._mission.name} in {self.path}, {self.written} messages>"

    def _begin(self, text: str) -> None:
        installed = version("lalliance")
        self._writer.start(PROFILE, f"lalliance {installed}; {LIBRARY_IDENTIFIER}")
        about = About(self._mission.name, text, self._mission.seed, installed)
        self._writer.add_metadata(ABOUT, about.metadata())
        self.flush()

    @property
    def keys(self) -> int:
        """How many keys are in it."""
        return len({key for key, _ in self._channels})

    def add(self, sighting: Sighting) -> None:
        """Put a sighting into the file.

        Raises:
            RecordingError: it cannot be written.
        """
        is_presence = not sighting.payload and self._kind(sighting.key) in PRESENCES
        channel = self._channels.get((sighting.key, is_presence)) or self._new_channel(sighting.key, is_presence)
        if channel is None:
            self.refused += 1
            return
        with self._writing():
            self._writer.add_message(
                channel,
                log_time=sighting.seen_at,
                data=msgpack.packb({"present": not sighting.gone}) if is_presence else sighting.payload,
                publish_time=round(sighting.now * _NANOSECONDS),
            )
        self.written += 1
        self.flush_if_due()

    def add_gap(self, gap: Gap) -> None:
        """Put into the file that nothing could be heard for a time.

        Raises:
            RecordingError: it cannot be written.
        """
        with self._writing():
            self._writer.flush()
            self._writer.add_metadata(GAP, gap_metadata(gap))
        self.gaps += 1
        self.missing += gap.lasts

    def flush(self) -> None:
        """Hand all that was added to the system, which keeps it whatever becomes of this process.

        Raises:
            RecordingError: it cannot be written.
        """
        self._flush_due = time.monotonic() + FLUSH_PERIOD
        with self._writing():
            self._writer.flush()

    def flush_if_due(self) -> None:
        """Do so if it was not done for `FLUSH_PERIOD`.

        Raises:
            RecordingError: it cannot be written.
        """
        if time.monotonic() >= self._flush_due:
            self.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the file, unless its end was found before; one without a single message is removed.

        Raises:
            RecordingError: it cannot be written.
        """
        if not self.written:
            self.path.unlink(missing_ok=True)
        try:
            if self._is_broken:
                return
            with self._writing():
                self._writer.flush()
                self._writer.add_metadata(ENDING, self.ending.metadata())
                self._writer.finish()
                self._file.flush()
        finally:
            self._let_go()

    def _let_go(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()

    def _kind(self, key: str) -> Kind | None:
        found = self._parse(key)
        return None if found is None else found.kind

    def _parse(self, key: str) -> Key | None:
        with contextlib.suppress(MessageError):
            return self._keys.parse(key)
        return None

    def _new_channel(self, key: str, is_presence: bool) -> int | None:
        """The number of a new channel; None if there are too many."""
        parsed = self._parse(key)
        is_strange = not self._is_own(parsed)
        if len(self._channels) >= MOST_CHANNELS or (is_strange and self._strange >= MOST_STRANGE):
            return None
        self._strange += is_strange
        schema = 0
        if parsed is not None and is_presence == (parsed.kind in PRESENCES):
            schema = self._schema(parsed.kind)
        channel = self._writer.register_channel(key, "msgpack" if schema else "unknown", schema)
        self._channels[key, is_presence] = channel
        return channel

    def _is_own(self, key: Key | None) -> bool:
        if key is None:
            return False
        return (key.robot is None or key.robot in self._mission.robots) and (
            key.task is None or key.task in self._mission.tasks
        )

    def _schema(self, kind: Kind) -> int:
        schema = schema_of(kind)
        if schema is None:
            return 0
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(schema.name, "jsonschema", schema.encoded())
        return self._schemas[kind]

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._is_broken = True
            raise RecordingError(
                f"{self.path}: the recording cannot be written any more ({error.strerror}); it ends before"
            ) from error


def check_new(path: Path) -> None:
    """Make sure that there is nothing at `path` yet.

    Raises:
        UserError: there is.
    """
    if os.path.lexists(path):
        raise _taken(path)


def _taken(path: Path) -> UserError:
    return UserError(f"{path}: there is something already; expected a new file, as nothing is overwritten")


def _create(path: Path) -> BinaryIO:
    try:
        return path.open("xb", buffering=_BUFFER)
    except FileExistsError:
        raise _taken(path) from None
    except OSError as error:
        raise UserError(
            f"{path}: no recording can be written there ({error.strerror}); expected a folder that can be written to"
        ) from None
