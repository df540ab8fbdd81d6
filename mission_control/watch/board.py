"""What `lalliance top` shows of a mission: a row for each robot, and how they are sorted. Pure.

Loss is the share of teammates' messages that faults on their way took, of all that came or would have come. A teammate is
heard unless it was found silent. Both are a robot's own counts, as it reports them once a second.
"""

from collections.abc import Callable
from typing import NamedTuple

from lalliance_agents.bus.faulty import LOST
from lalliance_agents.wire.messages import LinkReport
from mission_control.watch.seen import RobotSeen
from mission_control.watch.story import Story


class Row(NamedTuple):
    """One robot."""

    robot: str
    present: bool | None
    task: str | None
    on_it: float | None
    """Since when, in seconds."""
    wants: str | None
    """The task that it is most motivated for."""
    motivation: float
    """From 0 to 1: as a share of the threshold, as far as that can be told; 1 where it is on a task."""
    hears: int
    """Teammates heard now."""
    heard: int
    """Teammates heard at all."""
    loss: float
    """Share of messages lost on their way, from 0 to 1."""
    missed: int
    """Control periods without a control step."""
    missed_share: float
    """Of all control periods, from 0 to 1."""
    silent: float | None
    """Since when nothing has come from it, in seconds."""

    @property
    def state(self) -> str:
        """The task, or why there is none."""
        if self.present is False:
            return "not there"
        return self.task or ("idle" if self.present else "")


def rows(story: Story, now: float) -> list[Row]:
    """All robots at the instant `now` of the onlooker's clock, in the order in which they were first heard of."""
    elapsed = story.elapsed(now)
    return [_row(seen, elapsed, now) for seen in story.robots.values()]


def _row(seen: RobotSeen, elapsed: float, now: float) -> Row:
    attempt = next(iter(seen.attempts.values()), None)
    wants, motivation = _wish(seen)
    hears = seen.hears
    missed, share = _missed(seen.link)
    return Row(
        robot=seen.name,
        present=seen.present,
        task=seen.task,
        on_it=None if attempt is None else max(elapsed - attempt.since, 0.0),
        wants=wants,
        motivation=1.0 if seen.task else motivation,
        hears=sum(hears.values()),
        heard=len(hears),
        loss=_loss(seen.link),
        missed=missed,
        missed_share=share,
        silent=None if seen.heard_at is None else max(now - seen.heard_at, 0.0),
    )


def _wish(seen: RobotSeen) -> tuple[str | None, float]:
    strongest = None if seen.task or seen.present is False else seen.strongest
    if strongest is None:
        return None, 0.0
    task, factors = strongest
    motivation, threshold = factors.get("motivation"), seen.threshold
    if not isinstance(motivation, int | float) or motivation <= 0:
        return None, 0.0
    return task, min(motivation / threshold, 1.0)


def _loss(link: LinkReport | None) -> float:
    if link is None:
        return 0.0
    lost = link.dropped.get(LOST, 0)
    received = sum(one.received for one in link.teammates.values())
    return lost / (lost + received) if lost else 0.0


def _missed(link: LinkReport | None) -> tuple[int, float]:
    if link is None:
        return 0, 0.0
    periods = link.missed + link.ticks
    return link.missed, link.missed / periods if periods else 0.0


class Order(NamedTuple):
    """A way to sort rows, with the key that chooses it."""

    letter: str
    name: str
    of: Callable[[Row], object]
    falling: bool
    """Whether the largest comes first."""


ORDERS = (
    Order("n", "name", lambda row: row.robot, False),
    Order("t", "task", lambda row: (row.present is False, row.task is None, row.task or ""), False),
    Order("m", "motivation", lambda row: row.motivation, True),
    Order("h", "heard", lambda row: row.hears, False),
    Order("l", "loss", lambda row: row.loss, True),
    Order("p", "missed", lambda row: row.missed, True),
    Order("s", "silence", lambda row: row.silent or 0.0, True),
)


class Selection:
    """Which rows are shown, and in which order; changed by keys.

    Attributes:
        order: how they are sorted.
        turned: whether the other way round.
        first: how many rows are scrolled away.
    """

    def __init__(self) -> None:
        self.order = ORDERS[0]
        self.turned = False
        self.first = 0
        self.page = 10

    def press(self, key: str) -> bool:
        """Take a key; whether it means the end."""
        if key in {"q", "Q"}:
            return True
        moves = {"up": -1, "down": 1, "page up": -self.page, "page down": self.page, "home": -(10**6)}
        chosen = next((order for order in ORDERS if order.letter == key), None)
        if key in {"left", "right"}:
            place = (ORDERS.index(self.order) + (1 if key == "right" else -1)) % len(ORDERS)
            self.order = ORDERS[place]
        elif key == "r":
            self.turned = not self.turned
        elif chosen is not None:
            self.order, self.first = chosen, 0
        self.first = max(self.first + moves.get(key, 0), 0)
        return False

    def of(self, found: list[Row], room: int) -> list[Row]:
        """The rows that fit into `room` lines."""
        self.page = max(room - 1, 1)
        self.first = min(self.first, max(len(found) - room, 0))
        ordered = sorted(found, key=lambda row: row.robot)
        ordered.sort(key=self.order.of, reverse=self.order.falling is not self.turned)  # type: ignore[arg-type]
        return ordered[self.first : self.first + room]
