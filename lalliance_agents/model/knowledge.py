"""What a robot takes the times of its team to be: the monitors of all its behaviour sets, read together.

Here stands what replaces an unknown time (erratum 10): the robot's own unknown time is the largest it has measured, or
`initial_task_time` where it has measured none; a teammate's unknown time is left out. `low` and `high` range over every robot
and task known, for tasks this robot can do, and over the robot's own times as replaced: or a robot that knows nothing but
that it failed at one task would want it as much as another.
"""

import math
from collections.abc import Mapping, Sequence

from lalliance_agents.model.equations import is_bound, presumed_time, scale_factor
from lalliance_agents.model.monitor import Monitor, Record
from lalliance_agents.model.parameters import Erratum, Parameters


class Knowledge:
    """Learned times of one robot.

    Args:
        me: the robot itself.
        tasks: the tasks it can do.
        parameters: its parameters.
    """

    def __init__(self, me: str, tasks: Sequence[str], parameters: Parameters) -> None:
        self._me = me
        self._parameters = parameters
        self._undefined_if_unknown = parameters.is_literal(Erratum.UNKNOWN_TIMES)
        self._self_counts = not parameters.is_literal(Erratum.SELF_PRESENCE)
        self.monitors = {task: Monitor(me, parameters) for task in tasks}
        #: Grows with each change of what is known.
        self.version = 0
        self._seen = -1
        self._low = self._high = math.nan
        self._longest = 0.0
        self._knows_teammates = False
        for monitor in self.monitors.values():
            monitor.on_change = self._changed

    def _changed(self) -> None:
        self.version += 1

    def _read(self) -> None:
        if self.version == self._seen:
            return
        self._seen = self.version
        extents = [monitor.extent() for monitor in self.monitors.values()]
        self._longest = max((extent.longest for extent in extents), default=0.0)
        own = [time for time in map(self.own_time, self.monitors) if not math.isnan(time)]
        low = min([extent.low for extent in extents] + own, default=math.inf)
        high = max([extent.high for extent in extents] + own, default=-math.inf)
        self._low, self._high = (low, high) if low <= high else (math.nan, math.nan)
        self._knows_teammates = any(extent.of_teammates for extent in extents)

    def own_time(self, task: str) -> float:
        """task_time_i(i, j, t) in seconds, or what stands for it; NaN if erratum 10 is read literally."""
        monitor = self.monitors[task]
        time = monitor.task_time(self._me)
        if time is not None:
            return time
        if self._undefined_if_unknown:
            return math.nan
        self._read()
        return presumed_time(self._longest, self._parameters.initial_task_time, monitor.floor(self._me))

    def has_failed(self, task: str) -> bool:
        """Whether the own time is but the lower bound that a failed attempt has left (erratum 13)."""
        return is_bound(self.own_time(task), self.monitors[task].floor(self._me))

    def best_time(self, task: str, present: Sequence[str]) -> float:
        """The least task time of the robots present, this one included (erratum 3), in seconds; else infinity."""
        monitor = self.monitors[task]
        best = self.own_time(task) if self._self_counts else math.inf
        for robot in present:
            time = monitor.task_time(robot)
            if time is not None and time < best:
                best = time
        return best

    def time_of(self, robot: str, task: str) -> float | None:
        """task_time_i(k, j, t) in seconds; None if unknown."""
        return self.monitors[task].task_time(robot)

    def span(self) -> tuple[float, float]:
        """`low` and `high` over all that is known, in seconds; NaN where nothing is."""
        self._read()
        return self._low, self._high

    def scale(self, low: float, high: float) -> float:
        """The scale factor of the delays."""
        return scale_factor(self._parameters.min_delay, self._parameters.max_delay, low, high)

    @property
    def knows_teammates(self) -> bool:
        """Whether category 1 exists: some teammate's time for some task is known (erratum 10)."""
        self._read()
        return self._knows_teammates or self._undefined_if_unknown

    def settles_at(self) -> float:
        """The instant after which some monitor has an attempt to judge; see `Monitor.settles_at`."""
        return min((monitor.settles_at() for monitor in self.monitors.values()), default=math.inf)

    def fewest(self, teammates: Mapping[str, frozenset[str]]) -> int:
        """The smallest number of samples kept of any robot for a task it shares with this one, itself included.

        Args:
            teammates: the tasks that each teammate can do.
        """
        counts = [monitor.count(self._me) for monitor in self.monitors.values()]
        for robot, tasks in teammates.items():
            counts += [self.monitors[task].count(robot) for task in tasks if task in self.monitors]
        return min(counts, default=0)

    def records(self) -> dict[str, dict[str, Record]]:
        """All that was learned: task -> robot -> record."""
        return {task: monitor.records() for task, monitor in self.monitors.items()}

    def restore(self, records: Mapping[str, Mapping[str, Record]]) -> None:
        """Take what was learned earlier, for the tasks this robot has."""
        for task, monitor in self.monitors.items():
            if task in records:
                monitor.restore(records[task])
