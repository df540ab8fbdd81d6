"""The one place where a key is spelled.

Every key begins with `lalliance/<mission>/`. What follows:

    activity/<task>/<robot>     robot -> teammates   "I am on this task"; also to those who cannot do it
    heartbeat/<robot>           robot -> teammates   "I am here, idle"
    hello/<robot>               robot -> teammates   the tasks it can do
    body/<robot>/action         robot -> world       what the body works on
    sense/task/<task>           world -> robots      state of a task
    sense/robot/<robot>         world -> that robot  state of its body and of the mission
    mind/<robot>/decision       robot -> anybody     each decision with its factors; the world remembers them
    mind/<robot>/motivation     robot -> anybody     all motivations and factors
    link/<robot>                robot -> anybody     what it received, and from whom
    world/event, world/status   world -> anybody     what happened; how the mission stands
    @chaos/rules                world -> every bus   the link rules in force
    @chaos/command              operator -> world    a query: inject, heal, or tell what is in force
    @chaos/deed                 launcher -> world    a process was killed, started, stopped or continued
    @chaos/launcher             presence of whoever holds the robots' processes
    alive/<robot>               presence of a process

Example: robot `lifter` of mission `warehouse` on task `crate-1` announces itself on
`lalliance/warehouse/activity/crate-1/lifter`; `Keys("warehouse").parse(...)` of that key gives
`Key(Kind.ACTIVITY, robot="lifter", task="crate-1")`.

Names are 1 to 64 of A-Z a-z 0-9 _ -, so a name is always one chunk and never a wildcard. A chunk that begins with `@` is
not matched by `*` or `**`: recorders must subscribe to those keys by name. Who takes part without being a robot has a name
that begins with `@`, which no robot can have.
"""

import re
from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple

from lalliance_agents.errors import MessageError

ROOT = "lalliance"
NAME_PATTERN = r"^[A-Za-z0-9_-]{1,64}$"
SENDER_PATTERN = r"^@?[A-Za-z0-9_-]{1,64}$"

#: The world server, whoever holds the robots' processes, and whoever gives commands, as senders.
WORLD = "@world"
LAUNCHER = "@launcher"
OPERATOR = "@operator"

_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


class Kind(StrEnum):
    """What a key carries; the value is the key's form below the mission."""

    ACTIVITY = "activity/{task}/{robot}"
    HEARTBEAT = "heartbeat/{robot}"
    HELLO = "hello/{robot}"
    ACTION = "body/{robot}/action"
    SENSE_TASK = "sense/task/{task}"
    SENSE_ROBOT = "sense/robot/{robot}"
    DECISION = "mind/{robot}/decision"
    MOTIVATION = "mind/{robot}/motivation"
    LINK = "link/{robot}"
    EVENT = "world/event"
    STATUS = "world/status"
    CHAOS_RULES = "@chaos/rules"
    CHAOS_COMMAND = "@chaos/command"
    CHAOS_DEED = "@chaos/deed"
    LAUNCHER = "@chaos/launcher"
    ALIVE = "alive/{robot}"


#: What a robot says of its being there, on a task or idle: one stream, numbered and replaced as one.
PRESENCE = frozenset({Kind.ACTIVITY, Kind.HEARTBEAT})


class Key(NamedTuple):
    """A key taken apart."""

    kind: Kind
    robot: str | None = None
    task: str | None = None

    @property
    def speaker(self) -> str | None:
        """Who alone may speak on this key: the robot in it, the world or the launcher."""
        return _SPEAKERS.get(self.kind, self.robot)

    @property
    def stream(self) -> tuple[str | None, str | None]:
        """What a newer message replaces: all activity and heartbeats of a robot are one stream, its presence."""
        if self.kind in PRESENCE:
            return ("presence", self.robot)
        return (self.kind.format(robot=self.robot, task=self.task), None)


#: What the world says, and what each robot says, is asked for last values of, or is present with, in its own name.
OF_WORLD = (Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.EVENT, Kind.STATUS, Kind.CHAOS_RULES)
OF_ROBOT = tuple(kind for kind in Kind if "{robot}" in kind.value and kind not in OF_WORLD)
_SPEAKERS = {**dict.fromkeys(OF_WORLD, WORLD), Kind.CHAOS_COMMAND: OPERATOR, Kind.CHAOS_DEED: LAUNCHER}


def _shapes() -> dict[tuple[str, ...], Kind]:
    return {tuple(kind.value.split("/")): kind for kind in Kind}


_SHAPES = _shapes()
#: No key is longer below its mission.
_LONGEST = max(map(len, Kind)) + 2 * 64


class Keys:
    """Builds and parses the keys of one mission.

    Args:
        mission: its name, already checked.
    """

    def __init__(self, mission: str) -> None:
        self.prefix = f"{ROOT}/{mission}/"

    def build(self, kind: Kind, *, robot: str = "*", task: str = "*") -> str:
        """The key of `kind`; what is not named is a wildcard, so that the result is a pattern."""
        return self.prefix + kind.format(robot=robot, task=task)

    def parse(self, key: str) -> Key:
        """Take `key` apart.

        Raises:
            MessageError: it is no key of this mission.
        """
        below = key[len(self.prefix) :] if key.startswith(self.prefix) else ""
        found = _taken_apart(below) if len(below) <= _LONGEST else None
        if found is None:
            raise MessageError("key", f"{repr(key[:80])[:80]} is not a key of this mission")
        return found


# The same keys come again and again. A limited number are remembered, as whoever makes up names makes up keys.
@lru_cache(maxsize=2**14)
def _taken_apart(below: str) -> Key | None:
    """What stands below a mission; None: no key."""
    chunks = below.split("/")
    for shape, kind in _SHAPES.items():
        names = _match(shape, chunks)
        if names is not None:
            return Key(kind, **names)
    return None


def _match(shape: tuple[str, ...], chunks: list[str]) -> dict[str, str] | None:
    if len(shape) != len(chunks):
        return None
    names = {}
    for expected, chunk in zip(shape, chunks, strict=True):
        if expected.startswith("{"):
            if _NAME.fullmatch(chunk) is None:
                return None
            names[expected[1:-1]] = chunk
        elif expected != chunk:
            return None
    return names
