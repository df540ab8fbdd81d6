"""Which missions must complete, and by when: the conditions of `MODEL.md`, "What must hold" (4), made exact.

A mission is *promised* where

- every task has a *sound* robot: one that can do it and that is not for good dead, hanging, blind or stuck at it (a robot
  slower than `AS_GOOD_AS_STUCK` counts as stuck), and in trials before the live one, where faults do not happen, a robot that
  does not join later;
- nobody who lives is stuck for good at what another can do; or else failures teach: L-ALLIANCE, an ordering in which a
  failed task is wanted less, delays that differ, no attempt that is too short to be told from a collision, or to outlast
  the patience of teammates, no rule of links for good, by which teammates might not learn of it;
- an attempt can be long enough where work starts from zero each time: its limits are long (by hand), or grow with each failure
  (L-ALLIANCE), which must not be too short either;
- the Appendix is read as mended (the second patience may be read either way).

Then each task is worked on again and again until it is done, and the bound is the sum, over all tasks, of the attempts that
this takes in the worst case, one after the other, with the longest pause between two of them. It is generous: it supposes
that one robot at a time works, and that the slowest does.
"""

import math
from dataclasses import dataclass

from lalliance_agents.config import Mission
from lalliance_agents.fault_checks import ends_work
from lalliance_agents.faults import (
    Blind,
    Crash,
    Fault,
    Hang,
    LinkFault,
    Partition,
    RadioFault,
    Slow,
    Stuck,
    robot_of,
)
from lalliance_agents.model.parameters import Architecture, Erratum, Learning, Ordering, Parameters, Strategy
from world_server.environments.box_pushing import BoxPushing

#: A robot slowed for good by more than this is as good as stuck.
AS_GOOD_AS_STUCK = 20.0
#: By how much limits of attempts must grow from one to the next where work restarts.
LEAST_GROWTH = 1.5
#: A robot that gives up before so many of its own times is back at its task, bored, before teammates that are patient for as
#: long (strategy III) take it to have left: they hear it "on the task" for tau after it has.
OUTLASTS = 1.1
#: What comes between a fault's end and the team being as if it had not been: start-up, presence, refreshed senses; in seconds.
RECOVERY = 3.0
#: The bound is this many times the sum of all tasks, and these seconds more.
MARGIN, MARGIN_SECONDS = 1.0, 10.0

#: Orderings in which a failed attempt makes its task less wanted.
_LEARNING_ORDERS = {Ordering.DERIVED, Ordering.MODIFIED_SHORTEST_FIRST}


@dataclass(frozen=True, slots=True)
class Promise:
    """Whether a mission must complete."""

    seconds: float | None
    """How long each of its trials may take; None: it need not complete."""
    why: str
    """What it is promised by, or what stands against it, in a few words."""


def promise(mission: Mission) -> Promise:
    """Whether `mission` must complete, and by when."""
    against = _literal(mission) or _without_a_sound_robot(mission) or _restarts_in_vain(mission)
    stuck = [fault for fault in mission.faults if isinstance(fault, Stuck) and _is_stuck_for_good(mission, fault)]
    if not against and stuck:
        against = _learns_nothing(mission)
    if against:
        return Promise(None, against)
    tasks = sum(_Effort(mission, task).seconds(hindered=bool(stuck)) for task in mission.tasks)
    seconds = settled_after(mission) + MARGIN * tasks + MARGIN_SECONDS
    return Promise(seconds, "failures teach" if stuck else "all progress")


def settled_after(mission: Mission) -> float:
    """When the last fault that ends has ended, the last task arrived and the last robot joined, in seconds."""
    instants = [fault.at if fault.end == math.inf else fault.end for fault in mission.faults]
    instants += [task.arrives for task in mission.tasks.values()]
    instants += [robot.joins for robot in mission.robots.values()]
    return max(instants) + RECOVERY if any(instants) else RECOVERY


