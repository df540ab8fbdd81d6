"""The memory of the kernel: one record that holds a whole team in one mission, and the numbers that rule it.

What the exact simulator keeps in objects of several classes is kept here in flat arrays of one record of fixed size, which
is made once and used for one mission after the other: no mission allocates anything. Indices, all from 0:

- a robot `i` < n and a task `j` < m;
- a place (j, p): the robot that is the p-th of those able to do task j. There are `width` places for each task;
- a pair (j, p, q): what the robot at place p, the hearer, knows of the one at place q, the speaker, about task j. p = q is
  the hearer's own. What is said of a pair is what `Contact`, `Attempt` and the samples of a monitor say in the model;
- a couple (i, k): what robot i knows of robot k apart from tasks.

Instants are seconds since the team was started, as in the exact simulator. `NEVER` is a control step that is not made.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.model.events import OCCASIONS, REASONS_TO_STOP
from lalliance_agents.model.parameters import Architecture, Erratum, Learning, Ordering, Strategy
from lalliance_study.compiled import Memory
from lalliance_study.logbook import Timing
from world_server.environments.task_pool import HAND_OVERS
from world_server.world import TRIAL_PAUSE

#: The largest mission: robots, tasks, pairs (tasks x width x width), and samples kept of each pair.
ROBOTS, TASKS, PAIRS, SAMPLES = 20, 40, 4000, 10
PLACES = 800
#: Length of the queues of what is on its way: more than can be (3 a robot, and the tasks).
QUEUE = 256
#: What a robot can decide in one step: to start or stop all its sets. An array handed on is counted, a record is not, so
#: that decisions get to the log from here.
NOTES = TASKS

NEVER = 2**62
INFINITY = math.inf
#: What a robot says when it says that it is idle, and when it has said nothing (in this trial, or for ever).
IDLE, NOTHING = -1, -2
#: What arrives: a robot's message that says something new, that a task is complete, that a robot is gone, a new trial.
HEAR, SENSE, GONE, TRIAL = 0, 1, 2, 3

_ROBOT = {
    "first": "f8",  # its first control step
    "wake": "i8",  # the step at which it next thinks
    "idle_step": "i8",  # the step at which it first announces to be idle; NEVER if it has, or works
    "active": "i8",  # the task it works on, or -1; of several (erratum 5, literal) the one it speaks of
    "active_since": "f8",
    "crowd": "i8",  # the number of its active sets where that is more than one
    "expected": "f8",
    "idle_since": "f8",
    "contended": "u1",  # whether a teammate was on its task when it last thought
    "waiting": "u1",
    "stirred": "u1",  # whether anything was heard or sensed since it last thought while idle
    "steady": "f8",  # until when nobody it has heard is absent, and no attempt is judged
    "dead": "u1",
    "met": "i8",  # teammates heard in this trial
    "mates": "i8",  # teammates there are
    "open": "i8",  # tasks it can do and does not know to be complete
    "sets": "i8",  # tasks it can do
    "settle_at": "f8",  # when an attempt that a teammate has left is next judged
    "stale": "u1",  # whether the five below are out of date
    "low": "f8",
    "high": "f8",
    "scale": "f8",
    "longest": "f8",
    "knows": "u1",
    # its announcements
    "saying": "i8",  # task, IDLE or NOTHING
    "quiet": "i8",  # whether it announces nothing: idle, with erratum 4 literal, or not yet begun
    "said_since": "f8",  # since when it has been active, as it says
    "beat": "i8",  # the step of its latest announcement
    "due": "f8",  # when the next one is due
    "heard": "i8",  # what of this has arrived: task, IDLE or NOTHING
    "flying": "u1",  # whether a message that says something new is on its way
    "old_last": "f8",  # when the last message before what it says now arrived
    "old_length": "f8",  # how long it said then to have been active
    # its body
    "body": "i8",  # the task it works on, or -1
    "body_since": "f8",
    "done": "f8",  # of this attempt, as a share; used where work restarts
    "stuck": "u1",
    "turn": "f8",  # when its body gets stuck, or free again
    "chance": "u8",  # what its draws come from, and how many it has drawn
    "drawn": "u8",
    "life": "f8",  # how long it can still be active, in seconds
    "dies": "f8",
}
_TASK = {
    "able_count": "i8",
    "share": "f8",  # of the work that is done
    "rate": "f8",
    "share_at": "f8",
    "ends": "f8",
    "closed": "u1",  # complete
    "published": "u1",
}
_PLACE = {
    "able": "i8",
    "task": "i8",  # the task and the place of (task, place)
    "mine": "i8",
    "own": "f8",  # the robot's own time
    "draw": "f8",
    "trap_at": "f8",  # share of an attempt
    "trap_lasts": "f8",
    "base": "f8",
    "since": "f8",
    "growth": "f8",
    "value": "f8",
    "changes": "f8",  # when it changes by itself, but for its ramp, while its robot is idle
    "expected": "f8",
    "active": "u1",  # whether it is in a crowd
    "complete": "u1",  # as the robot knows
    "stale": "u1",  # whether the four below are out of date: see Extent
    "low": "f8",
    "high": "f8",
    "longest": "f8",
    "of_mates": "u1",
    "earlier": "i8",  # attempts of the trial that have ended (Monitor._earlier)
    "leavers": "i8",  # attempts that were left, and not judged yet
}
_PAIR = {
    "at": "i8",  # the hearer's place, and the robot that is the speaker
    "speaker": "i8",
    "met_on": "u1",  # whether there is a contact
    "c_first": "f8",
    "c_since": "f8",
    "c_last": "f8",  # of a contact that is not live
    "c_started": "f8",
    "c_expected": "f8",
    "trying": "u1",  # whether there is an attempt
    "a_started": "f8",
    "a_last": "f8",
    "a_length": "f8",
    "a_left": "f8",
    "time": "f8",  # task_time; NaN if unknown
    "measured": "f8",
    "floor": "f8",
    "floor_left": "i8",
    "count": "i8",
}
_COUPLE = {
    "live": "u1",  # whether what k says now has arrived at i
    "met": "u1",
    "last": "f8",  # when k was last heard, if it is not live
    "attempt": "i8",  # the task of k's attempt that i watches and that k has not left, or -1
    "place": "i8",  # in the arrays (robot, task): the place of the robot, or -1
}
_SCALARS = {
    "n": "i8",
    "m": "i8",
    "width": "i8",
    "now": "f8",
    "began": "f8",  # the trial, in the world
    "born": "f8",  # the trial, in the minds
    "look": "f8",  # the world's next look that publishes something
    "next_end": "f8",
    "left": "i8",  # tasks that are not complete
    "training": "i8",  # trials of active learning before the live one, with the present one
    "exploring": "u1",  # whether robots explore: ALLIANCE does not learn, and works as ever
    "trial_at": "f8",  # the world's look that begins the next one
    "gives_up_at": "f8",  # the world's look that finds that the deadline has come
    "over": "u1",
    "last_end": "f8",
    "soon_head": "i8",
    "soon_tail": "i8",
    "acts_head": "i8",
    "acts_tail": "i8",
    "sent": "i8",
    "activations": "i8",
    "takeovers": "i8",
    "lines": "i8",
    "noted": "i8",
}


def _fields(kinds: dict[str, str], prefix: str, length: int) -> list[tuple[str, str, tuple[int, ...]]]:
    return [(f"{prefix}_{name}", kind, (length,)) for name, kind in kinds.items()]


TEAM = np.dtype(
    [
        *[(name, kind, ()) for name, kind in _SCALARS.items()],
        *_fields(_ROBOT, "r", ROBOTS),
        *_fields(_TASK, "t", TASKS),
        *_fields(_PLACE, "p", PLACES),
        *_fields(_PAIR, "q", PAIRS),
        *_fields({name: kind for name, kind in _COUPLE.items() if name != "place"}, "k", ROBOTS * ROBOTS),
        ("place", "i8", (ROBOTS * TASKS,)),
        ("set_task", "i8", (ROBOTS * TASKS,)),
        ("mate", "i8", (ROBOTS * ROBOTS,)),
        ("present", "u1", (ROBOTS,)),
        ("samples", "f8", (PAIRS * SAMPLES,)),
        ("soon_at", "f8", (QUEUE,)),
        ("soon_kind", "i8", (QUEUE,)),
        ("soon_who", "i8", (QUEUE,)),
        ("note_task", "i8", (NOTES,)),
        ("note_cause", "i8", (NOTES,)),
        ("acts_at", "f8", (QUEUE,)),
        ("acts_who", "i8", (QUEUE,)),
        ("acts_task", "i8", (QUEUE,)),
    ],
    align=True,
)

LINE = np.dtype([("at", "f8"), ("robot", "i8"), ("task", "i8"), ("cause", "i8")], align=True)
"""One line of the event log: the cause as an index of `CAUSES`."""

CAUSES = (*OCCASIONS, *REASONS_TO_STOP)
#: Where no teammate was heard on a task; the first of the reasons to stop, which is that the task is complete.
FREE, SENSED = 0, len(OCCASIONS)
BLAMELESS = np.array([cause.is_blameless for cause in CAUSES])

SHARED_MAX, SHARED_ADD, RESTART = range(len(HAND_OVERS))


class Rules(NamedTuple):
    """What rules a mission, as numbers: the model's parameters and readings, and the delays of the real thing."""

    strategy: Strategy
    ordering: Ordering
    threshold: float
    rate: float
    period: float
    tau: float
    trials: int
    min_delay: float
    max_delay: float
    boredom_threshold: float
    boredom_rate: float
    give_up_factor: float
    failure_factor: float
    collision_window: float
    initial_task_time: float
    learns: bool
    hand_patience: float
    hand_slow_rate: float
    hand_fast_rate: float
    hand_yield_time: float
    hand_give_up_time: float
    influence_on_active: bool
    reset_on_active: bool
    many: bool
    looks_back: bool
    closed: bool
    bored_at_work: bool
    replaces_unknown: bool
    self_counts: bool
    beats: bool
    slowest_of_all: bool
    gives_up: bool
    remembers_failures: bool
    credits_all: bool
    collisions: bool
    per_attempt: bool
    elsewhere: bool
    step: float
    steps_per_second: float
    world_step: float
    delay: float
    deadline: float
    hand_over: int
    training: int


