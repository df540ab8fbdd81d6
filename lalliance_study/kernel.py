"""The kernel: thousands of missions a second, each with the very event log of the exact simulator.

It goes from event to event: a robot's next control step that matters, a message that says something new, a body's next act, a
look of the world server that publishes something. Between them motivations are straight lines and announcements say the same
as before, so that both are worked out and not stepped through.

What it exploits, and refuses to do without: no message is lost, all are under way for the same time, and that is less than
half a control step. `rules_of` says what else it cannot run.
"""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lalliance_study.compiled import Memory, compiled, entrance, inlined
from lalliance_study.kernel_hearing import (
    arrive,
    beat_until,
    completed,
    hush,
    instant,
    last_beat,
    wake_by,
)
from lalliance_study.kernel_load import load, next_trial
from lalliance_study.kernel_state import (
    HEAR,
    INFINITY,
    LINE,
    NEVER,
    QUEUE,
    SENSE,
    TASKS,
    TRIAL,
    Rules,
    in_memory,
    new_teams,
)
from lalliance_study.kernel_steps import make_step
from lalliance_study.kernel_world import act, die, leave, publish, turn
from lalliance_study.scenarios import Missions


@compiled
def _sense(w: Memory, rules: Rules, task: int) -> None:
    """All who can do a task are told that it is complete."""
    for place in range(w.t_able_count[task]):
        at = task * w.width + place
        robot = w.p_able[at]
        if w.r_dead[robot]:
            continue
        completed(w, rules, robot, task, w.now)
        w.p_complete[at] = 1
        w.p_base[at] = 0.0
        w.p_growth[at] = 0.0
        w.r_stirred[robot] = 1
        w.r_open[robot] -= 1
        if w.r_active[robot] < 0 and w.r_open[robot] == 0:
            w.r_wake[robot] = NEVER
        elif w.r_active[robot] == task or _matters(w, rules, robot):
            wake_by(w, rules, robot, w.now)


@compiled
def _matters(w: Memory, rules: Rules, robot: int) -> bool:
    """Whether what a robot learns of other tasks can change what it does now: not if it works alone, in a known time."""
    task = w.r_active[robot]
    if task < 0 or w.r_contended[robot] or rules.influence_on_active:
        return True
    at = task * w.width + w.place[robot * TASKS + task]
    return math.isnan(w.q_time[at * w.width + w.p_mine[at]])


@compiled
def _die(w: Memory, rules: Rules, robot: int) -> None:
    """A robot's process ends."""
    beat_until(w, rules, robot, w.now)
    w.r_dead[robot] = 1
    w.r_wake[robot] = NEVER
    w.r_idle_step[robot] = NEVER
    w.r_dies[robot] = INFINITY
    if w.r_flying[robot] == 0:
        w.r_old_last[robot] = last_beat(w, rules, robot) + rules.delay
        w.r_old_length[robot] = last_beat(w, rules, robot) - w.r_said_since[robot]
        hush(w, rules, robot)
    die(w, rules, robot)


@compiled
def _happen(w: Memory, rules: Rules) -> None:
    """The first thing in the queue of what is under way arrives."""
    slot = w.soon_head % QUEUE
    w.soon_head += 1
    who = w.soon_who[slot]
    if w.soon_kind[slot] == HEAR:
        arrive(w, rules, who)
    elif w.soon_kind[slot] == SENSE:
        _sense(w, rules, who)
    elif w.soon_kind[slot] == TRIAL:
        next_trial(w, rules)
    else:
        leave(w, rules, who, w.now)


@inlined
def _next_step(w: Memory, rules: Rules) -> tuple[int, float, int]:
    """The robot that makes the next control step, when, and which."""
    robot, step_at, step = -1, INFINITY, NEVER
    for one in range(w.n):
        due = min(w.r_wake[one], w.r_idle_step[one])
        if due < NEVER:
            at = instant(w, rules, one, due)
            if at < step_at:
                robot, step_at, step = one, at, due
    return robot, step_at, step


@inlined
def _next_mishap(w: Memory) -> tuple[int, float]:
    """The robot that next dies, gets stuck or comes free, and when."""
    robot, mishap_at = -1, INFINITY
    for one in range(w.n):
        if w.r_turn[one] < mishap_at or w.r_dies[one] < mishap_at:
            robot, mishap_at = one, min(w.r_turn[one], w.r_dies[one])
    return robot, mishap_at


