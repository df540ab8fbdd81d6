"""What the missions of a team are measured by: their optima, each computed once, whoever asks."""

import math

import numpy as np

from lalliance_study.assignments import Floats
from lalliance_study.baselines import TOLERANCE
from lalliance_study.optimum import Optimum, optimum, shared_optimum
from lalliance_study.scenarios import Missions
from world_server.environments.task_pool import HandOver


def times_of(missions: Missions, robots: int) -> Floats:
    """The own times, `[count, robots, tasks]` in seconds, infinite where a robot cannot do a task."""
    count, tasks, width = missions.able.shape
    times = np.full((count, robots, tasks), np.inf)
    mission, task, _ = np.indices((count, tasks, width), sparse=True)
    times[mission, missions.able, task] = missions.own
    return times


class Optima:
    """HRASP's optima, remembered. No clock limits the search, so that they depend on nothing but the problem.

    Args:
        work_limit: for one of them, in CP-SAT's deterministic seconds.
    """

    def __init__(self, work_limit: float) -> None:
        self._work_limit = work_limit
        self._known: dict[tuple[bytes, bytes], Optimum] = {}

    def __call__(self, times: Floats, ready: Floats | None = None) -> Optimum:
        """The optimum for robots that are free from `ready` on, by default from the start; see `optimum`."""
        free_at = np.zeros(len(times)) if ready is None else ready
        key = (times.tobytes(), free_at.tobytes())
        if key not in self._known:
            self._known[key] = optimum(
                times, ready=free_at, tolerance=TOLERANCE, time_limit=math.inf, work_limit=self._work_limit
            )
        return self._known[key]


def shared_makespans(times: Floats, hand_over: HandOver) -> Floats:
    """The optimum of each mission where robots share work, in seconds; NaN where none is shared.

    Args:
        times: `[count, robots, tasks]` in seconds.
        hand_over: what a second robot finds.
    """
    if hand_over == "restart":
        return np.full(len(times), np.nan)
    return np.array([shared_optimum(one, hand_over).makespan for one in times])
