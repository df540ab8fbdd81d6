"""The optimum in a mission's summary: how much shorter the mission could have been, where that is known in a moment."""

import math
from collections.abc import Mapping
from typing import Any

from lalliance_agents.config import Mission

#: A search for the optimum may take this long, in CP-SAT's deterministic seconds; one takes about a second.
WORK_LIMIT = 0.5
#: No optimum is looked for if robots times tasks is more.
LARGEST = 1000
#: Up to which share what is told may be above the optimum.
TOLERANCE = 1e-4


def with_optimum(summary: Mapping[str, Any], mission: Mission) -> dict[str, Any]:
    """The summary of a mission, or of several runs of one, with `optimum` in seconds and `ratio`.

    The optimum is that of the mission's own `hand_over`, below which no team can come. Both are None if it cannot be proven in
    a moment, if the mission has faults or is otherwise none whose optimum is known (`optimum_of`), or if the study extra is not
    installed; the ratio also if the mission is not complete. Of several runs it is that of their mean.
    """
    makespan = summary["makespan"]
    if isinstance(makespan, Mapping):
        makespan = makespan["mean"]
    optimum = _optimum(mission)
    ratio = None if optimum is None or makespan is None else makespan / optimum
    return {**summary, "optimum": optimum, "ratio": ratio}


def _optimum(mission: Mission) -> float | None:
    from lalliance_study.extras import MissingExtraError
    from lalliance_study.optimum import NoYardstickError, optimum_of

    if len(mission.robots) * len(mission.tasks) > LARGEST:
        return None
    try:
        found = optimum_of(mission, tolerance=TOLERANCE, time_limit=math.inf, work_limit=WORK_LIMIT)
    except (NoYardstickError, MissingExtraError):
        return None
    return found.makespan if found.proven else None
