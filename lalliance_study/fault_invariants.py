"""Invariants of faults: what was scheduled happened, what is said to have happened did, and silence has its consequence.

The lengths of time in here are bounds that follow from the parameters and from the delays of the world: `STEP` between two
looks at the world, `REFRESH_PERIOD` between two reports of what faults did to messages and between two refreshes of a body.
"""

import math
from collections.abc import Iterator

from lalliance_agents.config import Mission
from lalliance_agents.faults import (
    Blind,
    Bursts,
    Crash,
    Fault,
    Hang,
    LinkFault,
    Partition,
    RadioFault,
    Slow,
    Stuck,
    describe,
    fits,
    robot_of,
)
from lalliance_agents.model.parameters import Architecture, Erratum, Learning
from lalliance_study.evidence import Choice, Evidence, Sight
from lalliance_study.logbook import Timing
from world_server.world import REFRESH_PERIOD, STEP

#: From the instant at which something is due in the world to its effect at a robot, in seconds: a step, and messages.
LAG = STEP + 0.02
#: An order meets a process that is still starting when it is there, in seconds.
START_UP = Timing().start_up
#: A chance smaller than this does not happen.
NEVER = 1e-9


def is_taken_again(evidence: Evidence) -> Iterator[str]:
    """What a robot was on that falls silent is taken again, if a teammate is there that is free to do so.

    A free teammate of L-ALLIANCE takes the task at the latest at

        max(last message + d + tau + p, idle since + boredom_threshold / boredom_rate + p) + max_delay + 2 p,

    where d is the delay of a message and p the control period. It notices the silence in its first step more than tau after the
    last message that it heard, which was sent before the fall; from then on its impatience is fast, and reaches the threshold
    within max_delay. What may keep its motivation at 0 is the influence of learning, until it is bored; it is idle from the
    fall on at the latest, or, where it is only just born, from tau after its birth (erratum 4). With parameters set by hand
    there is no boredom, and the delay is threshold / fast_rate. Two steps more: one in which the motivation begins to grow,
    and one because the threshold is met between two steps.

    Free means: it can do the task and senses it as open, its process runs all the time, it is idle all the time and senses and
    hears all the time, and nobody else is on the task meanwhile.
    """
    history, mission = evidence.history, evidence.mission
    if mission.live.learning is not Learning.ADAPTIVE or evidence.several_sets:
        return
    for at, victim, how, task in history.silenced:
        if task is None or at < evidence.began:
            continue
        for robot in mission.able(task):
            until = _taken_by(evidence, robot, at)
            if robot != victim and until < evidence.ended and is_free(evidence, robot, task, at, until):
                if not _stays_away(evidence, victim, at, until):
                    continue
                taken = [one for one in history.spans if one.task == task and one.since <= until and one.until > at]
                if not [one for one in taken if one.robot != victim] and not _completed(evidence, task, until):
                    yield (
                        f"{victim} on {task} was {how} at {at:.3f}, and {robot}, which is idle and can do it, has not taken it "
                        f"by {until:.3f}"
                    )


def _taken_by(evidence: Evidence, robot: str, at: float) -> float:
    """The instant by which `robot`, if it is free, takes what a teammate was on that fell silent at `at`."""
    own, period = evidence.mission.parameters_of(robot), evidence.mission.control_period
    silent = at + evidence.message_delay + own.silence_timeout + period
    return max(silent, bored_by(evidence, robot, at)) + longest_delay(evidence.mission, robot) + 2 * period


def bored_by(evidence: Evidence, robot: str, idle_since: float) -> float:
    """The instant by which nothing but its patience keeps `robot` from a task, if it is idle from `idle_since` on."""
    own, period = evidence.mission.parameters_of(robot), evidence.mission.control_period
    births = evidence.history.births.get(robot, ())
    born = max([evidence.began, *(one for one in births if one <= idle_since)])
    begun = max(idle_since, born + own.silence_timeout + period) + period
    if own.architecture is Architecture.ALLIANCE:
        return begun
    return begun + own.boredom_threshold / own.effective_boredom_rate


def longest_delay(mission: Mission, robot: str) -> float:
    """The longest time that motivation takes to grow to the threshold at the fast rate, in seconds."""
    own = mission.parameters_of(robot)
    if own.architecture is Architecture.ALLIANCE:
        return max(own.threshold / own.for_set(task).fast_rate for task in mission.robots[robot].tasks)
    return own.max_delay


def is_free(evidence: Evidence, robot: str, task: str, at: float, until: float) -> bool:
    """Whether `robot` is idle, senses `task` as open, hears all and runs, from one instant to another."""
    mission, history = evidence.mission, evidence.history
    own = mission.parameters_of(robot)
    literal = any(one is not Erratum.SECOND_PATIENCE and own.is_literal(one) for one in Erratum)
    return (
        not literal
        and history.ran_throughout(robot, at, until)
        and history.idle_throughout(robot, at, until)
        and not is_disturbed(evidence, robot, until)
        and _senses_open(evidence, robot, task, at, until)
    )


