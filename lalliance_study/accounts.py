"""Invariants of the world's account: who is credited, which attempts and takeovers are told, and whether the totals agree.

The account is the world's; the log of the robots' own decisions is the other side, and the mission says what was possible.
Instants of the account count from the live trial's start, those of the log from the simulation's.
"""

import math
from collections.abc import Iterator
from itertools import pairwise

from lalliance_agents.config import Mission
from lalliance_agents.faults import LinkFault
from lalliance_agents.model.parameters import SLACK
from lalliance_study.evidence import Evidence, Span
from world_server.world import REFRESH_PERIOD, STEP

#: A body hears what its mind decided after one message delay; what the world tells of it may be a step later.
LATE = STEP + 0.01
#: Share of a task's work that rounding may cost.
ROUNDING = 1e-6


def credit_is_due(evidence: Evidence) -> Iterator[str]:
    """Each task is completed once, not before it could be, by robots that were on it long enough."""
    yield from _completed_once(evidence)
    if evidence.several_sets:
        return
    mission, since = evidence.mission, evidence.began
    for task, record in evidence.summary["tasks"].items():
        at = record["completed_at"]
        if at is None:
            continue
        opened = _opened(evidence, task)
        if at < opened - SLACK:
            yield f"{task} is completed at {at:.3f} s, but opened at {opened:.3f} s"
        if not record["by"]:
            yield f"{task} is completed by nobody"
        for robot in record["by"]:
            if not any(_covers(span, since + at, evidence.message_delay) for span in _spans(evidence, robot, task)):
                yield f"{task} is credited to {robot} at {at:.3f} s, which was not on it"
        if mission.environment.kind == "task_pool":
            yield from _worked_enough(evidence, task, since + opened, since + at, record["by"])


def _completed_once(evidence: Evidence) -> Iterator[str]:
    seen: set[tuple[int, str]] = set()
    for one in evidence.history.completions:
        if (one.trial, one.task) in seen:
            yield f"{one.task} is completed twice in trial {one.trial}: {one.text}"
        seen.add((one.trial, one.task))
    if evidence.summary["complete"]:
        trial = len(evidence.history.trials)
        lost = [task for task in evidence.mission.tasks if (trial, task) not in seen]
        if lost:
            yield f"the mission is complete, but nobody completed {', '.join(lost)}"


def _opened(evidence: Evidence, task: str) -> float:
    """When work on a task could begin; infinite if a prerequisite is still open."""
    spec, records = evidence.mission.tasks[task], evidence.summary["tasks"]
    needed = [records[name]["completed_at"] for name in spec.after]
    return max([spec.arrives, *(math.inf if at is None else at for at in needed)])


def _spans(evidence: Evidence, robot: str, task: str) -> list[Span]:
    return [one for one in evidence.history.spans if one.robot == robot and one.task == task]


def _covers(span: Span, at: float, delay: float) -> bool:
    """Whether a body may have worked at an instant, given what its mind decided."""
    return span.since - SLACK <= at <= span.until + delay + SLACK


def _worked_enough(evidence: Evidence, task: str, opened: float, at: float, by: list[str]) -> Iterator[str]:
    """The time for which robots were on the task, each at its best, amounts to the whole task."""
    mission, delay = evidence.mission, evidence.message_delay
    options = mission.environment.options
    least = 1 - float(options.get("noise", 0.0))
    shares = []
    for span in evidence.history.spans:
        if span.task == task:
            worked = min(span.until + delay, at) - max(span.since, opened)
            if worked > 0:
                shares.append((span.robot, worked / (mission.robots[span.robot].tasks[task] * least)))
    if options.get("hand_over") == "restart":
        done = min(max((share for robot, share in shares if robot == one), default=0.0) for one in by) if by else 1.0
    else:
        done = sum(share for _, share in shares)
    if done < 1 - ROUNDING:
        yield f"{task} is complete with {done:.1%} of its work done by {', '.join(by)}"


