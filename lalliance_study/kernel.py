"""The kernel: thousands of missions a second, each with the very event log of the exact simulator.

It goes from event to event: a robot's next control step that matters, a message that says something new, a body's next act, a
look of the world server that publishes something. Between them motivations are straight lines and announcements say the same
as before, so that both are worked out and not stepped through.

What it exploits, and refuses to do without: no message is lost, all are under way for the same time, and that is less than
half a control step. `rules_of` says what else it cannot run.
"""

import math

import numpy as np

from lalliance_study.compiled import Memory, compiled, each, in_threads, set_threads
from lalliance_study.kernel_hearing import (
    arrive,
    beat_until,
    completed,
    hush,
    instant,
    last_beat,
    next_beat,
    say,
    wake_by,
)
from lalliance_study.kernel_hearing import refresh as refresh_time
from lalliance_study.kernel_mind import lay_down, take_up, think_active, think_idle
from lalliance_study.kernel_state import (
    HEAR,
    IDLE,
    INFINITY,
    LINE,
    NEVER,
    NOTHING,
    QUEUE,
    ROBOTS,
    SAMPLES,
    SENSE,
    TASKS,
    Rules,
    in_memory,
    new_teams,
)
from lalliance_study.kernel_world import act, die, leave, look_at, plan, publish, turn
from lalliance_study.scenarios import Missions


@compiled
def _clear(w: Memory, n: int, m: int, width: int) -> None:
    for robot in range(n):
        w.r_mates[robot] = 0
        w.r_sets[robot] = 0
        for other in range(n):
            w.k_live[robot * ROBOTS + other] = 0
            w.k_met[robot * ROBOTS + other] = 0
            w.k_last[robot * ROBOTS + other] = -INFINITY
            w.k_attempt[robot * ROBOTS + other] = -1
        for task in range(m):
            w.place[robot * TASKS + task] = -1
    for pair in range(m * width * width):
        w.q_met_on[pair] = 0
        w.q_trying[pair] = 0
        w.q_a_left[pair] = INFINITY
        w.q_time[pair] = math.nan
        w.q_measured[pair] = 0.0
        w.q_floor[pair] = 0.0
        w.q_floor_left[pair] = 0
        w.q_count[pair] = 0


@compiled
def _load_task(w: Memory, missions: Missions, number: int, task: int) -> None:
    width, count = w.width, 0
    for place in range(width):
        robot = missions.able[number, task, place]
        if robot < 0:
            break
        count += 1
        at = task * width + place
        w.p_able[at] = robot
        w.p_own[at] = missions.own[number, task, place]
        w.p_draw[at] = missions.draw[number, task, place]
        w.p_trap_at[at] = missions.trap_at[number, task, place]
        w.p_trap_lasts[at] = missions.trap_lasts[number, task, place]
        w.p_base[at] = 0.0
        w.p_since[at] = w.born
        w.p_growth[at] = 0.0
        w.p_complete[at] = 0
        w.p_earlier[at] = 0
        w.p_leavers[at] = 0
        w.place[robot * TASKS + task] = place
        w.set_task[robot * TASKS + w.r_sets[robot]] = task
        w.r_sets[robot] += 1
    w.t_able_count[task] = count
    w.t_share[task] = 0.0
    w.t_rate[task] = 0.0
    w.t_share_at[task] = w.began
    w.t_ends[task] = INFINITY
    w.t_closed[task] = 0
    w.t_published[task] = 0


@compiled
def _load_knowledge(w: Memory, rules: Rules, missions: Missions, number: int, task: int) -> None:
    """Samples of the width x width pairs of a task: the last mu."""
    samples = min(missions.known.shape[4], rules.trials)
    first = missions.known.shape[4] - samples
    count = w.t_able_count[task]
    for mine in range(count):
        hearer = w.p_able[task * w.width + mine]
        for place in range(count):
            pair = (task * w.width + mine) * w.width + place
            for index in range(samples):
                w.samples[pair * SAMPLES + index] = missions.known[number, task, mine, place, first + index]
            w.q_count[pair] = samples
            refresh_time(w, hearer, pair)


