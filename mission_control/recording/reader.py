"""Reads recordings: what was seen, in the order in which it was seen, and what a recording holds altogether.

A file is read from its beginning and never held in memory as a whole. One that is not whole, because its recorder was killed
or it was cut, gives all that is in it; what is missing is told when the reading comes to it.
"""

import contextlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO, NamedTuple

import msgpack
from mcap.reader import make_reader
from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.summary import Summary

from lalliance_agents.errors import UserError
from mission_control.recording.format import ABOUT, CONVERTED, ENDING, GAP, PRESENCE, PROFILE, About, Ending, gap_of
from mission_control.recording.scan import MAGIC, Scan
from mission_control.watch.gaps import Gap
from mission_control.watch.sighting import Sighting

_EXPECTED = "expected what `lalliance record` or `lalliance run --record` writes"
_NANOSECONDS = 1_000_000_000
#: Gaps that are told of.
MOST_GAPS = 10_000

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Information:
    """What a recording holds.

    Attributes:
        path: the file.
        about: its mission.
        size: in bytes.
        started_at: when the first message was seen, on the wall clock, in nanoseconds since the epoch; 0 without one.
        duration: from the first message to the last, in seconds.
        counts: messages by key; coming and going count on the key of a presence.
        ending: how the recording ended; None: its recorder could not say so any more.
        broken: why it cannot be read to its end, if it cannot.
        gaps: times in which nothing could be heard.
    """

    path: Path
    about: About
    size: int
    started_at: int
    duration: float
    counts: dict[str, int]
    ending: Ending | None
    broken: str | None
    gaps: tuple[Gap, ...] = ()

    @property
    def messages(self) -> int:
        """All of them."""
        return sum(self.counts.values())

    @property
    def complete(self) -> bool:
        """Whether the file is whole."""
        return self.broken is None


def sightings(path: Path, tell: Tell | None = None) -> Iterator[Sighting]:
    """What was seen, in that order.

    Args:
        path: the recording.
        tell: called with a sentence, if the file turns out not to be whole, after all that is in it.

    Raises:
        UserError: there is no recording at `path`, or not even its beginning.
    """
    recording = Recording(path)
    yield from recording
    if recording.broken and tell is not None:
        tell(recording.broken)


def information(path: Path) -> Information:
    """What the recording at `path` holds: from its index, or else, if it has none, from all of it.

    Raises:
        UserError: there is no recording at `path`, or not even its beginning.
    """
    recording = Recording(path)
    return recording.summarized() or recording.counted()


