"""What the model promises of takeovers, in mission seconds, with what real processes may add to it."""

from collections.abc import Mapping
from typing import Any

from lalliance_testing.running import RunningMission

#: What a busy machine may add to an instant, in real seconds: scheduling of several processes, and a message on its way.
BUSY = 0.4
#: What the steps of the simulated world add, in seconds.
STEPS = 0.06


def slack(mission: RunningMission) -> float:
    """What may be added to an instant that the model promises."""
    return BUSY * mission.speed if mission.engine == "real" else STEPS


def taken_in_time(mission: RunningMission, takeover: Mapping[str, Any], silent_from: float) -> bool:
    """Whether a takeover because of silence came when the model says.

    Detection needs tau since the last message, which was sent at most a broadcast period before the silence began; then the
    motivation needs at most its delay, and each is noticed at a control step.

    Args:
        mission: the mission.
        takeover: as in its summary.
        silent_from: when the silence began, in seconds since the trial began.
    """
    own = mission.mission.parameters_of(takeover["to"])
    period, tau = mission.mission.control_period, own.silence_timeout
    late = 2 * period + slack(mission)
    detected, taken = takeover["detected_at"] - silent_from, takeover["taken_at"] - silent_from
    return (
        takeover["cause"] == "silence"
        and tau - own.broadcast_period - late <= detected <= tau + late
        and taken <= tau + takeover["delay"] + late
    )


def takeovers(summary: Mapping[str, Any], task: str) -> list[tuple[str, str, str]]:
    """Who took a task from whom, and why."""
    return [(one["from"], one["to"], one["cause"]) for one in summary["takeovers"] if one["task"] == task]


def takeover(summary: Mapping[str, Any], task: str) -> dict[str, Any]:
    """The one takeover of a task."""
    [one] = [one for one in summary["takeovers"] if one["task"] == task]
    return dict(one)


def attempts(summary: Mapping[str, Any], task: str) -> list[str]:
    """Who began a task, in order."""
    return [one["robot"] for one in summary["tasks"][task]["attempts"]]
