"""Learned times on disk: one JSON file per robot, written whole or not at all.

A file that cannot be used is set aside under another name with a warning, and the robot begins without knowledge: what it
learned before is worth something, but never worth not starting for. The file also counts the robot's incarnations, and keeps
what was learned of tasks that the present mission does not have.
"""

import json
import logging
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lalliance_agents.errors import UserError
from lalliance_agents.model.monitor import Record
from lalliance_agents.whole_file import written_whole
from lalliance_agents.wire.messages import LONGEST

_log = logging.getLogger(__name__)

Learned = Mapping[str, Mapping[str, Record]]
"""task -> robot -> what was learned of that robot's times for that task."""


#: The largest incarnation that a file may hold: what follows it must still fit into a message.
LARGEST_INCARNATION = 2**62


class _StoredRecord(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    samples: list[Annotated[float, Field(gt=0, le=LONGEST)]] = Field(max_length=10_000)
    floor: float = Field(default=0.0, ge=0, le=LONGEST)
    floor_left: int = Field(default=0, ge=0, lt=2**63)


class _Stored(BaseModel):
    model_config = ConfigDict(extra="forbid")

    version: int = Field(ge=1, le=1)
    robot: str
    incarnation: int = Field(ge=0, le=LARGEST_INCARNATION)
    learned: dict[str, dict[str, _StoredRecord]]


def prepare(folder: Path) -> None:
    """Make sure that learned times can be stored in `folder`.

    Raises:
        UserError: they cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise UserError(
            f"{folder}: learned times cannot be stored here ({_why(error)}); expected a folder that can be written to"
        ) from error


class Catalog:
    """What one robot has learned, on disk.

    Args:
        folder: where the robots' files are; made if it does not exist.
        robot: whose file.

    Raises:
        UserError: the folder cannot be made or written to.
    """

    def __init__(self, folder: Path, robot: str) -> None:
        self.path = folder / f"{robot}.json"
        self._robot = robot
        prepare(folder)
        text = self._read()
        try:
            stored = None if text is None else self._check(text)
            self.learned: Learned = {} if stored is None else _records(stored)
            #: Larger than that of every earlier life, also where the file was lost.
            self.incarnation = max(0 if stored is None else stored.incarnation + 1, fresh_incarnation())
            self._clear_away()
            self.save(self.learned)
        except OSError as error:
            raise UserError(
                f"{self.path}: cannot be written ({_why(error)}); learned times need a writable folder"
            ) from error

    def _read(self) -> bytes | None:
        try:
            return self.path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise UserError(f"{self.path}: cannot be read ({_why(error)}); expected a file of learned times") from error

    def _check(self, text: bytes) -> _Stored | None:
        """What the file says; None if it cannot be used, and then it is out of the way."""
        try:
            stored = _Stored.model_validate_json(text)
        except ValidationError as error:
            self._set_aside(f"{error.error_count()} faults, the first: {error.errors()[0]['msg']}")
            return None
        if stored.robot != self._robot:
            self._set_aside(f"it belongs to robot {stored.robot!r}")
            return None
        return stored

    def _clear_away(self) -> None:
        """Remove what lives of this robot that were killed while writing have left."""
        for unfinished in self.path.parent.glob(f".{self.path.name}.*"):
            unfinished.unlink(missing_ok=True)

    def _set_aside(self, why: str) -> None:
        aside = self.path.with_name(f"{self.path.name}.damaged-{time.time_ns()}")
        self.path.replace(aside)
        _log.warning("%s: not usable (%s); set aside as %s, starting without learned times", self.path, why, aside.name)

    def save(self, learned: Learned) -> None:
        """Write `learned`; a reader, or a crash at any instant, finds the old file or the new one.

        Tasks that are not in `learned` stay as they were when the file was read.

        Raises:
            OSError: the file cannot be written.
        """
        document = {
            "version": 1,
            "robot": self._robot,
            "incarnation": self.incarnation,
            "learned": {
                task: {robot: record._asdict() for robot, record in records.items()}
                for task, records in {**self.learned, **learned}.items()
            },
        }
        with written_whole(self.path) as file:
            file.write(json.dumps(document, indent=1).encode())


def _records(stored: _Stored) -> Learned:
    return {
        task: {robot: Record(tuple(one.samples), one.floor, one.floor_left) for robot, one in records.items()}
        for task, records in stored.learned.items()
    }


def _why(error: OSError) -> str:
    return error.strerror or str(error)


def fresh_incarnation() -> int:
    """A number larger than that of any earlier life of this robot, as far as this machine's calendar can be trusted."""
    return time.time_ns() // 1_000_000