_KINDS: dict[Any, str] = {float: "f8", bool: "?"}
_RULES = np.dtype([(name, _KINDS.get(kind, "i8")) for name, kind in Rules.__annotations__.items()], align=True)


def in_memory(rules: Rules) -> Memory:
    """The rules as a record, which compiled functions can hand on by its address."""
    return np.array([tuple(rules)], _RULES).view(np.recarray)


def rules_of(mission: Mission, timing: Timing | None = None) -> Rules:
    """The rules of `mission`.

    Raises:
        UserError: the kernel cannot run it, with the reason.
    """
    timing = timing or Timing()
    parameters, options = mission.parameters, mission.environment.options
    for reason, holds in _refusals(mission, timing):
        if holds:
            raise UserError(f"the kernel cannot run mission {mission.name}: {reason}; expected the exact simulator")
    literal = parameters.is_literal
    by_hand = parameters.by_hand
    return Rules(
        parameters.strategy,
        parameters.ordering,
        parameters.threshold,
        parameters.broadcast_rate,
        parameters.broadcast_period,
        parameters.silence_timeout,
        parameters.trials,
        parameters.min_delay,
        parameters.max_delay,
        parameters.boredom_threshold,
        parameters.effective_boredom_rate,
        parameters.give_up_factor,
        parameters.failure_factor,
        parameters.effective_collision_window,
        parameters.initial_task_time,
        parameters.architecture is Architecture.L_ALLIANCE,
        by_hand.patience,
        by_hand.slow_rate,
        by_hand.fast_rate,
        by_hand.yield_time,
        by_hand.give_up_time,
        literal(Erratum.INFLUENCE_ON_ACTIVE),
        literal(Erratum.RESET_ON_ACTIVE),
        literal(Erratum.ONE_ACTIVE),
        literal(Erratum.LEARNING_WINDOW),
        not literal(Erratum.WINDOW_ENDS),
        literal(Erratum.BOREDOM_AT_WORK),
        not literal(Erratum.UNKNOWN_TIMES),
        not literal(Erratum.SELF_PRESENCE),
        not literal(Erratum.IDLE_HEARTBEAT),
        literal(Erratum.SLOWEST_OF_WHOM),
        not literal(Erratum.GIVE_UP_RULE),
        not literal(Erratum.FAILED_ATTEMPTS),
        literal(Erratum.CREDIT),
        not literal(Erratum.COLLISION),
        not literal(Erratum.SECOND_PATIENCE),
        not literal(Erratum.HEARD_ELSEWHERE),
        mission.control_period,
        1 / mission.control_period,
        timing.world_step,
        timing.message_delay,
        mission.deadline,
        HAND_OVERS.index(options.get("hand_over", "shared_max")),
        sum(phase.trials for phase in mission.phases) - 1,
    )


