"""What things are called in Kubernetes, which takes small letters, digits and hyphens, and no long names."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from lalliance_agents.errors import UserError

#: The longest name of a Job, whose pods carry it as a label.
LONGEST_NAME = 63

_PREFIXES = {"mission": "lalliance", "robot": "robot"}


def name_of(path: Path, what: Literal["mission", "robot"], name: str) -> str:
    """The name of a mission's namespace, or of a robot's Job.

    Args:
        path: the mission file, for the sentence.
        what: whose name.
        name: what the mission file calls it.

    Raises:
        UserError: there would be nothing left of it, or it would be too long.
    """
    own = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    found = f"{_PREFIXES[what]}-{own}"
    if not own or len(found) > LONGEST_NAME:
        longest = LONGEST_NAME - len(_PREFIXES[what]) - 1
        raise UserError(
            f"{path}: {what} {name!r} would have no name in Kubernetes; expected letters or digits in it, "
            f"and at most {longest} characters"
        )
    return found


def names_of_robots(path: Path, robots: Iterable[str]) -> dict[str, str]:
    """What each robot's Job is called.

    Raises:
        UserError: one of them has no name there, or two have the same.
    """
    named: dict[str, str] = {}
    for robot in robots:
        name = name_of(path, "robot", robot)
        if (other := named.setdefault(name, robot)) != robot:
            raise UserError(
                f"{path}: robots {other!r} and {robot!r} would both be {name} in Kubernetes; "
                "expected names that differ in more than capitals, hyphens and underscores"
            )
    return {robot: name for name, robot in named.items()}
