"""The kernel's minds in the active learning phase: motivations grow by chance, and every step of an idle robot counts.

These are `Mind.tick` with `Appraisal.learning` of the model.
"""

import numpy as np

from lalliance_agents.model import equations
from lalliance_study.compiled import Memory, compiled, inlined
from lalliance_study.kernel_hearing import before, instant
from lalliance_study.kernel_knowledge import read, who_is_present
from lalliance_study.kernel_mind import contention, first_of, waits
from lalliance_study.kernel_state import INFINITY, NEVER, TASKS, Rules

learning_impatience = equations.learning_impatience
motivation = equations.motivation
reaches = equations.reaches

#: Of splitmix64.
ONE, GOLDEN = np.uint64(1), np.uint64(0x9E3779B97F4A7C15)
FIRST, SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)


@compiled
def draw(w: Memory, robot: int) -> float:
    """The next number in [0, 1) of a robot: draw number c of its own word (see `scenarios`)."""
    mixed = w.r_chance[robot] + w.r_drawn[robot] * GOLDEN
    w.r_drawn[robot] += ONE
    mixed = (mixed ^ (mixed >> np.uint64(30))) * FIRST
    mixed = (mixed ^ (mixed >> np.uint64(27))) * SECOND
    mixed = mixed ^ (mixed >> np.uint64(31))
    return np.float64(mixed >> np.uint64(11)) * 2.0**-53


@inlined
def _taken(w: Memory, rules: Rules, at: int, now: float, last: float) -> bool:
    """Appraisal._taken."""
    if not rules.looks_back:
        return contention(w, rules, at, now, last)[0]
    task = w.p_task[at]
    for place in range(w.t_able_count[task]):
        if w.q_met_on[at * w.width + place] and w.present[w.p_able[task * w.width + place]]:
            return True
    return False


@compiled
def explore(w: Memory, rules: Rules, robot: int, step: int) -> int:
    """The control step of an idle robot in active learning; the place of the task that it takes up, or -1."""
    now, last = instant(w, rules, robot, step), before(w, rules, robot, step)
    if waits(w, rules, robot, step, now, last):
        return -1
    if rules.looks_back:
        who_is_present(w, rules, robot, now)
    highest = -INFINITY
    for index in range(w.r_sets[robot]):
        task = w.set_task[robot * TASKS + index]
        at = task * w.width + w.place[robot * TASKS + task]
        if w.p_complete[at]:
            continue
        untaken = learning_impatience(_taken(w, rules, at, now, last))
        increment = rules.threshold * draw(w, robot) if untaken else 0.0
        w.p_base[at] = w.p_value[at] = motivation(w.p_base[at], increment, 1, 1, untaken, 1, 1)
        w.p_since[at] = now
        if reaches(w.p_value[at], rules.threshold):
            highest = max(highest, w.p_value[at])
    w.r_wake[robot] = NEVER if w.r_open[robot] == 0 else step + 1
    if highest == -INFINITY:
        return -1
    read(w, rules, robot)
    who_is_present(w, rules, robot, now)
    return first_of(w, robot, highest)