def _refusals(mission: Mission, timing: Timing) -> list[tuple[str, bool]]:
    parameters, options = mission.parameters, mission.environment.options
    width = max(len(mission.able(task)) for task in mission.tasks)
    return [
        ("its environment is no task pool without noise",
         mission.environment.kind != "task_pool" or options.get("noise", 0.0) != 0.0),
        ("robots differ in their parameters", any(robot.parameters for robot in mission.robots.values())),
        ("parameters set by hand differ between tasks", bool(parameters.by_hand_tasks)),
        ("tasks arrive, or wait for others", any(task.after or task.arrives for task in mission.tasks.values())),
        ("trials follow one another too quickly",
         len(mission.phases) > 1
         and 1.5 * mission.control_period + parameters.broadcast_period + 2 * timing.world_step >= TRIAL_PAUSE),
        ("robots join", any(robot.joins for robot in mission.robots.values())),
        ("it schedules faults", bool(mission.faults)),
        ("it is no row of active trials and one adaptive one", not _trains(mission)),
        ("messages take half a control step or longer", timing.message_delay >= mission.control_period / 2),
        ("messages take longer than a step of the world", timing.message_delay >= timing.world_step),
        ("motivation 0 reaches the threshold", parameters.threshold <= 1e-6),
        ("it is too large",
         len(mission.robots) > ROBOTS or len(mission.tasks) > TASKS or parameters.trials > SAMPLES
         or len(mission.tasks) * width * width > PAIRS or len(mission.tasks) * width > PLACES),
    ]  # fmt: skip


def _trains(mission: Mission) -> bool:
    """Whether a mission is some trials of active learning, or none, and the live one."""
    *before, live = mission.phases
    known = all(phase.learning is Learning.ACTIVE and phase.until is None for phase in before)
    return known and live.learning is Learning.ADAPTIVE and live.trials == 1


def new_teams(count: int) -> Memory:
    """Fresh memory for `count` missions at a time."""
    return np.zeros(count, TEAM).view(np.recarray)
