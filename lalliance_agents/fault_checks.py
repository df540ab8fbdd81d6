"""What of a fault does not fit a mission, and which faults cannot be in force together.

A fault that can never happen, or two that say different things of one link or robot at one time, are mistakes of whoever
wrote them; each is told in a sentence before anything is started. The same checks serve mission files and faults that are
injected into a running mission.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from fnmatch import fnmatchcase

from lalliance_agents.faults import (
    Blind,
    Crash,
    Fault,
    Hang,
    LinkFault,
    Partition,
    Stuck,
    as_globs,
    fits,
    kind_of,
    robot_of,
)
from lalliance_agents.suggestions import like_or_any

Place = tuple[str | int, ...]
"""Fields and indices below a fault."""


def misfit(fault: Fault, robots: Iterable[str], tasks_of: Callable[[str], Iterable[str]]) -> tuple[Place, str] | None:
    """What of a fault does not fit the team, and where: robots that are not there, globs that match nobody, empty links.

    Args:
        fault: the fault.
        robots: the team.
        tasks_of: the tasks that a robot can do.
    """
    team = list(robots)
    robot = robot_of(fault)
    if robot is not None and robot not in team:
        return ("robot",), f"{robot!r} is not a robot of this mission{like_or_any(robot, team)}"
    if isinstance(fault, Stuck) and fault.task is not None and fault.task not in (known := list(tasks_of(fault.robot))):
        return ("task",), f"{fault.task!r} is not a task of robot {fault.robot}{like_or_any(fault.task, known)}"
    for place, globs in _globs_of(fault):
        for glob in globs:
            if not any(fnmatchcase(name, glob) for name in team):
                return place, f"{glob!r} matches no robot of this mission{like_or_any(glob, team)}"
    if isinstance(fault, Partition):
        return _in_two_groups(fault, team)
    if isinstance(fault, LinkFault):
        return _between_nobody(fault, team)
    return None


def _globs_of(fault: Fault) -> Iterator[tuple[Place, tuple[str, ...]]]:
    if isinstance(fault, LinkFault):
        yield ("link", "from"), as_globs(fault.link.senders)
        yield ("link", "to"), as_globs(fault.link.receivers)
    elif isinstance(fault, Partition):
        for index, group in enumerate(fault.partition):
            yield ("partition", index), as_globs(group)


def _in_two_groups(fault: Partition, team: list[str]) -> tuple[Place, str] | None:
    seen: dict[str, int] = {}
    for index, group in enumerate(fault.partition):
        for name in team:
            if fits(name, as_globs(group)) and seen.setdefault(name, index) != index:
                return ("partition", index), f"{name} is in two groups of the partition; expected it in one"
    return None


def _between_nobody(fault: LinkFault, team: list[str]) -> tuple[Place, str] | None:
    if any(_covers(fault, sender, receiver) for sender in team for receiver in team if sender != receiver):
        return None
    alone = next(name for name in team if _covers(fault, name, name))
    return ("link",), f"{alone} is the only robot at both ends, and none hears itself; expected two different robots"


def ends_work(fault: Fault, task: str) -> bool:
    """Whether from some time on its robot does not work on `task` with open eyes any more."""
    if fault.end < math.inf:
        return False
    match fault:
        case Crash() | Hang():
            return True
        case Blind():
            return fault.delay is None
        case Stuck():
            return fault.task in {None, task}
        case _:
            return False


def contradiction(fault: Fault, earlier: Fault, robots: Iterable[str]) -> str | None:
    """Why `fault` cannot be in force together with `earlier`, as a sentence without its subject; None if it can."""
    if robot_of(fault) is not None and robot_of(fault) == robot_of(earlier):
        return _contradiction_at_robot(fault, earlier)
    if isinstance(fault, LinkFault) and isinstance(earlier, LinkFault) and fault.overlaps(earlier):
        return _contradiction_on_links(fault, earlier, list(robots))
    return None


def _contradiction_at_robot(fault: Fault, earlier: Fault) -> str | None:
    robot = robot_of(fault)
    if isinstance(fault, Crash | Hang) and isinstance(earlier, Crash | Hang):
        # A process that is killed or stopped can be neither killed nor stopped, also not at the instant of its return.
        first, second = sorted((earlier, fault), key=lambda one: one.at)
        if second.at <= first.end:
            wanted = "no further fault of it" if first.end == math.inf else f"more than {_instant(first.end)}"
            return f"at {_instant(second.at)} robot {robot} is down from an earlier {first.kind}; expected {wanted}"
    if (
        isinstance(earlier, Crash)
        and not isinstance(fault, Crash | Hang)
        and earlier.at <= fault.at
        and fault.end <= earlier.end
    ):
        return f"robot {robot} is down from {_instant(earlier.at)} on; expected a time at which it is there"
    if kind_of(fault) == kind_of(earlier) and fault.overlaps(earlier) and not _stuck_elsewhere(fault, earlier):
        return f"robot {robot} is {kind_of(fault)} already at that time; expected one fault of a kind at a time"
    return None


def _instant(value: float) -> str:
    """An instant as people write it: that of an injected fault has more digits than they care for."""
    return f"{round(value, 2):g} s"


def _stuck_elsewhere(fault: Fault, earlier: Fault) -> bool:
    if not (isinstance(fault, Stuck) and isinstance(earlier, Stuck)):
        return False
    return fault.task is not None and earlier.task is not None and fault.task != earlier.task


def _contradiction_on_links(fault: LinkFault, earlier: LinkFault, robots: list[str]) -> str | None:
    twice = [name for name in fault.aspects() if name in earlier.aspects()]
    if not twice:
        return None
    for sender in robots:
        for receiver in robots:
            if sender != receiver and _covers(fault, sender, receiver) and _covers(earlier, sender, receiver):
                return (
                    f"another rule sets {twice[0]} from {sender} to {receiver} at the same time; expected one of them"
                )
    return None


def _covers(fault: LinkFault, sender: str, receiver: str) -> bool:
    return any(fits(sender, senders) and fits(receiver, receivers) for senders, receivers in fault.pairs())
