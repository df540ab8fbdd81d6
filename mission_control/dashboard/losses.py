"""What share of a robot's messages reaches each teammate, as who looks on can tell. Pure.

Whoever looks on hears every robot, through no link rule. So it counts what a robot has said, by task, and knows what each
teammate that shares a task with it could hear of that. The teammate's own report says how much of it arrived. The share is
taken over the last few reports, and one message less is taken for granted, as it may be under way while the report is made.
"""

from collections import Counter, defaultdict, deque
from collections.abc import Mapping

from lalliance_agents.model.equations import is_heard
from lalliance_agents.wire.messages import Reception

#: Reports over which a share is taken; robots make one each second.
REPORTS = 6
#: Fewer messages than this tell nothing.
FEWEST = 4


class Losses:
    """Counts what was said, and compares it with what was heard."""

    def __init__(self) -> None:
        self._said: defaultdict[str, Counter[str | None]] = defaultdict(Counter)
        self._reports: defaultdict[tuple[str, str], deque[tuple[int, int]]] = defaultdict(lambda: deque(maxlen=REPORTS))

    def say(self, robot: str, task: str | None) -> None:
        """A robot announced that it is on a task, or that it is idle."""
        self._said[robot][task] += 1

    def report(
        self, robot: str, mates: Mapping[str, Reception], tasks: Mapping[str, tuple[str, ...]], *, elsewhere: bool
    ) -> dict[str, float | None]:
        """The share lost of what each teammate said, from 0 to 1; None where too little was said to tell.

        Args:
            robot: who reports what it has heard.
            mates: what that was, of each teammate.
            tasks: what each robot can do.
            elsewhere: whether it hears teammates also on tasks that it cannot do (erratum 17).
        """
        own = frozenset(tasks.get(robot, ()))
        shares: dict[str, float | None] = {}
        for mate, reception in mates.items():
            audible = 0
            if own.intersection(tasks.get(mate, ())) and mate in self._said:
                said = self._said[mate].items()
                audible = sum(count for task, count in said if is_heard(task is None, task in own, elsewhere))
            shares[mate] = self._share(self._reports[robot, mate], audible, reception.received)
        return shares

    @staticmethod
    def _share(reports: deque[tuple[int, int]], audible: int, received: int) -> float | None:
        if reports and received < reports[-1][1]:  # the robot has begun a new life
            reports.clear()
        reports.append((audible, received))
        said, heard = audible - reports[0][0], received - reports[0][1]
        if said < FEWEST:
            return None
        return min(max(said - 1 - heard, 0) / (said - 1), 1.0)