def is_disturbed(evidence: Evidence, robot: str, until: float) -> bool:
    """Whether a fault may have kept `robot` from sensing or hearing before `until`, or delayed what it heard."""
    begun = evidence.began
    return any(
        isinstance(fault, Blind | LinkFault | Partition | RadioFault)
        and begun + fault.at < until
        and (not isinstance(fault, Blind) or fault.robot == robot)
        for fault in evidence.mission.faults
    )


def _senses_open(evidence: Evidence, robot: str, task: str, at: float, until: float) -> bool:
    last: Sight | None = None
    for note in evidence.notes:
        if note.at > until:
            break
        if isinstance(note, Sight) and note.robot == robot and note.task == task:
            if note.at > at:
                return False
            last = note
    return last is not None and last.applicable and not last.complete


def _stays_away(evidence: Evidence, victim: str, at: float, until: float) -> bool:
    """Whether a process is not continued or started again before `until`; what it then says changes everything."""
    return not any(at < since <= until for since, _ in evidence.history.running.get(victim, ()))


def _completed(evidence: Evidence, task: str, until: float) -> bool:
    done = evidence.summary["tasks"][task]["completed_at"]
    return done is not None and evidence.began + done <= until


def faults_fire(evidence: Evidence) -> Iterator[str]:
    """A fault has its effect if it had the occasion, as far as that can be told from outside.

    - crash, hang: the victim's process runs for a while (`LAG`) while the fault is to be in force;
    - stuck, slow: so long, and longer than a refresh of its action where it came back, its body is on the task;
    - blind: the victim runs for longer than the second after which all is refreshed;
    - links: robots that are heard by others run for so long that the chance of all their messages being spared is `NEVER`; told
      only where no other rule is in force, since the first of two rules hides the second.
    """
    begun = evidence.began
    for fault, report in zip(evidence.mission.faults, evidence.summary["faults"], strict=True):
        since, until = begun + fault.at + LAG, min(begun + fault.end, evidence.ended) - LAG
        if evidence.live and not report["fired"] and since < until and _had_occasion(evidence, fault, since, until):
            yield f"{report['name']} ({describe(fault)}) never fired although it was due at {fault.at:g} s"


def _had_occasion(evidence: Evidence, fault: Fault, since: float, until: float) -> bool:
    match fault:
        case Crash() | Hang():
            return _longest_run(evidence, fault.robot, since, until) > LAG
        case Stuck() | Slow():
            return _longest_work(evidence, fault, since, until) > LAG
        case Blind():
            return _longest_run(evidence, fault.robot, since, until) > REFRESH_PERIOD + LAG
        case _:
            return not _others_rule(evidence.mission, fault) and _spared(evidence, fault, since, until) < NEVER


def _longest_run(evidence: Evidence, robot: str, since: float, until: float) -> float:
    runs = evidence.history.running.get(robot, ())
    return max((min(end, until) - max(start, since) for start, end in runs), default=0.0)


def _longest_work(evidence: Evidence, fault: Stuck | Slow, since: float, until: float) -> float:
    """For how long the victim's body surely was on a task at which the fault holds it up, in seconds."""
    longest = 0.0
    task = fault.task if isinstance(fault, Stuck) else None
    for span in evidence.history.spans:
        if span.robot == fault.robot and task in {None, span.task}:
            for start, end in evidence.history.running.get(fault.robot, ()):
                # A body that comes back acts again with the next refresh.
                begins = max(span.since, since, start + REFRESH_PERIOD + LAG)
                longest = max(longest, min(span.until, until, end) - begins)
    return longest


def _others_rule(mission: Mission, fault: Fault) -> bool:
    return any(
        one is not fault and isinstance(one, LinkFault | Partition | RadioFault) and one.overlaps(fault)
        for one in mission.faults
    )


def _spared(evidence: Evidence, fault: Fault, since: float, until: float) -> float:
    """The chance that no message between robots that share a task is touched; draws of different links do not depend."""
    mission, chance = evidence.mission, 1.0
    touched = _least_chance(fault)
    for senders, receivers in _pairs(fault):
        for sender in mission.robots:
            for mate in mission.teammates(sender):
                if fits(sender, senders) and fits(mate, receivers):
                    chance *= (1 - touched) ** _least_messages(evidence, sender, mate, since, until)
    return chance


def _pairs(fault: Fault) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    """The globs of senders and receivers whose messages a fault touches."""
    match fault:
        case LinkFault() | Partition():
            return list(fault.pairs())
        case RadioFault(kind="mute"):
            return [((fault.robot,), ("*",))]
        case RadioFault():
            return [(("*",), (fault.robot,))]
        case _:
            return []


