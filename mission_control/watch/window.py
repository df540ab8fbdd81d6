"""The part of a mission that somebody asks about: which robot, which task, from when to when. Pure."""

from collections.abc import Iterable
from dataclasses import dataclass

from lalliance_agents.errors import UserError
from lalliance_agents.suggestions import like_or_any
from mission_control.watch.happened import Happened
from mission_control.watch.story import Story

#: Events that belong to the story of the robot they are about; what else happens follows from decisions.
_BEFALLS = {"present", "gone", "fault", "fault_over"}


@dataclass(frozen=True, slots=True)
class Window:
    """What is asked about.

    Attributes:
        robot: whom; None: the whole mission.
        task: decisions about it alone; None: any.
        begins: seconds since the trial began.
        ends: the same.
    """

    robot: str | None = None
    task: str | None = None
    begins: float = 0.0
    ends: float = float("inf")

    def holds(self, one: Happened) -> bool:
        """Whether this is part of the answer."""
        if not self.begins <= one.at <= self.ends:
            return False
        if one.made is None:
            about = one.robot == self.robot and one.kind in _BEFALLS and self.task is None
            return about or self.is_whole
        return self.robot in {None, one.robot} and self.task in {None, one.task}

    @property
    def is_whole(self) -> bool:
        """Whether it is about no robot in particular."""
        return self.robot is None and self.task is None

    def of(self, story: Story) -> list[Happened]:
        """What the story holds of it, in the order in which it happened."""
        found = [one for one in story.happened if self.holds(one)]
        return sorted(found, key=lambda one: (one.trial, one.at))

    def check(self, story: Story) -> None:
        """Make sure that there are such a robot and such a task.

        Raises:
            UserError: there are not, as far as the story has come.
        """
        _check("robot", self.robot, story.robots, story.mission)
        _check("task", self.task, story.tasks, story.mission)


def _check(what: str, name: str | None, known: Iterable[str], mission: str) -> None:
    names = sorted(known)
    if name is not None and name not in names:
        raise UserError(f"mission {mission} has no {what} {name[:80]!r}{like_or_any(name, names)}")


def instant(text: str) -> float:
    """An instant as people write it, in seconds: `134`, `134.5` or `2:14`.

    Raises:
        UserError: it is none.
    """
    minutes, colon, seconds = text.rpartition(":")
    try:
        found = (int(minutes) * 60 if colon else 0) + float(seconds)
    except (ValueError, OverflowError):
        found = -1.0
    if not 0 <= found < float("inf"):
        raise UserError(
            f"{text[:80]!r} is no instant; expected seconds since the trial began, or minutes and seconds: 2:14"
        )
    return found
