"""MANIFEST.json: all that shaped the rows of a study, and by which a run knows whether it may go on with what it finds."""

import json
import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Self

from pydantic import ValidationError

from lalliance_agents.errors import UserError
from lalliance_agents.model.parameters import Record
from lalliance_agents.whole_file import written_whole
from lalliance_study.experiments.contenders import Contender
from lalliance_study.experiments.plan import Numbered, numbered
from lalliance_study.experiments.presets import Preset

FILE = "MANIFEST.json"
#: Counts up with each change of what rows or manifests mean.
FORMAT = 1
#: Packages on which rows may depend.
PACKAGES = ("numba", "numpy", "ortools", "scipy")


class Asked(Record):
    """An experiment as it was asked for."""

    name: str
    asks: str
    missions: int
    """Of each scenario."""
    contenders: tuple[Contender, ...]


class Manifest(Record):
    """All that shaped the rows of a study."""

    format: int
    lalliance: str
    """The version."""
    preset: str
    seed: int
    missions: int
    packages: dict[str, str]
    experiments: tuple[Asked, ...]
    scenarios: tuple[Numbered, ...]
    machine: dict[str, str]
    """Where it was begun; rows do not depend on it."""

    @classmethod
    def of(cls, preset: Preset, missions: int, seed: int) -> Self:
        """Of a study that begins here and now."""
        return cls(
            format=FORMAT,
            lalliance=version("lalliance"),
            preset=preset.name,
            seed=seed,
            missions=missions,
            packages={name: version(name) for name in PACKAGES},
            experiments=tuple(
                Asked(name=one.name, asks=one.asks, missions=one.missions(missions), contenders=one.contenders)
                for one in preset.experiments
            ),
            scenarios=tuple(numbered(preset.experiments)),
            machine={
                "system": f"{platform.system()} {platform.release()}",
                "machine": platform.machine(),
                "processors": str(os.cpu_count()),
                "python": platform.python_version(),
            },
        )

    @classmethod
    def read(cls, out: Path) -> Self:
        """The manifest of the study in a folder.

        Raises:
            UserError: there is none, or it is none.
        """
        path = out / FILE
        try:
            found = json.loads(path.read_bytes())
            if isinstance(found, dict) and found.get("format", FORMAT) != FORMAT:
                said = f"format {found['format']} of lalliance {found.get('lalliance')}"
                raise UserError(
                    f"{path}: {said}; expected format {FORMAT}, as version {version('lalliance')} writes it"
                )
            return cls.model_validate_json(json.dumps(found))
        except OSError as error:
            raise UserError(f"{path}: {error.strerror}; expected the folder of a study") from None
        except ValueError as error:
            if not isinstance(error, ValidationError):
                raise UserError(f"{path}: no JSON ({error}); expected what lalliance study run writes") from None
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"])) or "the whole"
            raise UserError(f"{path}: {where}: {first['msg']}; expected what lalliance study run writes") from None

    def write(self, out: Path) -> None:
        """Keep it; the file is there whole or not at all.

        Raises:
            UserError: it cannot be written.
        """
        path = out / FILE
        try:
            with written_whole(path) as file:
                file.write(f"{self.model_dump_json(indent=1)}\n".encode())
        except OSError as error:
            raise UserError(f"{path}: {error.strerror}; expected a folder that can be written to") from None

    def differs_from(self, other: "Manifest") -> str | None:
        """What keeps the rows of the two from being of one study, as `what one, not other`; None: nothing."""
        for field in ("lalliance", "preset", "seed", "missions"):
            mine, theirs = getattr(self, field), getattr(other, field)
            if mine != theirs:
                return f"{field} {mine}, not {theirs}"
        for name, mine in self.packages.items():
            if mine != other.packages.get(name):
                return f"{name} {mine}, not {other.packages.get(name)}"
        same = (self.experiments, self.scenarios) == (other.experiments, other.scenarios)
        return None if same else f"other experiments than preset {other.preset} has now"
