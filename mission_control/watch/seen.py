"""What was seen of a mission's robots and tasks: the parts of a `Story`. Pure.

An attempt is one bar of a timeline: a robot on a task, from when to when.
"""

from dataclasses import dataclass, field

from lalliance_agents.wire.messages import LinkReport, Motivations, Scalars

#: How an attempt ended that no decision ended: the robot's process ended, a new trial began, the mission ended.
LOST = "lost"
NEW_TRIAL = "new_trial"
OVER = "over"


@dataclass(slots=True)
class Attempt:
    """A robot on a task: one bar of a timeline."""

    robot: str
    task: str
    trial: int
    since: float
    """In seconds since the trial began."""
    began: str | None = None
    """The cause of the decision; None where it was not seen."""
    until: float | None = None
    """In seconds since the trial began; None: it goes on."""
    ended: str | None = None
    """The cause of the decision, or `LOST`, `NEW_TRIAL` or `OVER`; None where it goes on or that was not seen."""


@dataclass(slots=True)
class RobotSeen:
    """What was last seen of a robot."""

    name: str
    present: bool | None = None
    """Whether its process is there; None: nobody has said so far."""
    incarnation: int = 0
    heard_at: float | None = None
    """When it last said something other than a decision, on the onlooker's clock, in seconds."""
    tasks: tuple[str, ...] = ()
    """What it says it can do."""
    attempts: dict[str, Attempt] = field(default_factory=dict)
    """Those that go on, by task: at most one, unless erratum 5 is read literally."""
    last: Attempt | None = None
    """The one that ended last."""
    motivations: Motivations | None = None
    threshold: float = 1.0
    """What a motivation must reach, as far as a decision has said."""
    link: LinkReport | None = None

    @property
    def task(self) -> str | None:
        """The task it is on."""
        return next(iter(self.attempts), None)

    @property
    def strongest(self) -> tuple[str, Scalars] | None:
        """The task it is most motivated for, with the factors of that motivation."""
        sets = self.motivations.sets if self.motivations is not None else {}
        ranked = sorted(sets.items(), key=lambda item: -number(item[1].get("motivation")))
        return ranked[0] if ranked else None

    @property
    def hears(self) -> dict[str, bool]:
        """Of each teammate that it ever heard: whether it hears it now."""
        if self.link is None:
            return {}
        return {name: one.lost_for is None for name, one in self.link.teammates.items()}


@dataclass(slots=True)
class TaskSeen:
    """What was last seen of a task."""

    name: str
    applicable: bool = False
    complete: bool = False
    progress: float = 0.0
    """From 0 to 1."""
    completed_at: float | None = None
    """In seconds since the trial began."""


def number(value: object) -> float:
    """A value as a number; 0 if it is none."""
    return float(value) if isinstance(value, int | float) else 0.0
