"""Carries out a study: hands its parts out, and keeps the rows of each as soon as they are there.

What is kept is never done again, so that a run which ended early, for whatever reason, is gone on with by starting it again.
Parts come in an order without meaning, dear and cheap ones mixed, so that how long the rest will take can be told from what was
done.
"""

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import TypeAlias

import polars as pl

from lalliance_agents.errors import UserError
from lalliance_study.experiments import rows
from lalliance_study.experiments.manifest import FILE, Manifest
from lalliance_study.experiments.plan import Part, parts
from lalliance_study.experiments.presets import Preset
from lalliance_study.experiments.work import carry_out
from lalliance_study.pool import at_once

Made: TypeAlias = tuple[str, pl.DataFrame]
HandOut: TypeAlias = Callable[[Callable[[Part], Made], Iterable[tuple[Part]]], Generator[Made, None, None]]
"""Has a function called with each of some parts, somewhere; what it returns, in the order in which that comes."""


@dataclass(frozen=True, slots=True)
class Study:
    """A study and the folder in which it is kept."""

    out: Path
    manifest: Manifest
    left: tuple[Part, ...]
    """The parts whose rows are not there yet."""
    done: int
    """Rows that are there."""


def open_study(
    out: Path, preset: Preset, *, missions: int | None = None, seed: int = 0, only: Sequence[str] = ()
) -> Study:
    """Begin a study, or go on with the one that is there.

    Args:
        out: its folder, which is made if need be.
        preset: which study.
        missions: of each scenario; by default as many as the preset says.
        seed: where all that is drawn comes from.
        only: experiments to carry out now; none: all.

    Raises:
        UserError: there is no such experiment, the folder holds another study or something else, or cannot be written to.
    """
    known = [one.name for one in preset.experiments]
    for name in only:
        if name not in known:
            raise UserError(f"no experiment {name!r} in preset {preset.name}; expected one of {', '.join(known)}")
    wanted = preset.missions if missions is None else missions
    manifest = Manifest.of(preset, wanted, seed)
    _take(out, manifest)
    chosen = [one for one in preset.experiments if not only or one.name in only]
    kept = rows.kept(out)
    planned = [part for part in parts(preset.experiments, wanted, seed) if part.experiment in chosen]
    left = sorted((part for part in planned if part.name not in kept), key=_place)
    return Study(out, manifest, tuple(left), sum(part.runs for part in planned if part.name in kept))


def _place(part: Part) -> bytes:
    return blake2b(part.name.encode()).digest()


def _take(out: Path, manifest: Manifest) -> None:
    """Make the folder this study's own, if it is not already."""
    if (out / FILE).exists():
        if (difference := Manifest.read(out).differs_from(manifest)) is not None:
            raise UserError(f"{out} holds rows of {difference}; expected those of this study, or an empty folder")
        return
    folder = out / rows.FOLDER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        strange = next(folder.iterdir(), None)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}; expected a folder, or where to make one") from None
    if strange is not None:
        raise UserError(f"{strange} belongs to no study, as there is no {FILE}; expected an empty folder")
    manifest.write(out)


def run(study: Study, hand_out: HandOut, advance: Callable[[int], None]) -> None:
    """Carry out what is left of a study.

    Args:
        study: the study.
        hand_out: where its parts are carried out.
        advance: told the number of rows that have come, each time that some do.
    """
    runs = {part.name: part.runs for part in study.left}
    with closing(hand_out(_work, ((part,) for part in study.left))) as made:
        for name, found in made:
            rows.write(study.out, name, found)
            advance(runs[name])


def _work(part: Part) -> Made:
    return part.name, carry_out(part)


def here(jobs: int | None) -> HandOut:
    """In processes of this machine; see `pool.at_once`."""
    return partial(at_once, jobs=jobs)