class Recording:
    """A recording; each time it is iterated over it is read from its beginning.

    Args:
        path: the file.

    Attributes:
        path: the file.
        about: its mission.
        ending: how it ended, once it was iterated over and if it says so.
        broken: a sentence, once it was iterated over and if it is not whole.
        gaps: times in which nothing could be heard, as far as it was iterated over; no more than `MOST_GAPS`.

    Raises:
        UserError: there is no recording at `path`, or not even its beginning.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.broken: str | None = None
        self.ending: Ending | None = None
        self.gaps: list[Gap] = []
        with self._open() as file:
            self.about = self._read_about(Scan(file))

    def __repr__(self) -> str:
        return f"<recording of {self.about.mission} in {self.path}>"

    def __iter__(self) -> Iterator[Sighting]:
        with self._open() as file:
            scan = Scan(file)
            channels = _Channels()
            self.gaps.clear()
            for record in scan:
                match record:
                    case Schema():
                        channels.schemas[record.id] = record.name
                    case Channel():
                        channels.add(record)
                    case Metadata() if record.name == ENDING:
                        self.ending = _ending(record.metadata)
                    case Metadata() if record.name == GAP and len(self.gaps) < MOST_GAPS:
                        self.gaps += _gaps([record.metadata])
                    case Message():
                        sighting = channels.sighting(record)
                        if sighting is None:
                            scan.broken = "a message in it belongs to nothing"
                            break
                        yield sighting
                    case _:
                        pass
            self.broken = (
                None if scan.broken is None else f"{self.path}: {scan.broken}; all that stands before was read"
            )

    def counted(self) -> Information:
        """What it holds, by reading all of it."""
        counts: Counter[str] = Counter()
        first = last = 0
        for sighting in self:
            counts[sighting.key] += 1
            first = sighting.seen_at if not first else min(first, sighting.seen_at)
            last = max(last, sighting.seen_at)
        return self._information(_Facts(first, last, dict(counts)), self.ending, self.gaps)

    def summarized(self) -> Information | None:
        """What it holds, by its index; None if it has none that can be read."""
        try:
            with self._open() as file:
                reader = make_reader(file)
                summary = reader.get_summary()
                metadata = list(reader.iter_metadata())
                endings = [record.metadata for record in metadata if record.name == ENDING]
                gaps = _gaps([record.metadata for record in metadata if record.name == GAP])
            facts = None if summary is None else _facts(summary)
        except Exception:  # whatever the library makes of a file that is not whole
            return None
        return None if facts is None else self._information(facts, _ending(endings[0]) if endings else None, gaps)

    def _information(self, facts: "_Facts", ending: Ending | None, gaps: Iterable[Gap]) -> Information:
        return Information(
            path=self.path,
            about=self.about,
            size=self.path.stat().st_size,
            started_at=facts.first,
            duration=(facts.last - facts.first) / _NANOSECONDS,
            counts=dict(sorted(facts.counts.items())),
            ending=ending,
            broken=self.broken,
            gaps=tuple(islice(gaps, MOST_GAPS)),
        )

    def _open(self) -> BinaryIO:
        try:
            if self.path.exists() and not self.path.is_file() and not self.path.is_dir():
                raise UserError(f"{self.path}: not a regular file; {_EXPECTED}")
            file = self.path.open("rb")
        except FileNotFoundError:
            raise UserError(f"{self.path}: no such file; {_EXPECTED}") from None
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise UserError(f"{self.path}: cannot be read ({reason}); {_EXPECTED}") from None
        if (found := file.read(len(MAGIC))) != MAGIC:
            file.close()
            what = "an empty file" if not found else "not an MCAP file"
            raise UserError(f"{self.path}: {what}; {_EXPECTED}")
        file.seek(0, os.SEEK_SET)
        return file

    def _read_about(self, scan: Scan) -> About:
        for record in scan:
            if isinstance(record, Header) and record.profile != PROFILE:
                told = {CONVERTED: "one that was converted for viewers", "": "an MCAP file of somebody else"}
                what = told.get(record.profile, f"an MCAP file of the profile {record.profile[:40]!r}")
                raise UserError(f"{self.path}: {what}; {_EXPECTED}")
            if isinstance(record, Metadata) and record.name == ABOUT:
                try:
                    return About.of(record.metadata)
                except (KeyError, ValueError):
                    break
        raise UserError(f"{self.path}: {scan.broken or 'it names no mission'}, before its first message; {_EXPECTED}")


class _Channels:
    """The channels of a file as far as it was read."""

    def __init__(self) -> None:
        self.schemas: dict[int, str] = {}
        #: The key, and whether its messages are presences.
        self._known: dict[int, tuple[str, bool]] = {}

    def add(self, channel: Channel) -> None:
        self._known[channel.id] = (channel.topic, self.schemas.get(channel.schema_id) == PRESENCE)

    def sighting(self, message: Message) -> Sighting | None:
        """What the message says was seen; None if it cannot be told."""
        if message.channel_id not in self._known:
            return None
        key, is_presence = self._known[message.channel_id]
        now = message.publish_time / _NANOSECONDS
        if not is_presence:
            return Sighting(message.log_time, now, key, message.data)
        return Sighting(message.log_time, now, key, b"", gone=not _is_present(message.data))


def _is_present(payload: bytes) -> bool:
    try:
        content = msgpack.unpackb(payload)
    except (ValueError, msgpack.UnpackException):
        return False
    return isinstance(content, dict) and content.get("present") is True


class _Facts(NamedTuple):
    first: int
    last: int
    counts: dict[str, int]


def _facts(summary: Summary) -> _Facts | None:
    statistics = summary.statistics
    if statistics is None:
        return None
    counts: Counter[str] = Counter()
    for channel, count in statistics.channel_message_counts.items():
        counts[summary.channels[channel].topic] += count
    return _Facts(statistics.message_start_time, statistics.message_end_time, dict(counts))


def _ending(metadata: dict[str, str]) -> Ending | None:
    try:
        return Ending.of(metadata)
    except (KeyError, ValueError):
        return None


def _gaps(found: list[dict[str, str]]) -> list[Gap]:
    gaps = []
    for metadata in found:
        with contextlib.suppress(KeyError, ValueError):
            gaps.append(gap_of(metadata))
    return gaps