def attempts_are_real(evidence: Evidence) -> Iterator[str]:
    """Each attempt that the world tells of is one of a robot that had decided for it, and attempts are told in order."""
    since = evidence.began
    for task, record in evidence.summary["tasks"].items():
        if evidence.several_sets:
            return
        attempts = record["attempts"]
        for one in attempts:
            robot, at = one["robot"], one["at"]
            if robot not in evidence.mission.able(task):
                yield f"an attempt of {robot} at {task} is told, which cannot do it"
            elif not any(
                span.since - SLACK <= since + at <= span.until + LATE for span in _spans(evidence, robot, task)
            ):
                yield f"an attempt of {robot} at {task} is told at {at:.3f} s, when it was not on it"
        if any(later["at"] < earlier["at"] for earlier, later in pairwise(attempts)):
            yield f"the attempts at {task} are not in order of time"


def takeovers_are_real(evidence: Evidence) -> Iterator[str]:
    """Each takeover is from a robot that had begun the task to another one that then began it."""
    for one in evidence.summary["takeovers"]:
        attempts = evidence.summary["tasks"][one["task"]]["attempts"]
        told = f"takeover of {one['task']} from {one['from']} to {one['to']} at {one['taken_at']:.3f} s"
        if one["from"] == one["to"]:
            yield f"{told}: it is the same robot"
        if not any(it["robot"] == one["from"] and it["at"] <= one["taken_at"] + SLACK for it in attempts):
            yield f"{told}: the former had never begun it"
        if not any(it["robot"] == one["to"] and abs(it["at"] - one["taken_at"]) <= LATE for it in attempts):
            yield f"{told}: the latter did not begin it then"
        detected, failed = one["detected_at"], one.get("failed_at")
        if detected is not None and detected > one["taken_at"] + SLACK:
            yield f"{told}: it was noticed later, at {detected:.3f} s"
        if failed is not None and (failed > one["taken_at"] + SLACK or one["after_failure"] < 0):
            yield f"{told}: the former failed later, at {failed:.3f} s"


def totals_agree(evidence: Evidence) -> Iterator[str]:
    """Counters are not negative, no more is received than was sent, and the ends of mission and trials agree."""
    summary, mission = evidence.summary, evidence.mission
    yield from _messages_agree(evidence)
    completed = [record["completed_at"] for record in summary["tasks"].values()]
    if summary["complete"]:
        last = max(at for at in completed if at is not None) if any(at is not None for at in completed) else None
        if summary["makespan"] != last or summary["trials"][-1] != last:
            yield f"the makespan is {summary['makespan']}, but the last task was completed at {last}"
        if not len(evidence.history.trials) == len(summary["trials"]) <= sum(one.trials for one in mission.phases):
            yield f"{len(evidence.history.trials)} trials began, {len(summary['trials'])} are told"
    elif summary["makespan"] is not None:
        yield f"the mission is not complete, but its makespan is {summary['makespan']}"
    elif abs(evidence.live_for - mission.deadline) > REFRESH_PERIOD:
        yield f"the mission failed after {evidence.live_for:.3f} s, its deadline is {mission.deadline:g} s"
    late = [at for at in completed if at is not None and not 0 <= at <= mission.deadline + SLACK]
    if late:
        yield f"tasks are completed at {late}, outside of the mission"


def _messages_agree(evidence: Evidence) -> Iterator[str]:
    messages, control = evidence.summary["messages"], evidence.summary["control"]
    counts = [messages["sent"], messages["received"], *messages["dropped"].values(), *control.values()]
    if min(counts) < 0:
        yield f"a counter is negative: {messages}, {control}"
    dropped = messages["dropped"]
    came = messages["received"] + dropped.get("stale", 0) + dropped.get("link fault", 0)
    most = messages["sent"] * _most_hearers(evidence.mission) * (2 if _duplicates(evidence.mission) else 1)
    if came > most:
        yield f"{came} messages came or were dropped, of {messages['sent']} sent to at most {most} ears"


def _most_hearers(mission: Mission) -> int:
    return max(len(mission.teammates(robot)) for robot in mission.robots)


def _duplicates(mission: Mission) -> bool:
    return any(isinstance(fault, LinkFault) and fault.duplicate for fault in mission.faults)
