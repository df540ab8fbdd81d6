"""How simulated robots sense tasks: what the world publishes, who misses it or gets it late, and who is told once more."""

from collections.abc import Callable, Collection, Mapping

from lalliance_agents.wire.keys import WORLD
from lalliance_agents.wire.messages import Blindness
from lalliance_study.member import Member, Process
from world_server.world import World

Views = list[tuple[str, bool, bool]]
"""Of each task whether it is applicable, and complete."""
Told = tuple[int, str, Views]
"""What the world says of tasks: the trial, its way of learning, and how they stand."""


class Senses:
    """The sensory feedback of a team.

    Args:
        world: what is sensed.
        members: who senses.
        delay: how long what is published is under way, in seconds.
        at: has something done at an instant: the instant, a priority, what, and with which arguments.
    """

    def __init__(self, world: World, members: Mapping[str, Member], delay: float, at: Callable[..., None]) -> None:
        self._world = world
        self._members = members
        self._delay = delay
        self._at = at
        self._seen: dict[str, tuple[int, bool, bool]] = {}
        self._published: tuple[int, Views] = 0, []
        #: Who has missed something.
        self._late: set[str] = set()
        self._blind: dict[str, tuple[str, float | None]] = {}
        #: Of robots whose senses were held back: when what they know of each task was said.
        self._tardy: dict[str, dict[str, float]] = {}

    def missed(self, robot: str) -> None:
        """A robot has missed something, and is to be told all at the next refresh."""
        self._late.add(robot)

    def tell_all(self, robot: str, now: float) -> None:
        """Tell a robot all at once."""
        self._late.discard(robot)
        self._send(robot, self._whole_view(), now)

    def blind(self, blind: Collection[Blindness]) -> None:
        """These are the robots whose senses are held back from now on."""
        found = {one.robot: (one.fault, one.delay) for one in blind}
        self._late |= self._blind.keys() - found.keys()
        self._blind = found

    def refresh(self, now: float) -> None:
        """Once a second: who has missed something is told all."""
        for name in list(self._late):
            # Senses that come late are refreshed all the same, and the refresh comes late.
            held_back = name in self._blind and self._blind[name][1] is None
            if self._members[name].runs and not held_back:
                self.tell_all(name, now)
        for name, (fault, _) in self._blind.items():
            if self._members[name].runs:
                self._members[name].effects[fault, WORLD] += len(self._members[name].tasks)

    def publish(self, now: float) -> None:
        """Tell all who can do them of the tasks that have changed."""
        if self._world.trial == 0 or self._world.over:
            return
        trial, learning, views = self._whole_view()
        if (trial, views) == self._published:
            return
        self._published = trial, views
        changed = [view for view in views if self._is_new(trial, view)]
        if changed:
            for name, member in self._members.items():
                mine = [view for view in changed if view[0] in member.tasks]
                if mine:
                    self._send(name, (trial, learning, mine), now)

    def _is_new(self, trial: int, view: tuple[str, bool, bool]) -> bool:
        known = trial, *view[1:]
        if self._seen.get(view[0]) == known:
            return False
        self._seen[view[0]] = known
        return True

    def _whole_view(self) -> Told:
        views = [(task, view.applicable, view.complete) for task, view in self._world.tasks().items()]
        return self._world.trial, self._world.learning, views

    def _send(self, robot: str, told: Told, now: float) -> None:
        arrives = now + self._delay
        self._at(arrives, 0, self._reach, robot, told, arrives)

    def _reach(self, name: str, told: Told, now: float, said_at: float | None = None) -> None:
        """What the world says of tasks reaches a robot, unless it is blind; `said_at` is when, if it was held back."""
        member = self._members[name]
        if name in self._blind and said_at is None:
            fault, delay = self._blind[name]
            member.effects[fault, WORLD] += len(told[2])
            if delay is None:
                self._late.add(name)
            else:
                self._tardy.setdefault(name, {})
                self._at(now + delay, 0, self._reach, name, told, now + delay, now)
            return
        if member.process is Process.STOPPED:
            self._late.add(name)
        if name in self._tardy:
            told = _in_order(self._tardy[name], told, now if said_at is None else said_at)
        member.sense(*told, now)


def _in_order(known: dict[str, float], told: Told, said_at: float) -> Told:
    """Without what has been overtaken: a robot drops what is older than what it knows."""
    views = [view for view in told[2] if said_at >= known.get(view[0], 0.0)]
    known.update((view[0], said_at) for view in views)
    return told[0], told[1], views
