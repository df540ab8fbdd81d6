"""Which robots a process speaks for: by name, by glob, or by an equal share of the mission; and what speaks against sharing."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.faults import Crash, Hang, describe, fits
from lalliance_agents.suggestions import like_or_any

#: Names that a sentence lists before it only counts.
FEW = 4


def named(path: Path, mission: Mission, words: Sequence[str]) -> list[str]:
    """The robots that `words` name, which may be globs, in the mission's order; each once.

    Raises:
        UserError: a word names none.
    """
    for word in words:
        if not any(fits(robot, [word]) for robot in mission.robots):
            raise UserError(f"{path}: no robot {word!r} in this mission{like_or_any(word, mission.robots)}")
    return [robot for robot in mission.robots if fits(robot, words)]


def check_certificate(names: Sequence[str], keys: Path | None) -> None:
    """Robots that share a process share its connection, and the router lets a certificate speak for one robot alone.

    Raises:
        UserError: there are keys, and several robots.
    """
    if keys is not None and len(names) > 1:
        raise UserError(
            f"--keys {keys}: {told(names)} would share one connection, and a certificate speaks for one robot alone; "
            "expected one robot per process, or no keys"
        )


def shared_processes(path: Path, mission: Mission, processes: int | None, keys: Path | None) -> int | None:
    """How many processes the robots share; None: each has its own, as there is one for each or nobody wants them to share.

    Raises:
        UserError: they may not share: the mission has a fault of one robot's process, or there are keys.
    """
    if processes is None or processes >= len(mission.robots):
        return None
    check_certificate(list(mission.robots), keys)
    for number, fault in enumerate(mission.faults):
        if isinstance(fault, Crash | Hang):
            raise UserError(
                f"{path}: faults.{number}: {describe(fault)} would strike all robots of a process that several share; "
                "expected no crash and no hang with --processes, or one process per robot"
            )
    return processes


def shares(robots: Sequence[str], processes: int | None) -> list[list[str]]:
    """The robots of each process: equal shares in the mission's order, or one process per robot if nobody says."""
    count = len(robots) if processes is None else min(processes, len(robots))
    ends = [len(robots) * number // count for number in range(count + 1)] if count else []
    return [list(robots[begin:end]) for begin, end in pairwise(ends)]


def told(names: Sequence[str]) -> str:
    """Robots in words: all of their names if they are few."""
    if len(names) == 1:
        return f"robot {names[0]}"
    return f"robots {', '.join(names)}" if len(names) <= FEW else f"{len(names)} robots"
