"""Learned times on disk: one JSON file per robot, written whole or not at all.

A file that cannot be used is set aside under another name with a warning, and the robot begins without knowledge: what it
learned before is worth something, but never worth not starting for. The file also counts the robot's incarnations.
"""

import json
import logging
import os
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lalliance_agents.errors import UserError
from lalliance_agents.model.monitor import Record

_log = logging.getLogger(__name__)

Learned = Mapping[str, Mapping[str, Record]]
"""task -> robot -> what was learned of that robot's times for that task."""


class _StoredRecord(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    samples: list[float] = Field(max_length=10_000)
    floor: float = Field(default=0.0, ge=0)
    floor_left: int = Field(default=0, ge=0)


class _Stored(BaseModel):
    model_config = ConfigDict(extra="forbid")

    version: int = Field(ge=1, le=1)
    robot: str
    incarnation: int = Field(ge=0, lt=2**63)
    learned: dict[str, dict[str, _StoredRecord]]


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
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(
                f"{folder}: learned times cannot be stored here ({error.strerror}); expected a folder"
            ) from error
        stored = self._read()
        self.learned: Learned = {} if stored is None else _records(stored)
        #: Larger than that of every earlier life, also where the file was lost.
        self.incarnation = max(0 if stored is None else stored.incarnation + 1, fresh_incarnation())
        try:
            self.save(self.learned)
        except OSError as error:
            raise UserError(
                f"{self.path}: cannot be written ({error.strerror}); learned times need a writable folder"
            ) from error

    def _read(self) -> _Stored | None:
        try:
            text = self.path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise UserError(f"{self.path}: cannot be read ({error.strerror})") from error
        try:
            stored = _Stored.model_validate_json(text)
        except ValidationError as error:
            self._set_aside(f"{error.error_count()} faults, the first: {error.errors()[0]['msg']}")
            return None
        if stored.robot != self._robot:
            self._set_aside(f"it belongs to robot {stored.robot!r}")
            return None
        if any(sample <= 0 for of in stored.learned.values() for one in of.values() for sample in one.samples):
            self._set_aside("a learned time is not above 0")
            return None
        return stored

    def _set_aside(self, why: str) -> None:
        aside = self.path.with_name(f"{self.path.name}.damaged-{time.time_ns()}")
        self.path.replace(aside)
        _log.warning("%s: not usable (%s); set aside as %s, starting without learned times", self.path, why, aside.name)

    def save(self, learned: Learned) -> None:
        """Write `learned`; a reader, or a crash at any instant, finds the old file or the new one.

        Raises:
            OSError: the file cannot be written.
        """
        document = {
            "version": 1,
            "robot": self._robot,
            "incarnation": self.incarnation,
            "learned": {
                task: {robot: record._asdict() for robot, record in records.items()}
                for task, records in learned.items()
            },
        }
        handle, name = tempfile.mkstemp(dir=self.path.parent, prefix=f".{self.path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                json.dump(document, file, indent=1)
                file.flush()
                os.fsync(file.fileno())
            Path(name).replace(self.path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


def _records(stored: _Stored) -> Learned:
    return {
        task: {robot: Record(tuple(one.samples), one.floor, one.floor_left) for robot, one in records.items()}
        for task, records in stored.learned.items()
    }


def fresh_incarnation() -> int:
    """A number larger than that of any earlier life of this robot, as far as this machine's calendar can be trusted."""
    return time.time_ns() // 1_000_000