def _least_messages(evidence: Evidence, sender: str, mate: str, since: float, until: float) -> int:
    """How many messages of `sender` came at least to where `mate` was there to hear them."""
    own, period = evidence.mission.parameters_of(sender), evidence.mission.control_period
    if own.is_literal(Erratum.IDLE_HEARTBEAT):
        return 0
    count = 0
    for start, end in evidence.history.running.get(sender, ()):
        for birth, death in evidence.history.running.get(mate, ()):
            begin, stop = max(start + 2 * period, birth, since), min(end, death, until)
            if stop > begin and not _unheard(evidence, sender, mate, begin, stop):
                count += max(math.floor((stop - begin - period) * own.broadcast_rate) - 1, 0)
    return count


def _unheard(evidence: Evidence, sender: str, mate: str, since: float, until: float) -> bool:
    """Whether `sender` was for a while on a task that `mate` cannot do, and was not heard by it (erratum 17, literal)."""
    if not evidence.mission.parameters_of(mate).is_literal(Erratum.HEARD_ELSEWHERE):
        return False
    shared = evidence.mission.robots[mate].tasks
    return any(
        one.robot == sender and one.task not in shared and one.since <= until and one.until >= since
        for one in evidence.history.spans
    )


def _least_chance(fault: Fault) -> float:
    """The least chance with which a rule touches a message, whatever it did to those before."""
    if not isinstance(fault, LinkFault) or fault.cut or fault.delay is not None:
        return 1.0
    spared = (1 - (fault.duplicate or 0.0)) * (1 - (fault.reorder or 0.0))
    if isinstance(fault.loss, Bursts):
        bad = min(fault.loss.enter, 1 - fault.loss.leave)
        return 1 - spared * (
            1 - min(fault.loss.bad, fault.loss.good) - bad * max(fault.loss.bad - fault.loss.good, 0.0)
        )
    return 1 - spared * (1 - (fault.loss or 0.0))


def what_is_cut_off_is_silent(evidence: Evidence) -> Iterator[str]:
    """A robot last heard a teammate before the link between them was cut, as long as it is; told where nothing comes late."""
    faults = evidence.mission.faults
    if any(isinstance(one, LinkFault) and (one.delay is not None or one.reorder) for one in faults):
        return
    cuts = [
        one for one in faults if isinstance(one, Partition | RadioFault) or (isinstance(one, LinkFault) and one.cut)
    ]
    for fault in cuts if evidence.live else ():
        since, until = evidence.began + fault.at + LAG, evidence.began + fault.end
        for choice in evidence.choices():
            heard = choice.at - choice.silent_for
            if choice.other is not None and since < heard <= choice.at <= until and _touches(fault, choice):
                yield (
                    f"{choice.at:.3f} {choice.robot} has heard {choice.other} on {choice.task} at {heard:.3f}, but since "
                    f"{since - LAG:.3f} there is {describe(fault)}"
                )


def _touches(fault: Fault, choice: Choice) -> bool:
    """Whether a fault touches what the robot of a choice hears of the other one."""
    other = choice.other or ""
    return any(fits(other, senders) and fits(choice.robot, receivers) for senders, receivers in _pairs(fault))


def what_fired_was_there(evidence: Evidence) -> Iterator[str]:
    """A fault that is said to have had an effect did: in its time, on a robot that was there, on a body that was working."""
    begun, history = evidence.began, evidence.history
    for fault, report in zip(evidence.mission.faults, evidence.summary["faults"], strict=True):
        if report["fired"] != (report["count"] > 0) or report["fired"] != (report["fired_at"] is not None):
            yield f"{report['name']} is told to have fired: {report['fired']}, {report['count']} times, {report['fired_at']}"
        if report["fired_at"] is None:
            continue
        since, until = begun + fault.at - LAG, begun + fault.end + LAG
        # Reports of links and senses come once a second, and at the end; an order may be carried out after the fault's end.
        if not fault.at - LAG <= report["fired_at"] <= fault.end + REFRESH_PERIOD + START_UP + LAG:
            yield f"{report['name']} fired at {report['fired_at']:.3f} s, out of its time"
        robot = robot_of(fault)
        if isinstance(fault, Crash | Hang):
            how = "killed" if isinstance(fault, Crash) else "stopped"
            until += START_UP
            if not any(since <= at <= until and (who, what) == (robot, how) for at, who, what, _ in history.silenced):
                yield f"{report['name']} fired, but no running process of {robot} was {how} then"
        elif isinstance(fault, Stuck | Slow) and not any(
            one.robot == robot and one.since <= until and one.until >= since for one in history.spans
        ):
            yield f"{report['name']} fired, but {robot} was on no task then"