@compiled
def _find_mates(w: Memory) -> None:
    """Who shares a task with whom, in ascending order."""
    for task in range(w.m):
        for mine in range(w.t_able_count[task]):
            for place in range(w.t_able_count[task]):
                if mine != place:
                    robot, mate = w.p_able[task * w.width + mine], w.p_able[task * w.width + place]
                    w.k_met[robot * ROBOTS + mate] = 1
    for robot in range(w.n):
        for mate in range(w.n):
            if w.k_met[robot * ROBOTS + mate]:
                w.k_met[robot * ROBOTS + mate] = 0
                w.mate[robot * ROBOTS + w.r_mates[robot]] = mate
                w.r_mates[robot] += 1


@compiled
def _wake_up(w: Memory, rules: Rules, missions: Missions, number: int, robot: int) -> None:
    """A robot when the trial begins; it has made a few steps before, waiting."""
    w.r_first[robot] = missions.phase[number, robot] * rules.step
    w.r_active[robot] = -1
    w.r_idle_since[robot] = w.born
    w.r_contended[robot] = 0
    w.r_waiting[robot] = rules.beats
    w.r_dead[robot] = 0
    w.r_met[robot] = 0
    w.r_open[robot] = w.r_sets[robot]
    w.r_settle_at[robot] = INFINITY
    w.r_stale[robot] = 1
    w.r_fallback[robot] = rules.initial_task_time
    w.r_saying[robot] = NOTHING
    w.r_heard[robot] = NOTHING
    w.r_flying[robot] = 0
    w.r_said_since[robot] = 0.0
    w.r_body[robot] = -1
    w.r_stuck[robot] = 0
    w.r_turn[robot] = INFINITY
    w.r_done[robot] = 0.0
    w.r_life[robot] = missions.life[number, robot]
    w.r_dies[robot] = INFINITY
    w.r_wake[robot] = NEVER
    w.r_idle_step[robot] = NEVER
    if w.r_sets[robot] == 0:
        w.r_dead[robot] = 1
        return
    # Its first step of all announces, and then every period.
    w.r_beat[robot] = -1
    w.r_due[robot] = 0.0
    if w.r_first[robot] <= w.born:
        w.r_beat[robot] = 0
        w.r_due[robot] = rules.period
        beat_until(w, rules, robot, w.born)
    if rules.beats:
        w.r_idle_step[robot] = next_beat(w, rules, robot) if w.r_beat[robot] >= 0 else 0
    wake_by(w, rules, robot, w.born)


@compiled
def load(w: Memory, rules: Rules, missions: Missions, number: int) -> None:
    """Prepare a mission as it stands when all robots have been told that the trial begins."""
    w.n, w.m, w.width = missions.phase.shape[1], missions.able.shape[1], missions.able.shape[2]
    w.began = look_at(rules, rules.delay)
    w.born = w.began + rules.delay
    w.over = 0
    w.left = w.m
    w.last_end = 0.0
    w.soon_head = w.soon_tail = w.acts_head = w.acts_tail = 0
    w.sent = w.activations = w.takeovers = w.lines = 0
    _clear(w, w.n, w.m, w.width)
    for task in range(w.m):
        _load_task(w, missions, number, task)
        _load_knowledge(w, rules, missions, number, task)
    _find_mates(w)
    w.now = w.born
    for robot in range(w.n):
        _wake_up(w, rules, missions, number, robot)
    plan(w, rules)


@compiled
def _note(w: Memory, log: np.ndarray, robot: int, task: int, cause: int) -> None:
    if w.lines < log.shape[0]:
        line = log[w.lines]
        line["at"] = w.now
        line["robot"] = robot
        line["task"] = task
        line["cause"] = cause
    w.lines += 1