def strikes_for_good(fault: Fault, task: str) -> bool:
    """Whether its robot is of no use for `task` from some time on."""
    too_slow = isinstance(fault, Slow) and fault.end == math.inf and fault.factor > AS_GOOD_AS_STUCK
    return too_slow or ends_work(fault, task)


def sound(mission: Mission, task: str) -> list[str]:
    """The robots that can do `task` and are not struck for good."""
    struck = {robot_of(fault) for fault in mission.faults if strikes_for_good(fault, task)}
    return [robot for robot in mission.able(task) if robot not in struck]


def _literal(mission: Mission) -> str:
    for robot in mission.robots:
        for erratum in Erratum:
            if erratum is not Erratum.SECOND_PATIENCE and mission.parameters_of(robot).is_literal(erratum):
                return f"{erratum} is read literally"
    return ""


def _without_a_sound_robot(mission: Mission) -> str:
    training = sum(phase.trials for phase in mission.phases) > 1
    for task in mission.tasks:
        if not sound(mission, task):
            return "a task keeps no sound robot"
        if training and all(mission.robots[robot].joins > 0 for robot in mission.able(task)):
            return "a task has no robot in the first trial"
    return ""


def _restarts_in_vain(mission: Mission) -> str:
    if mission.environment.options.get("hand_over") != "restart":
        return ""
    for robot, spec in mission.robots.items():
        own = mission.parameters_of(robot)
        for task in spec.tasks:
            if own.architecture is Architecture.ALLIANCE:
                by_hand = own.for_set(task)
                if min(by_hand.yield_time, by_hand.give_up_time) <= _need(mission, robot, task) * 1.1 + 1.0:
                    return "an attempt by hand is too short for its task"
            elif _growth(own) < LEAST_GROWTH:
                return "attempts that start from zero hardly get longer"
            elif _looks_like_a_collision(mission, robot):
                return "attempts that start from zero look like collisions"
    return ""


def _growth(own: Parameters) -> float:
    """By how much an attempt may last longer than the one before: that one ended after psi or after lambda."""
    return own.failure_factor * min(own.give_up_factor, 1.0)


def _is_stuck_for_good(mission: Mission, fault: Stuck) -> bool:
    gone = any(
        isinstance(one, Crash | Hang) and one.robot == fault.robot and one.end == math.inf for one in mission.faults
    )
    return fault.end == math.inf and not gone


def _learns_nothing(mission: Mission) -> str:
    """Why robots may go on failing for ever at what another could do."""
    if mission.live.learning is Learning.ACTIVE:
        return "stuck in active learning, in which nobody gives up"
    if any(isinstance(fault, LinkFault | Partition | RadioFault) and fault.end == math.inf for fault in mission.faults):
        return "stuck, and teammates may not hear of it"
    own = [mission.parameters_of(robot) for robot in mission.robots]
    if any(one.strategy is Strategy.III for one in own) and any(one.give_up_factor < OUTLASTS for one in own):
        return "stuck, and giving up before teammates lose their patience"
    return next(filter(None, (_fails_in_vain(mission, robot) for robot in mission.robots)), "")


def _fails_in_vain(mission: Mission, robot: str) -> str:
    own = mission.parameters_of(robot)
    if own.architecture is not Architecture.L_ALLIANCE or own.ordering not in _LEARNING_ORDERS:
        return "stuck, and failing makes nothing less wanted"
    if _growth(own) < LEAST_GROWTH:
        return "stuck, and failing teaches too little"
    if own.max_delay < 2 * own.min_delay:
        return "stuck, and all tasks are wanted alike"
    if _looks_like_a_collision(mission, robot):
        return "stuck, and attempts look like collisions"
    return ""


