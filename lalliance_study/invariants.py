"""What must hold of every mission, whatever its team, parameters and faults; judged from the evidence alone.

An invariant is a function from `Evidence` to the sentences in which it was broken, each with the facts. `INVARIANTS` names them
all. Here stand those of tasks, robots and accounts; what concerns faults and silence is in `fault_invariants`.
"""

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import NamedTuple

from lalliance_agents.faults import Blind
from lalliance_agents.model.events import Cause, Verb
from lalliance_agents.model.parameters import SLACK
from lalliance_study import fault_invariants
from lalliance_study.accounts import attempts_are_real, credit_is_due, takeovers_are_real, totals_agree
from lalliance_study.evidence import Choice, Evidence, Sight
from lalliance_study.limit_invariants import (
    attempts_are_limited,
    collisions_are_settled,
    contenders_make_yield,
    patience_ends,
)
from lalliance_study.promises import promise, sound
from world_server.world import REFRESH_PERIOD, STEP


class Violation(NamedTuple):
    """One invariant that did not hold."""

    invariant: str
    facts: str


def completes(evidence: Evidence) -> Iterator[str]:
    """A mission that is promised to complete (`promises`) does so before its deadline."""
    mission, summary = evidence.mission, evidence.summary
    promised = promise(mission)
    if promised.seconds is None or promised.seconds > mission.deadline or summary["complete"]:
        return
    open_tasks = [task for task, record in summary["tasks"].items() if record["completed_at"] is None]
    able = {task: sound(mission, task) for task in open_tasks[:3]}
    yield (
        f"not complete after {mission.deadline:g} s although promised within {promised.seconds:.0f} s ({promised.why}): "
        f"open {', '.join(open_tasks)}; sound robots {able}"
    )


def one_set_at_most(evidence: Evidence) -> Iterator[str]:
    """A robot has at most one active set, ends only what is active, and decides nothing while its process does not run."""
    if not evidence.several_sets:
        yield from evidence.history.broken


def own_tasks_only(evidence: Evidence) -> Iterator[str]:
    """A robot takes only tasks that it can do."""
    for choice in evidence.choices():
        if choice.task not in evidence.mission.robots[choice.robot].tasks:
            yield f"{choice.at:.3f} {choice.robot} decides about {choice.task}, which it cannot do"


def only_what_is_open(evidence: Evidence) -> Iterator[str]:
    """A robot takes a task only if it senses it as applicable and not complete, and with all factors at 1."""
    felt: dict[tuple[str, str], Sight] = {}
    for note in evidence.notes:
        if isinstance(note, Sight):
            felt[note.robot, note.task] = note
        elif note.verb == Verb.ACTIVATE:
            sight = felt.get((note.robot, note.task))
            if sight is None or sight.complete or not sight.applicable:
                known = "nothing of it" if sight is None else f"since {sight.at:.3f} that it is {_state(sight)}"
                yield f"{note.at:.3f} {note.robot} takes {note.task}, but senses {known}"
            elif not note.ready:
                yield f"{note.at:.3f} {note.robot} takes {note.task} while a factor of its motivation is 0"


def _state(sight: Sight) -> str:
    return "complete" if sight.complete else "open" if sight.applicable else "not applicable"


def leaves_what_is_closed(evidence: Evidence) -> Iterator[str]:
    """A set ends at the robot's next control step after the robot sensed that its task is complete or does not apply."""
    due: dict[tuple[str, str], Sight] = {}
    active: dict[str, set[str]] = {}
    for note in evidence.notes:
        closed_since = due.pop((note.robot, note.task), None)
        if closed_since is not None:
            yield from _stayed(evidence, closed_since, note.at)
        if isinstance(note, Choice) and note.verb == Verb.ACTIVATE:
            active.setdefault(note.robot, set()).add(note.task)
        elif isinstance(note, Choice):
            active.get(note.robot, set()).discard(note.task)
        elif note.complete or not note.applicable:
            # A robot that was killed meanwhile has left its task without a word.
            here = note.task in active.get(note.robot, ())
            if here and evidence.history.is_on(note.robot, note.task, note.at):
                due[note.robot, note.task] = note
    for sight in due.values():
        yield from _stayed(evidence, sight, evidence.ended)


