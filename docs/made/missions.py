"""The fields of a mission file, as the records have them that check it."""

from collections.abc import Callable
from typing import get_args

from lalliance_agents.config import EnvironmentChoice, Mission, Phase, RobotSpec, TaskSpec
from lalliance_agents.faults import (
    Blind,
    Bursts,
    Crash,
    Hang,
    Link,
    LinkFault,
    LogNormal,
    Partition,
    RadioFault,
    Slow,
    Stuck,
    UniformDelay,
)
from lalliance_agents.model.parameters import Record
from lalliance_study.markdown import table
from made.records import HEAD, fields, row
from world_server.environments.box_pushing import BoxPushing
from world_server.environments.task_pool import TaskPool

#: Part -> the record whose fields it shows.
RECORDS: dict[str, type[Record]] = {
    "mission": Mission,
    "task": TaskSpec,
    "robot": RobotSpec,
    "environment": EnvironmentChoice,
    "task_pool": TaskPool.Options,
    "box_pushing": BoxPushing.Options,
    "phase": Phase,
    "link": Link,
    "bursts": Bursts,
    "lognormal": LogNormal,
}

#: Faults of robots; what all of them have is told once, of the first.
OF_ROBOTS: tuple[type[Record], ...] = (Hang, Crash, Stuck, Slow, RadioFault, Blind)
OF_LINKS: tuple[type[Record], ...] = (LinkFault, Partition)
TIMES = ("at", "until")


def robot_faults() -> str:
    """Which faults of robots there are, and what a mission says of each beside its robot and its times."""
    rows = []
    for record in OF_ROBOTS:
        kind = " or ".join(f"`{one}`" for one in get_args(record.model_fields["kind"].annotation))
        rows.append((kind, (record.__doc__ or "").split("\n")[0], ", ".join(f"`{name}`" for name in own(record))))
    return table(("kind", "what it is", "fields of its own"), rows)


def fault_fields() -> str:
    """The fields that every fault has, and those of single kinds of faults of robots."""
    rows = [(*row(Hang, name)[:1], "", *row(Hang, name)[1:]) for name in TIMES]
    for record in OF_ROBOTS:
        kind = " or ".join(f"`{one}`" for one in get_args(record.model_fields["kind"].annotation))
        rows += [(f"`{name}`", kind, *row(record, name)[1:]) for name in own(record)]
    return table(("field", "of", *HEAD[1:]), rows)


def own(record: type[Record]) -> list[str]:
    """The fields in which a kind of fault differs from the others."""
    return [name for name in record.model_fields if name not in {*TIMES, "kind", "robot"}]


def link_faults() -> str:
    """What a rule over links says beside its times."""
    return table(HEAD, [row(record, name) for record in OF_LINKS for name in own(record)])


def _of(record: type[Record]) -> Callable[[], str]:
    return lambda: fields(record)


PARTS: dict[str, Callable[[], str]] = {name: _of(record) for name, record in RECORDS.items()} | {
    "robot-faults": robot_faults,
    "fault-fields": fault_fields,
    "link-faults": link_faults,
    "uniform": lambda: fields(UniformDelay),
}
