"""What tests and the command line may ask of missions, checked: engines, speeds, seeds. Imports nothing heavy."""

import math
from argparse import ArgumentTypeError
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

#: What can move a mission: real processes, or the exact simulator.
ENGINES = ("real", "simulated")
CHOICES = (*ENGINES, "both")

_SPEEDS = (0.01, 1000.0)


def check_speed(speed: object) -> float:
    """A speed, in mission seconds per real second.

    Raises:
        ValueError: it is none.
    """
    number = not isinstance(speed, bool) and isinstance(speed, int | float)
    if not number or not _SPEEDS[0] <= float(str(speed)) <= _SPEEDS[1]:
        raise ValueError(f"speed {speed!r} is not allowed; expected a number from {_SPEEDS[0]:g} to {_SPEEDS[1]:g}")
    return float(str(speed))


def check_seed(seed: object) -> int:
    """A seed.

    Raises:
        ValueError: it is none.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**63:
        raise ValueError(f"seed {seed!r} is not allowed; expected a whole number from 0 on")
    return seed


def speed_option(text: str) -> float:
    """A speed on the command line."""
    try:
        return check_speed(float(text) if _is_number(text) else text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None


def seed_option(text: str) -> int:
    """A seed on the command line."""
    try:
        return check_seed(int(text) if text.isascii() and text.isdigit() else text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


@dataclass(frozen=True, slots=True)
class Asked:
    """What the marker of a test asks for.

    Attributes:
        engine: `real`, `simulated` or `both`; None: it does not say.
        speed: mission seconds per real second.
    """

    engine: str | None
    speed: float

    @classmethod
    def of(cls, plain: Sequence[object], named: Mapping[str, object]) -> "Asked":
        """What the arguments of a marker ask for.

        Raises:
            ValueError: they are not what a marker takes.
        """
        unknown = [*map(repr, plain), *(name for name in named if name not in {"engine", "speed"})]
        if unknown:
            raise ValueError(
                f"{', '.join(unknown)} is unknown; expected engine= and speed=, as in engine='both', speed=4"
            )
        engine = named.get("engine")
        if engine is not None and engine not in CHOICES:
            raise ValueError(f"engine {engine!r} is unknown; expected one of {', '.join(map(repr, CHOICES))}")
        return cls(None if engine is None else str(engine), check_speed(named.get("speed", 1.0)))


def engines(asked: str | None, option: str | None) -> tuple[str, ...]:
    """The engines that a test runs on; none: it cannot run as the command line wants it.

    Args:
        asked: what the test asks for; None: nothing, so that it may run on any.
        option: what the command line asks for, if anything.
    """
    if asked is None:
        able: tuple[str, ...] = ("real",) if option is None else ENGINES
    else:
        able = ENGINES if asked == "both" else (asked,)
    return tuple(engine for engine in able if option in {None, "both", engine})
