"""Performance monitors: what one robot has learned of how long each of the team takes for one task (section 3.3.1).

There is one monitor per behaviour set. It watches attempts: the robot's own, which it knows exactly, and those of
teammates, known through their messages. A task's completion turns the attempt that did it into a sample, the last mu of
which are kept per robot; an attempt that ended otherwise leaves a lower bound (erratum 13). Only an attempt that was the
task's first in its trial is a sample, since a second robot finds the work half done (erratum 14).

An attempt is identified by how long its robot says it has been active: when that falls, or says that the robot began
more than tau after it was last heard, a new attempt has begun. A teammate heard elsewhere has left; one that falls silent
may still be working and is not judged before the task is complete or the teammate is heard again.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from lalliance_agents.model.equations import (
    censored,
    credited,
    goes_on,
    leaves_no_trace,
    may_have_done,
    more_than,
    task_time,
)
from lalliance_agents.model.parameters import Erratum, Parameters


class Record(NamedTuple):
    """What is known of one robot's performance of one task."""

    samples: tuple[float, ...]
    """The last mu times, oldest first, in seconds."""
    floor: float = 0.0
    """What a failed attempt has taught the time to be at least, in seconds; 0 if there is none."""
    floor_left: int = 0
    """The number of further samples for which the floor holds."""


@dataclass(slots=True)
class Attempt:
    """One attempt that is watched. Instants are the watching robot's own."""

    started: float
    last: float
    active_for: float
    left: float | None = None


class Extent(NamedTuple):
    """What is known of one task at all, in seconds."""

    low: float
    """The least task time of any robot; infinite if none is known."""
    high: float
    """The greatest; minus infinity if none is known."""
    longest: float
    """The greatest time by samples alone, whatever has failed since; 0 if there is none."""
    of_teammates: bool
    """Whether a teammate's time is known."""


class _Performance:
    """Samples of one robot."""

    __slots__ = ("floor", "floor_left", "measured", "samples", "time")

    def __init__(self, trials: int, record: Record) -> None:
        self.samples: deque[float] = deque(record.samples, maxlen=trials)
        self.floor_left = min(record.floor_left, trials)
        self.floor = record.floor if self.floor_left > 0 else 0.0
        self.time: float | None = None
        self.measured = 0.0
        self.refresh()

    def refresh(self) -> None:
        """Compute the task time anew, and the time by the samples alone; None and 0 while there is no sample."""
        self.time = task_time(self.samples, self.floor) if self.samples else None
        self.measured = (task_time(self.samples) if self.floor else self.time or 0.0) if self.samples else 0.0


