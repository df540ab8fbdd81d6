"""Invariants of the limits of an attempt: those of Table 1, patience with a teammate and with oneself, and collisions.

What a robot has learned is not in the evidence. So these are told only where it knows just what it was given: in missions of
one trial with `knowledge: given`, of a robot's first attempt at a task, and of teammates' patience with the first attempt of
all. There its own time is the one that the mission says, and so are the limits, up to the grid of its control steps (period p):

- patience phi: its own time, or with strategy III the teammate's; by hand `patience`;
- psi, before it yields to a contender: at most its own time (strategy II: the least of the team's); by hand `yield_time`;
- lambda, before it gives up: `give_up_factor` times its own time; by hand `give_up_time`.
"""

from collections.abc import Iterator

from lalliance_agents.model.parameters import Architecture, Erratum, Learning, Strategy
from lalliance_study.evidence import Evidence, Span
from lalliance_study.fault_invariants import bored_by, is_disturbed, is_free, longest_delay


def attempts_are_limited(evidence: Evidence) -> Iterator[str]:
    """A robot gives its first attempt up within lambda and 2 p."""
    if not _knows_what_it_is_given(evidence):
        return
    for span in _first_attempts(evidence):
        until = span.since + _limits(evidence, span)[1] + 2 * evidence.mission.control_period
        if _lasts(evidence, span, until):
            yield f"{span.robot} is on {span.task} since {span.since:.3f}, and has not given it up by {until:.3f}"


def contenders_make_yield(evidence: Evidence) -> Iterator[str]:
    """A robot that hears a contender yields its first attempt within psi, or the delay of a message, and 2 p.

    The contender announces itself in the step in which it begins, and is heard on the task as long as it is on it.
    """
    if not _knows_what_it_is_given(evidence):
        return
    period = evidence.mission.control_period
    for span in _first_attempts(evidence):
        for other in evidence.history.spans:
            if other.task != span.task or other.robot == span.robot:
                continue
            psi = span.since + _limits(evidence, span)[0]
            until = max(psi, other.since + evidence.message_delay) + 2 * period
            heard = other.since >= span.since and _lasts(evidence, other, until)
            if heard and _lasts(evidence, span, until) and not is_disturbed(evidence, span.robot, until):
                yield (
                    f"{span.robot} is on {span.task} since {span.since:.3f} and {other.robot} since {other.since:.3f}, "
                    f"but {span.robot} has not yielded by {until:.3f}"
                )


def collisions_are_settled(evidence: Evidence) -> Iterator[str]:
    """Of two robots whose first attempts at a task begin within the collision window, the slower one yields within 2 p.

    That is after it has begun and has heard of the other (erratum 15); of two that are as fast the one with the later name is
    taken for the slower one. Told of L-ALLIANCE, which announces own times; by hand other times are announced.
    """
    if not _knows_what_it_is_given(evidence):
        return
    mission, period, delay = evidence.mission, evidence.mission.control_period, evidence.message_delay
    spans = list(_first_attempts(evidence))
    for slow in spans:
        for fast in spans:
            if fast.task != slow.task or _expects(evidence, fast) >= _expects(evidence, slow):
                continue
            own = mission.parameters_of(slow.robot)
            together = abs(slow.since - fast.since) + delay < own.effective_collision_window
            until = max(slow.since, fast.since) + delay + 2 * period
            both = together and _lasts(evidence, fast, until) and _lasts(evidence, slow, until)
            by_hand = any(
                mission.parameters_of(one.robot).architecture is Architecture.ALLIANCE for one in (fast, slow)
            )
            # A process that stands still as the other begins may not hear of it before the next announcement.
            heard = evidence.history.ran_throughout(slow.robot, min(slow.since, fast.since), until)
            if both and heard and not by_hand and not is_disturbed(evidence, slow.robot, until):
                yield (
                    f"{slow.robot} and {fast.robot} began {slow.task} at {slow.since:.3f} and {fast.since:.3f}, and "
                    f"{slow.robot} has not yielded by {until:.3f}"
                )