def causes_are_sensed(evidence: Evidence) -> Iterator[str]:
    """A robot that ends a set as complete senses the task as complete, and one that drops it as inapplicable does not."""
    felt: dict[tuple[str, str], Sight] = {}
    for note in evidence.notes:
        if isinstance(note, Sight):
            felt[note.robot, note.task] = note
        elif note.cause in {Cause.SENSED, Cause.INAPPLICABLE}:
            sight = felt.get((note.robot, note.task))
            expected = "complete" if note.cause == Cause.SENSED else "not applicable"
            if sight is None or _state(sight) != expected:
                state = "nothing of it" if sight is None else f"it as {_state(sight)}"
                yield f"{note.at:.3f} {note.robot} ends {note.task} as {note.cause}, but senses {state}"


def _stayed(evidence: Evidence, sight: Sight, until: float) -> Iterator[str]:
    after = sight.at + evidence.mission.control_period + SLACK
    if until > after and evidence.history.ran_throughout(sight.robot, sight.at, after):
        yield f"{sight.robot} sensed at {sight.at:.3f} that {sight.task} is {_state(sight)}, and was on it until {until:.3f}"


def silence_is_long(evidence: Evidence) -> Iterator[str]:
    """A task is taken because of silence no earlier than tau after its robot was last heard on it."""
    for choice in evidence.choices():
        if choice.verb == Verb.ACTIVATE and choice.cause == Cause.SILENCE:
            tau = evidence.mission.parameters_of(choice.robot).silence_timeout
            if choice.silent_for < tau - SLACK:
                yield (
                    f"{choice.at:.3f} {choice.robot} takes {choice.task} because of silence after {choice.silent_for:.3f} s, "
                    f"tau is {tau:g} s"
                )


def contenders_are_heard(evidence: Evidence) -> Iterator[str]:
    """A task is yielded only to a teammate that was heard on it within tau."""
    for choice in evidence.choices():
        tau = evidence.mission.parameters_of(choice.robot).silence_timeout
        if choice.verb == Verb.YIELD and choice.silent_for > tau + SLACK:
            yield (
                f"{choice.at:.3f} {choice.robot} yields {choice.task} to a teammate that it has not heard on it for "
                f"{choice.silent_for:.3f} s, tau is {tau:g} s"
            )


def completions_are_sensed(evidence: Evidence) -> Iterator[str]:
    """A robot whose process runs senses that a task is complete within a refresh of the world, and the delay of its senses.

    Told of the last trial, and of robots whose senses are not held back for a time.
    """
    mission, began, history = evidence.mission, evidence.began, evidence.history
    delays: dict[str, float] = {}
    for fault in mission.faults:
        if isinstance(fault, Blind):
            late = math.inf if fault.delay is None else fault.delay
            delays[fault.robot] = max(delays.get(fault.robot, 0.0), late)
    sensed = {
        (note.robot, note.task)
        for note in evidence.notes
        if isinstance(note, Sight) and note.at >= began and note.complete
    }
    for task, record in evidence.summary["tasks"].items():
        if record["completed_at"] is None:
            continue
        for robot in mission.able(task):
            delay = delays.get(robot, 0.0)
            since = began + record["completed_at"]
            if (robot, task) in sensed:
                continue
            until = since + REFRESH_PERIOD + 2 * STEP + delay + 0.01
            if until < evidence.ended and history.ran_throughout(robot, since, until):
                yield f"{robot} has not sensed by {until:.3f} that {task} was completed at {since:.3f}"


def time_goes_on(evidence: Evidence) -> Iterator[str]:
    """The log is in order of time."""
    before = 0.0
    for line in evidence.log:
        if line.at < before:
            yield f"'{line}' is logged after {before:.6f}"
        before = line.at


INVARIANTS: dict[str, Callable[[Evidence], Iterator[str]]] = {
    one.__name__: one
    for one in (
        completes,
        one_set_at_most,
        own_tasks_only,
        only_what_is_open,
        leaves_what_is_closed,
        causes_are_sensed,
        silence_is_long,
        contenders_are_heard,
        completions_are_sensed,
        time_goes_on,
        credit_is_due,
        attempts_are_real,
        takeovers_are_real,
        totals_agree,
        collisions_are_settled,
        attempts_are_limited,
        contenders_make_yield,
        patience_ends,
        fault_invariants.is_taken_again,
        fault_invariants.faults_fire,
        fault_invariants.what_is_cut_off_is_silent,
        fault_invariants.what_fired_was_there,
    )
}


#: Sentences told of one invariant and mission: a defect that shows in each step needs no more.
MOST_TOLD = 3


def judge(evidence: Evidence) -> list[Violation]:
    """What did not hold: of each invariant the first few sentences."""
    return [
        Violation(name, facts) for name, holds in INVARIANTS.items() for facts in islice(holds(evidence), MOST_TOLD)
    ]