@compiled
def _write(w: Memory, log: np.ndarray, robot: int) -> None:
    for index in range(w.noted):
        line = log[w.lines + index]
        line["at"] = w.now
        line["robot"] = robot
        line["task"] = w.note_task[index]
        line["cause"] = w.note_cause[index]


@compiled
def run_one(w: Memory, rules: Rules, missions: Missions, number: int, log: np.ndarray) -> None:
    """Run a mission to its end."""
    load(w, rules, missions, number)
    while w.over == 0:
        robot, step_at, step = _next_step(w, rules)
        special, special_at = _next_mishap(w)
        soon_at = w.soon_at[w.soon_head % QUEUE] if w.soon_head < w.soon_tail else INFINITY
        act_at = w.acts_at[w.acts_head % QUEUE] if w.acts_head < w.acts_tail else INFINITY
        world_at = min(w.look, w.gives_up_at, w.trial_at)
        earliest = min(soon_at, act_at, world_at, special_at)
        if step_at < earliest:
            w.now = step_at
            make_step(w, rules, robot, step)
            if w.noted > 0:
                if w.lines + w.noted <= log.shape[0]:
                    _write(w, log, robot)
                w.lines += w.noted
            continue
        w.now = earliest
        if act_at == earliest:
            slot = w.acts_head % QUEUE
            w.acts_head += 1
            act(w, rules, w.acts_who[slot], w.acts_task[slot], act_at)
        elif soon_at == earliest:
            _happen(w, rules)
        elif special_at == earliest:
            if w.r_dies[special] == special_at:
                _die(w, rules, special)
            else:
                turn(w, rules, special, special_at)
        else:
            publish(w, rules)


@compiled
def _result(w: Memory, rules: Rules, result: np.ndarray) -> None:
    for robot in range(w.n):
        if not w.r_dead[robot]:
            beat_until(w, rules, robot, w.now)
    result[0] = w.last_end - w.began if w.left == 0 else math.nan
    result[1] = w.activations
    result[2] = w.takeovers
    result[3] = w.sent
    result[4] = w.lines


@entrance
def _run_some(
    team: Memory, laws: Memory, missions: Missions, results: np.ndarray, log: np.ndarray, first: int, until: int
) -> None:
    w, rules = team[0], laws[0]
    for number in range(first, until):
        run_one(w, rules, missions, number, log)
        _result(w, rules, results[number])


RESULTS = ("makespan", "activations", "takeovers", "sent", "decisions")
"""What is kept of a mission: seconds (NaN where the deadline came first), and counts."""

#: Parts that each thread has of the missions, so that none waits long for the last.
PARTS = 16

_NO_LOG = np.zeros(0, LINE)


def run_missions(rules: Rules, missions: Missions) -> np.ndarray:
    """Run all missions in this thread: [count, len(RESULTS)]."""
    results = np.zeros((len(missions.able), len(RESULTS)))
    _run_some(new_teams(1), in_memory(rules), missions, results, _NO_LOG, 0, len(results))
    return results


def run_in_threads(rules: Rules, missions: Missions, threads: int) -> np.ndarray:
    """The same in several threads, with the same result."""
    results = np.zeros((len(missions.able), len(RESULTS)))
    at_once = math.ceil(len(results) / (PARTS * threads))
    laws, firsts = in_memory(rules), iter(range(0, len(results), max(at_once, 1)))

    def work(team: Memory) -> None:
        for first in firsts:  # whichever thread is free takes the next
            _run_some(team, laws, missions, results, _NO_LOG, first, min(first + at_once, len(results)))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, [new_teams(1) for _ in range(threads)]))
    return results


def run_logged(rules: Rules, missions: Missions, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run one mission: its result, its event log, and when each task was completed, in seconds after its beginning."""
    teams, log = new_teams(1), _NO_LOG
    only = Missions._make(part[number : number + 1] for part in missions)
    results = np.zeros((1, len(RESULTS)))
    w = teams[0]
    while True:
        _run_some(teams, in_memory(rules), only, results, log, 0, 1)
        if w.lines == len(log):
            break
        log = np.zeros(int(w.lines), LINE)
    ends = np.array([w.t_ends[task] if w.t_closed[task] else np.nan for task in range(int(w.m))])
    return results[0], log, ends - float(w.began)