def _expects(evidence: Evidence, span: Span) -> tuple[float, str]:
    return evidence.mission.robots[span.robot].tasks[span.task], span.robot


def patience_ends(evidence: Evidence) -> Iterator[str]:
    """A robot that is idle beside the first attempt at a task takes the task when its patience has ended.

    Its motivation falls to 0 when it first hears of the attempt, and is at the threshold when phi has passed: the slow rate
    is threshold / phi. What may keep it at 0 is the influence of learning, until the robot is bored; then it grows at the slow
    rate until phi has passed and at the fast one from then on. So it takes the task by

        max(beginning + d + p + phi, bored) + delay + 3 p,

    d the delay of a message, delay the longest of its range (by hand threshold / fast_rate), unless another one does.
    """
    if not _knows_what_it_is_given(evidence):
        return
    mission, period = evidence.mission, evidence.mission.control_period
    for span in _first_attempts(evidence):
        if _earlier(evidence, span):
            continue
        for robot in mission.able(span.task):
            if robot == span.robot:
                continue
            begun = span.since + evidence.message_delay + period
            patient = begun + _patience(evidence, robot, span)
            until = max(patient, bored_by(evidence, robot, span.since)) + longest_delay(mission, robot) + 3 * period
            alone = _lasts(evidence, span, until) and not _joined(evidence, span, until)
            if alone and is_free(evidence, robot, span.task, span.since, until):
                yield (
                    f"{span.robot} is on {span.task} since {span.since:.3f}, and {robot}, which is idle and can do it, has not "
                    f"taken it by {until:.3f}"
                )


def _knows_what_it_is_given(evidence: Evidence) -> bool:
    mission = evidence.mission
    literal = any(
        mission.parameters_of(robot).is_literal(one)
        for robot in mission.robots
        for one in Erratum
        if one is not Erratum.SECOND_PATIENCE
    )
    one_trial = sum(phase.trials for phase in mission.phases) == 1
    return one_trial and mission.live.learning is Learning.ADAPTIVE and mission.knowledge == "given" and not literal


def _first_attempts(evidence: Evidence) -> Iterator[Span]:
    seen: set[tuple[str, str]] = set()
    for span in sorted(evidence.history.spans, key=lambda one: one.since):
        if (span.robot, span.task) not in seen:
            seen.add((span.robot, span.task))
            yield span


def _earlier(evidence: Evidence, span: Span) -> bool:
    return any(one.task == span.task and one.since <= span.since and one is not span for one in evidence.history.spans)


def _joined(evidence: Evidence, span: Span, until: float) -> bool:
    return any(
        one.task == span.task and one is not span and span.since <= one.since <= until for one in evidence.history.spans
    )


def _lasts(evidence: Evidence, span: Span, until: float) -> bool:
    """Whether an attempt goes on after `until`, its robot's process running all the time, and the mission too."""
    lasts = span.until > until and evidence.ended > until
    return lasts and evidence.history.ran_throughout(span.robot, span.since, until)


def _limits(evidence: Evidence, span: Span) -> tuple[float, float]:
    """The longest that psi can be, and lambda, in seconds."""
    own = evidence.mission.parameters_of(span.robot)
    if own.architecture is Architecture.ALLIANCE:
        by_hand = own.for_set(span.task)
        return by_hand.yield_time, by_hand.give_up_time
    time = evidence.mission.robots[span.robot].tasks[span.task]
    return time, own.give_up_factor * time


def _patience(evidence: Evidence, robot: str, span: Span) -> float:
    """Phi of `robot` with the robot of an attempt, in seconds."""
    own = evidence.mission.parameters_of(robot)
    if own.architecture is Architecture.ALLIANCE:
        return own.for_set(span.task).patience
    whose = span.robot if own.strategy is Strategy.III else robot
    return evidence.mission.robots[whose].tasks[span.task]