@compiled
def _step(w: Memory, rules: Rules, log: np.ndarray, robot: int, step: int) -> None:
    """One control step of a robot."""
    if step >= w.r_wake[robot]:
        if w.r_active[robot] >= 0:
            cause = think_active(w, rules, robot, step)
            if cause >= 0:
                _note(w, log, robot, w.r_active[robot], cause)
                lay_down(w, rules, robot, cause, step)
        else:
            at = think_idle(w, rules, robot, step)
            if at >= 0:
                cause = take_up(w, rules, robot, at, step)
                _note(w, log, robot, at // w.width, cause)
    if step >= w.r_idle_step[robot]:
        w.r_idle_step[robot] = NEVER
        say(w, rules, robot, IDLE, step)
        w.r_due[robot] += rules.period


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
    return math.isnan(w.q_time[at * w.width + at % w.width])


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
    else:
        leave(w, rules, who, w.now)


@compiled
def run_one(  # noqa: PLR0912 - all kinds of events meet in this loop
    w: Memory, rules: Rules, missions: Missions, number: int, log: np.ndarray
) -> None:
    """Run a mission to its end."""
    load(w, rules, missions, number)
    deadline = look_at(rules, w.began + rules.deadline)
    if deadline < w.began + rules.deadline:
        deadline += rules.world_step
    while w.over == 0:
        robot, step_at, step = -1, INFINITY, NEVER
        special, special_at = -1, INFINITY
        for one in range(w.n):
            due = min(w.r_wake[one], w.r_idle_step[one])
            if due < NEVER:
                at = instant(w, rules, one, due)
                if at < step_at:
                    robot, step_at, step = one, at, due
            if w.r_turn[one] < special_at or w.r_dies[one] < special_at:
                special, special_at = one, min(w.r_turn[one], w.r_dies[one])
        soon_at = w.soon_at[w.soon_head % QUEUE] if w.soon_head < w.soon_tail else INFINITY
        act_at = w.acts_at[w.acts_head % QUEUE] if w.acts_head < w.acts_tail else INFINITY
        world_at = min(w.look, deadline)
        earliest = min(soon_at, act_at, world_at, special_at)
        if step_at < earliest:
            w.now = step_at
            _step(w, rules, log, robot, step)
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
def _result(w: Memory, result: np.ndarray) -> None:
    result[0] = w.last_end - w.began if w.left == 0 else math.nan
    result[1] = w.activations
    result[2] = w.takeovers
    result[3] = w.sent
    result[4] = w.lines


@compiled
def _run_share(
    team: Memory, laws: Memory, missions: Missions, results: np.ndarray, log: np.ndarray, first: int, stride: int
) -> None:
    w, rules = team[0], laws[0]
    for number in range(first, len(results), stride):
        run_one(w, rules, missions, number, log)
        _result(w, results[number])


@in_threads
def _run_shares(teams: Memory, laws: Memory, missions: Missions, results: np.ndarray, log: np.ndarray) -> None:
    for share in each(len(teams)):
        _run_share(teams[share : share + 1], laws, missions, results, log, share, len(teams))


RESULTS = ("makespan", "activations", "takeovers", "sent", "decisions")
"""What is kept of a mission: seconds (NaN where the deadline came first), and counts."""

_NO_LOG = np.zeros(0, LINE)


def run_missions(rules: Rules, missions: Missions) -> np.ndarray:
    """Run all missions in this thread: [count, len(RESULTS)]."""
    results = np.zeros((len(missions.able), len(RESULTS)))
    _run_share(new_teams(1), in_memory(rules), missions, results, _NO_LOG, 0, 1)
    return results


def run_in_threads(rules: Rules, missions: Missions, threads: int) -> np.ndarray:
    """The same in several threads, with the same result."""
    results = np.zeros((len(missions.able), len(RESULTS)))
    set_threads(threads)
    _run_shares(new_teams(threads), in_memory(rules), missions, results, _NO_LOG)
    return results


def run_logged(
    rules: Rules, missions: Missions, number: int, lines: int = 20_000
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run one mission: its result, its event log, and when each task was completed, in seconds after its beginning."""
    teams, log = new_teams(1), np.zeros(lines, LINE)
    only = Missions._make(part[number : number + 1] for part in missions)
    results = np.zeros((1, len(RESULTS)))
    _run_share(teams, in_memory(rules), only, results, log, 0, 1)
    w = teams[0]
    ends = np.array([w.t_ends[task] if w.t_closed[task] else np.nan for task in range(int(w.m))])
    return results[0], log[: int(w.lines)], ends - float(w.began)