def _looks_like_a_collision(mission: Mission, robot: str) -> bool:
    """Whether attempts may be so short that teammates take them for collisions, and learn nothing from them."""
    own = mission.parameters_of(robot)
    noise = float(mission.environment.options.get("noise", 0.0))
    tasks = mission.robots[robot].tasks
    times = [mission.robots[mate].tasks[task] * (1 - noise) for task in tasks for mate in mission.able(task)]
    return min(own.initial_task_time, *times) * min(own.give_up_factor, 1.0) <= 1.1 * own.effective_collision_window


def _need(mission: Mission, robot: str, task: str) -> float:
    """The longest that `robot` may need for `task`, in seconds."""
    noise = float(mission.environment.options.get("noise", 0.0))
    time = mission.robots[robot].tasks[task] * (1 + noise)
    for fault in mission.faults:
        if isinstance(fault, Slow) and fault.robot == robot and fault.factor <= AS_GOOD_AS_STUCK:
            time *= fault.factor
    return time


class _Effort:
    """How long one task may take from the moment at which it can be worked on.

    Args:
        mission: the mission.
        task: which task of it.
    """

    def __init__(self, mission: Mission, task: str) -> None:
        self._mission = mission
        self._task = task
        self._able = mission.able(task)
        self._restarts = mission.environment.options.get("hand_over") == "restart"
        self._need = max(_need(mission, robot, task) for robot in self._able)

    def seconds(self, *, hindered: bool) -> float:
        """The bound, in seconds.

        Args:
            hindered: whether robots may be stuck for good at it: then each failure must double what is expected until another
                task, or another robot, comes first.
        """
        shortest = min(self._shortest_attempt(robot) for robot in self._able)
        pause = max(self._longest_pause(robot) for robot in self._mission.robots)
        if hindered:
            rounds = 2 * len(self._mission.tasks) * len(self._mission.robots)
            return rounds * (4 * self._need + pause)
        if not self._restarts:
            return 2 * self._need + (math.ceil(self._need / shortest) + 1 + self._turns()) * pause
        growth = min(_growth(self._mission.parameters_of(robot)) for robot in self._able)
        growth = max(growth, LEAST_GROWTH)  # by hand nothing grows, and the first attempt is long enough
        attempts = math.ceil(max(math.log(self._need / shortest) / math.log(growth), 0.0)) + 2
        return len(self._able) * attempts * (2 * growth * self._need + pause)

    def _turns(self) -> int:
        """How often a lone robot must leave the task because it does not apply just now: at a box, to push its other end.

        Each of its pushes carries an end by at least half the slack (`box_pushing`).
        """
        if self._mission.environment.kind != "box_pushing":
            return 0
        return math.ceil(2 / BoxPushing.Options.model_validate(self._mission.environment.options).slack)

    def _shortest_attempt(self, robot: str) -> float:
        """Psi and lambda are no shorter than this, in seconds."""
        own = self._mission.parameters_of(robot)
        if own.architecture is Architecture.ALLIANCE:
            by_hand = own.for_set(self._task)
            return min(by_hand.yield_time, by_hand.give_up_time)
        noise = float(self._mission.environment.options.get("noise", 0.0))
        times = [self._mission.robots[mate].tasks[self._task] * (1 - noise) for mate in self._able]
        return min(own.give_up_factor, 1.0) * min([own.initial_task_time, *times])

    def _longest_pause(self, robot: str) -> float:
        """From the end of one attempt to the beginning of the next: tau, boredom, patience and delay, in seconds."""
        own = self._mission.parameters_of(robot)
        late = [fault.delay for fault in self._mission.faults if isinstance(fault, Blind) and fault.delay is not None]
        steps = 5 * self._mission.control_period + 2.0 + sum(late)
        if own.architecture is Architecture.ALLIANCE:
            sets = [own.for_set(task) for task in self._mission.tasks]
            return own.silence_timeout + steps + max(one.patience + own.threshold / one.fast_rate for one in sets)
        idle = own.boredom_threshold / own.effective_boredom_rate + own.max_delay
        return own.silence_timeout + steps + idle + max(own.initial_task_time, 2 * self._need)
