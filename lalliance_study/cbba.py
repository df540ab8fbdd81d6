"""CBBA, the consensus-based bundle algorithm, as a baseline.

Choi, Brunet, How, "Consensus-based decentralized auctions for robust task allocation", IEEE Transactions on Robotics 25(4),
2009. Every robot builds a bundle of tasks, one after the other, each time the one that adds most to its own score among those
for which it would outbid the best bid it knows of. Then robots compare bids, and one that is outbid on a task releases that
task and all that it added after it, since their bids counted on the one that is lost. This repeats until nothing changes.

The variant:

- *Score*: the paper's time-discounted reward. A task that is done at instant C is worth exp(-C / scale), all tasks alike; the
  scale is the mean of the open tasks' fastest times. A robot's path is its bundle in the order that is worth most, which is
  the shortest first (exchange two neighbours), and a bid is what the task adds to the path's worth.
- *Rounds* are synchronous, and all robots hear one another in each. Then the paper's table of consensus rules comes down to
  this: the highest bid on a task wins, and of equal ones that of the robot that comes first.
- *Bids never rise within a bundle*: a bid is at most the one before it (Johnson, Choi, Ponda, How, 2012), so that rounding
  cannot spoil the diminishing marginal gain on which convergence rests. Then at least one more bid is settled in each round,
  and there are at most as many rounds with changes as tasks.

With these scores it ends, as long as nobody dies, with the plan of `baselines.auction`: tasks enter a bundle from short to
long, so that a bid falls with the completion time alone, and CBBA is known to find what a sequential greedy auction finds.
After a death the two differ, as here all is planned anew that nobody has begun.

It knows only living robots and true times, and is run again, to its end and in no time, whenever a death is noticed.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from lalliance_study.queues import Plan, Situation


@dataclass(slots=True)
class Bidder:
    """One robot's bundle, in the order in which it grew, with its bids."""

    lengths: dict[int, float]
    """Seconds for each open task the robot can do; counted in the scale of the score, as all times here."""
    ready: float
    bundle: list[int] = field(default_factory=list)
    bids: dict[int, float] = field(default_factory=dict)

    def path(self) -> list[int]:
        """The bundle in the order that is worth most."""
        return sorted(self.bundle, key=lambda task: (self.lengths[task], task))

    def gain(self, task: int) -> float:
        """What a task adds to the worth of the path.

        It comes after what is not longer, and delays what is longer. At the very end it would add less, but that is a single
        number: it keeps the difference of two nearly equal ones from being rounded to nothing.
        """
        length, instant, later = self.lengths[task], self.ready, 0.0
        own = math.inf
        for other in self.path():
            if own == math.inf and self.lengths[other] > length:
                own = instant + length
            instant += self.lengths[other]
            if own < math.inf:
                later += math.exp(-instant)
        last = math.exp(-instant - length)
        return max(math.exp(-own) + math.expm1(-length) * later, last) if own < math.inf else last

    def grow(self, best: dict[int, tuple[float, int]], robot: int) -> bool:
        """Add tasks as long as a bid would win against the `best` bids (bid, -robot); whether there was one."""
        grown = False
        while True:
            limit = self.bids[self.bundle[-1]] if self.bundle else math.inf
            offers = [(min(self.gain(task), limit), -task) for task in self.lengths if task not in self.bids]
            winning = [(bid, task) for bid, task in offers if (bid, -robot) > best.get(-task, (0.0, -robot))]
            if not winning:
                return grown
            bid, task = max(winning)
            self.bundle.append(-task)
            self.bids[-task] = bid
            grown = True

    def release(self, best: dict[int, tuple[float, int]], robot: int) -> bool:
        """Drop the first task that another robot wins, and all that were added after it; whether there was one."""
        for place, task in enumerate(self.bundle):
            if best[task][1] != -robot:
                for dropped in self.bundle[place:]:
                    del self.bids[dropped]
                del self.bundle[place:]
                return True
        return False


def _best(bidders: list[Bidder]) -> dict[int, tuple[float, int]]:
    """The winning bid on each task that has one: (bid, -robot)."""
    best: dict[int, tuple[float, int]] = {}
    for robot, bidder in enumerate(bidders):
        for task, bid in bidder.bids.items():
            best[task] = max(best.get(task, (0.0, -robot)), (bid, -robot))
    return best


def _scale(situation: Situation) -> float:
    """The unit of time of the score, in seconds: what a task takes its fastest robot, on average.

    Longer where a robot's path could be so long that the worth of its end is not a number any more.
    """
    times = situation.times[:, situation.open]
    longest = (situation.ready + np.where(np.isfinite(times), times, 0.0).sum(axis=1)).max()
    return max(float(times.min(axis=0).mean()), float(longest) / 500)


def consensus(situation: Situation) -> tuple[Plan, int]:
    """The plan on which the robots agree, and after how many rounds with changes."""
    if not situation.open:
        return [[] for _ in situation.times], 0
    scale = _scale(situation)
    bidders = [
        Bidder(
            {task: float(row[task]) / scale for task in situation.open if np.isfinite(row[task])}, float(ready) / scale
        )
        for row, ready in zip(situation.times, situation.ready, strict=True)
    ]
    for rounds in range(len(situation.times) * len(situation.open) + 1):
        known = _best(bidders)
        grown = [bidder.grow(known, robot) for robot, bidder in enumerate(bidders)]
        told = _best(bidders)
        released = [bidder.release(told, robot) for robot, bidder in enumerate(bidders)]
        if not any(grown) and not any(released):
            return [bidder.path() for bidder in bidders], rounds
    raise RuntimeError("CBBA does not come to an agreement, although bids never rise")


def cbba(situation: Situation) -> Plan:
    """The consensus-based bundle algorithm, over all tasks that nobody has begun."""
    return consensus(situation)[0]
