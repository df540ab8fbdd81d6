"""The kernel's control steps: what a robot decides is carried out, and written down.

A robot works on one task at a time. Where erratum 5 is read literally it may start several in one step, a crowd; they suppress
one another, and all stop at the next.
"""

from lalliance_agents.model.equations import reaches
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_explore import explore
from lalliance_study.kernel_hearing import before, instant, say
from lalliance_study.kernel_knowledge import who_is_present
from lalliance_study.kernel_mind import begin, think_idle
from lalliance_study.kernel_state import IDLE, NEVER, TASKS, Rules
from lalliance_study.kernel_work import cease, judge, rest, start, take_up, think_active


@inlined
def _note(w: Memory, task: int, cause: int) -> None:
    """Write down a decision of this step; see `NOTES`."""
    w.note_task[w.noted] = task
    w.note_cause[w.noted] = cause
    w.noted += 1


@compiled
def make_step(w: Memory, rules: Rules, robot: int, step: int) -> None:
    """One control step of a robot."""
    w.noted = 0
    if step >= w.r_wake[robot]:
        if w.r_crowd[robot]:
            _disperse(w, rules, robot, step)
        elif w.r_active[robot] >= 0:
            _go_on(w, rules, robot, step)
        else:
            at = explore(w, rules, robot, step) if w.exploring else think_idle(w, rules, robot, step)
            if at >= 0:
                _activate(w, rules, robot, at, step)
    if step >= w.r_idle_step[robot]:
        w.r_idle_step[robot] = NEVER
        say(w, rules, robot, IDLE, step)
        w.r_due[robot] += rules.period


@compiled
def _go_on(w: Memory, rules: Rules, robot: int, step: int) -> None:
    cause, task = think_active(w, rules, robot, step), w.r_active[robot]
    if cause >= 0:
        _note(w, task, cause)
        cease(w, rules, robot, task * w.width + w.place[robot * TASKS + task], cause)
        rest(w, rules, robot, step)


@compiled
def _activate(w: Memory, rules: Rules, robot: int, chosen: int, step: int) -> None:
    """Mind._activate: start what is ready, `chosen` or (erratum 5, literal) all of it."""
    count, first = 0, chosen
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        ready = rules.many and w.p_complete[at] == 0 and reaches(w.p_value[at], rules.threshold)
        if ready or at == chosen:
            _note(w, task, start(w, rules, robot, at))
            w.p_active[at] = 1
            first = at if count == 0 else first
            count += 1
    w.r_crowd[robot] = count if count > 1 else 0
    take_up(w, rules, robot, first, step)


@compiled
def _disperse(w: Memory, rules: Rules, robot: int, step: int) -> None:
    """The step at which the sets of a crowd suppress one another (erratum 5, literal)."""
    now, last = instant(w, rules, robot, step), before(w, rules, robot, step)
    begin(w, rules, robot, now, last)
    who_is_present(w, rules, robot, now)
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        if w.p_active[at]:
            cause = judge(w, rules, robot, at, now, last, True)[0]
            _note(w, task, cause)
            cease(w, rules, robot, at, cause)
    w.r_crowd[robot] = 0
    rest(w, rules, robot, step)