class Monitor:
    """The monitor mon_ij of one behaviour set.

    Args:
        me: the robot itself.
        parameters: trials, failure factor, collision window and readings are used.
    """

    def __init__(self, me: str, parameters: Parameters) -> None:
        self._me = me
        self._trials = parameters.trials
        self._failure_factor = parameters.failure_factor
        self._remembers_failures = not parameters.is_literal(Erratum.FAILED_ATTEMPTS)
        self._credits_all = parameters.is_literal(Erratum.CREDIT)
        self._collision = parameters.effective_collision_window
        self._tau = parameters.silence_timeout
        self._performances: dict[str, _Performance] = {}
        self._attempts: dict[str, Attempt] = {}
        self._anybody_left = False
        self._earlier = 0
        self._extent: Extent | None = None
        #: Told of each change of what is known.
        self.on_change: Callable[[], None] = lambda: None

    def new_trial(self) -> None:
        """Forget the attempts; keep what was learned."""
        self._attempts.clear()
        self._earlier = 0

    def observe(self, robot: str, now: float, active_for: float) -> bool:
        """`robot` is on the task since `active_for` seconds; whether this is a new attempt of it."""
        attempt = self._attempts.get(robot)
        if attempt is not None and goes_on(active_for, attempt.active_for, attempt.last, now, self._tau):
            attempt.last, attempt.active_for, attempt.left = now, active_for, None
            return False
        if attempt is not None:
            self._fail(robot, attempt)
        self._attempts[robot] = Attempt(now - active_for, now, active_for)
        return True

    def elsewhere(self, robot: str, now: float) -> None:
        """`robot` was heard idle or on another task: it has left this one, or the task is complete."""
        attempt = self._attempts.get(robot)
        if attempt is not None and attempt.left is None:
            attempt.left = now
            self._anybody_left = True

    def settle(self, now: float) -> None:
        """Judge the attempts whose robots left more than tau ago: no completion can be on its way any more."""
        if not self._anybody_left:
            return
        for robot in [name for name, one in self._attempts.items() if one.left is not None]:
            attempt = self._attempts[robot]
            if attempt.left is not None and more_than(now - attempt.left, self._tau):
                self._fail(robot, attempt)
        self._anybody_left = any(one.left is not None for one in self._attempts.values())

    def settles_at(self) -> float:
        """The instant after which `settle` has something to judge."""
        if not self._anybody_left:
            return math.inf
        left = [attempt.left for attempt in self._attempts.values() if attempt.left is not None]
        return min(left, default=math.inf) + self._tau

    def continued(self, robot: str, now: float, active_for: float) -> Attempt | None:
        """The attempt that a message of `robot`, on the task since `active_for` seconds, goes on with, if there is one."""
        attempt = self._attempts.get(robot)
        if attempt is None or attempt.left is not None:
            return None
        return attempt if goes_on(active_for, attempt.active_for, attempt.last, now, self._tau) else None

    def began(self, now: float) -> None:
        """The robot itself begins an attempt."""
        self._attempts[self._me] = Attempt(now, now, 0.0)

    def ceased(self, now: float, *, failed: bool) -> None:
        """The robot itself ends its attempt, and the task is not complete; it knows why, however short the attempt was."""
        attempt = self._attempts.get(self._me)
        if attempt is not None:
            attempt.last = now
            self._fail(self._me, attempt, failed=failed, short=not failed)

    def interrupted(self, now: float) -> None:
        """The task cannot be worked on just now: attempts end, and nobody has failed."""
        for robot, attempt in list(self._attempts.items()):
            attempt.last = now if robot == self._me else attempt.last
            self._fail(robot, attempt, failed=False)

    def completed(self, now: float) -> None:
        """Sensory feedback says that the task is complete: credit who did it."""
        if self._me in self._attempts:
            self._attempts[self._me].last = now
        silent = {robot for robot, one in self._attempts.items() if more_than(now - one.last, self._tau)}
        alone = self._only_attempt(silent)
        for robot, attempt in list(self._attempts.items()):
            if robot == alone or (self._credits_all and robot not in silent):
                self._sample(robot, credited(attempt.started, now if attempt.left is None else attempt.left))
            elif robot in silent:
                self._fail(robot, attempt)
        self._attempts.clear()

    def _only_attempt(self, silent: set[str]) -> str | None:
        """The robot whose attempt was the task's only one, not counting those that ended in a collision."""
        lasting = [
            robot
            for robot, one in self._attempts.items()
            if may_have_done(one.last - one.started, self._collision, one.left is None and robot not in silent)
        ]
        candidates = lasting or list(self._attempts)
        return candidates[0] if len(candidates) == 1 and self._earlier == 0 else None

    def _fail(self, robot: str, attempt: Attempt, *, failed: bool = True, short: bool = True) -> None:
        """End an attempt without completion; a `short` one that may have ended in a collision is as if it had never been."""
        del self._attempts[robot]
        elapsed = attempt.last - attempt.started
        if short and leaves_no_trace(elapsed, self._collision):
            return
        self._earlier += 1
        if failed and self._remembers_failures:
            known = self._of(robot)
            known.floor = censored(known.floor, self._failure_factor, elapsed)
            known.floor_left = self._trials
            self._changed(known)

    def _sample(self, robot: str, duration: float) -> None:
        known = self._of(robot)
        known.samples.append(duration)
        known.floor_left = max(known.floor_left - 1, 0)
        if known.floor_left == 0:
            known.floor = 0.0
        self._changed(known)

    def _of(self, robot: str) -> _Performance:
        if robot not in self._performances:
            self._performances[robot] = _Performance(self._trials, Record(()))
        return self._performances[robot]

    def _changed(self, known: _Performance) -> None:
        known.refresh()
        self._extent = None
        self.on_change()

    def task_time(self, robot: str) -> float | None:
        """task_time_i(k, j, t) in seconds; None while no time of `robot` is known."""
        known = self._performances.get(robot)
        return None if known is None else known.time

    def floor(self, robot: str) -> float:
        """What failed attempts of `robot` teach its time to be at least, in seconds."""
        known = self._performances.get(robot)
        return 0.0 if known is None else known.floor

    def extent(self) -> Extent:
        """The range of the times known."""
        if self._extent is None:
            known = self._performances
            times = {robot: one.time for robot, one in known.items() if one.time is not None}
            self._extent = Extent(
                min(times.values(), default=math.inf),
                max(times.values(), default=-math.inf),
                max((one.measured for one in known.values()), default=0.0),
                any(robot != self._me for robot in times),
            )
        return self._extent

    def count(self, robot: str) -> int:
        """The number of samples kept of `robot`, at most mu."""
        known = self._performances.get(robot)
        return 0 if known is None else len(known.samples)

    def records(self) -> dict[str, Record]:
        """All that was learned, for storing."""
        return {
            robot: Record(tuple(known.samples), known.floor, known.floor_left)
            for robot, known in self._performances.items()
        }

    def restore(self, records: Mapping[str, Record]) -> None:
        """Take what was learned in earlier missions."""
        self._performances = {robot: _Performance(self._trials, record) for robot, record in records.items()}
        self._extent = None
        self.on_change()
