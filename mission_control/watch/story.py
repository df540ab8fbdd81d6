"""A mission as seen so far, put together from sightings, live or of a recording. Pure.

A story takes one sighting after the other and believes the freshest message of each stream, as robots do. What it keeps of
the past is limited, whatever comes: the latest of all that happened and of all attempts. Instants are seconds since the trial
began, of the world's clock as far as it is known; only what is said to be of the onlooker's clock is of that.

Decisions say when an attempt begins and ends and why; where one was missed, what the robot announces tells that it is on a
task, or idle, and its presence that it is not there. An event or a decision that comes after a newer one, as it may after a
time in which nothing could be heard, is one of those that happened; what holds now is not changed by it.
"""

from collections import Counter, OrderedDict, deque
from collections.abc import Container
from dataclasses import replace
from typing import Any

from lalliance_agents.errors import MessageError
from lalliance_agents.model.events import Verb
from lalliance_agents.wire.freshness import Freshness
from lalliance_agents.wire.keys import Key, Keys, Kind
from lalliance_agents.wire.messages import (
    Activity,
    ChaosRules,
    DecisionMade,
    Event,
    Heartbeat,
    Hello,
    LinkReport,
    Message,
    Motivations,
    Status,
    TaskState,
)
from mission_control.watch.happened import Happened, of_decision, of_event
from mission_control.watch.seen import LOST, NEW_TRIAL, OVER, Attempt, RobotSeen, TaskSeen, number
from mission_control.watch.sighting import Sighting, read

#: Kept of what happened, and of attempts: the latest.
MOST_HAPPENED = 20_000
MOST_ATTEMPTS = 20_000
#: What all that happened may have taken on the bus, in bytes.
HEAVIEST_HAPPENED = 2**26
#: Robots, tasks and faults told apart: whoever makes up names cannot fill the memory.
MOST_NAMES = 1024
#: Attempts of one robot that may go on at a time.
MOST_AT_ONCE = 64
#: How far what a robot says may be ahead of the world's time, in seconds: a fast mission can be ahead of who looks on.
MOST_AHEAD = 600.0


class Story:
    """A mission as seen so far.

    Args:
        mission: its name.

    Attributes:
        status: what the world last said of the mission.
        rules: the link rules in force, as the world last said.
        robots: by name, in the order in which they were first heard of.
        tasks: the same.
        happened: events and decisions, as they came.
        attempts: in the order in which they began.
        faults: those in force, by name, in words.
        has_launcher: whether somebody is there who holds the robots' processes.
        messages: how many came, by kind and by what became of them: `read`, `stale` (older than what came before),
            `late` (an event or a decision from before, that was not known), `stranger` (of a robot too many), or why they
            could not be read.
    """

    def __init__(self, mission: str) -> None:
        self.mission = mission
        self.status: Status | None = None
        self.rules: ChaosRules | None = None
        self.robots: dict[str, RobotSeen] = {}
        self.tasks: dict[str, TaskSeen] = {}
        self.happened: deque[Happened] = deque()
        self.attempts: deque[Attempt] = deque(maxlen=MOST_ATTEMPTS)
        self.faults: dict[str, str] = {}
        self.messages: Counter[tuple[str, str]] = Counter()
        self.trial = 0
        self.has_launcher = False
        self._keys = Keys(mission)
        self._freshness = Freshness()
        #: Events and decisions that came, by sender, life and number.
        self._told: OrderedDict[tuple[str, int, int], None] = OrderedDict()
        #: Of all that happened, in bytes.
        self._sizes: deque[int] = deque()
        self._size = 0
        self._lead = 0.0
        self._latest = 0.0
        self._has_world = False

    def __repr__(self) -> str:
        stage = self.status.mission if self.status else "not heard of"
        return f"<Story of {self.mission}: {stage}, {len(self.robots)} robots, {len(self.happened)} happened>"

    def elapsed(self, now: float) -> float:
        """Time since the trial began, in seconds, at the instant `now` of the onlooker's clock."""
        return max(now + self._lead, 0.0)

    def takeovers(self) -> list[Happened]:
        """Who took which task from whom and why, as the world told it."""
        return [one for one in self.happened if one.kind == "takeover"]

    def decisions(self, robot: str | None = None, task: str | None = None) -> list[Happened]:
        """What the robots decided: all, or one of them, or about one task."""
        return [
            one
            for one in self.happened
            if one.made is not None and robot in {None, one.robot} and task in {None, one.task}
        ]

    def take(self, sighting: Sighting) -> Happened | None:
        """Go on with one sighting; what happened by it, if anything."""
        kind = "unknown"
        try:
            kind = self._keys.parse(sighting.key).kind.name.lower()
            key, message = read(sighting, self._keys)
        except MessageError as error:
            self.messages[kind, error.reason] += 1
            return None
        if message is None:
            return self._presence(key, not sighting.gone, sighting.now)
        if self._freshness.overtaken(key.stream, message.incarnation, message.seq, sighting.now):
            late = self._late(message, len(sighting.payload))
            self.messages[kind, "late" if late else "stale"] += 1
            return late
        if key.robot is not None and self._robot(key.robot) is None:
            self.messages[kind, "stranger"] += 1
            return None
        self.messages[kind, "read"] += 1
        if isinstance(message, TaskState) and key.task is not None:
            self._task_state(key.task, message)
            return None
        return self.hear(message, sighting.now, len(sighting.payload))

    def hear(self, message: Message, now: float, size: int = 0) -> Happened | None:
        """Go on with a checked, fresh message of `size` bytes that came at `now` on the onlooker's clock; what happened."""
        if message.sender in self.robots:
            seen = self.robots[message.sender]
            seen.incarnation = message.incarnation
            # The world gives decisions again, also those of robots that are dead.
            if not isinstance(message, DecisionMade):
                seen.heard_at = now
        match message:
            case Status():
                self._heard_status(message, now)
            case ChaosRules():
                self.rules = message
            case Event():
                self._is_told(message)
                return self._heard_event(of_event(message), size)
            case DecisionMade():
                self._is_told(message)
                return self._decided(message, now, size)
            case _:
                self._heard_robot(message, now)
        return None

    def _late(self, message: Message, size: int) -> Happened | None:
        """What happened, if this tells of it, late; None if that is known or cannot be placed."""
        if not isinstance(message, Event | DecisionMade) or message.elapsed is None or self._is_told(message):
            return None
        one = of_event(message) if isinstance(message, Event) else of_decision(message, message.elapsed)
        return None if one is None else self._note(one, size)

    def _is_told(self, message: Event | DecisionMade) -> bool:
        """Whether this one came before; it has come now."""
        number = (message.sender, message.incarnation, message.seq)
        is_told = number in self._told
        self._told[number] = None
        if len(self._told) > MOST_HAPPENED:
            self._told.popitem(last=False)
        return is_told

    def _robot(self, name: str) -> RobotSeen | None:
        own = self.status.robots if self.status is not None else {}
        if name not in self.robots and _has_room(self.robots, name, own):
            self.robots[name] = RobotSeen(name)
        return self.robots.get(name)

    def _task(self, name: str) -> TaskSeen | None:
        own = self.status.tasks if self.status is not None else {}
        if name not in self.tasks and _has_room(self.tasks, name, own):
            self.tasks[name] = TaskSeen(name)
        return self.tasks.get(name)

    def _presence(self, key: Key, present: bool, now: float) -> Happened | None:
        if key.kind is Kind.LAUNCHER:
            self.has_launcher = present
        seen = self._robot(key.robot) if key.kind is Kind.ALIVE and key.robot is not None else None
        if seen is None or seen.present == present:
            return None
        return self._came_or_went(seen, present, self.elapsed(now))

    def _came_or_went(self, seen: RobotSeen, present: bool, at: float) -> Happened | None:
        was, seen.present = seen.present, present
        if not present:
            for attempt in list(seen.attempts.values()):
                self._end(seen, attempt, at, LOST)
        # Where there is a world, it tells.
        if self._has_world or was is None:
            return None
        words = f"{seen.name} is {'there' if present else 'gone'}"
        return self._note(Happened(at, "present" if present else "gone", words, seen.name, trial=self.trial))

    def _task_state(self, name: str, state: TaskState) -> None:
        task = self._task(name)
        if task is not None and state.trial >= self.trial:
            task.applicable, task.complete, task.progress = state.applicable, state.complete, state.progress

    def _heard_status(self, status: Status, now: float) -> None:
        self.status = status
        self._lead = status.elapsed - now
        self._enter(status.trial, status.elapsed)
        for name, facts in status.tasks.items():
            task = self._task(name)
            if task is not None:
                task.applicable, task.complete = bool(facts.get("applicable")), bool(facts.get("complete"))
                task.progress = number(facts.get("progress"))
        for name, facts in status.robots.items():
            seen = self._robot(name)
            if seen is not None and seen.present != facts.get("present"):
                self._came_or_went(seen, bool(facts.get("present")), status.elapsed)

    def _enter(self, trial: int, at: float) -> None:
        """The world says which trial it is, and how late."""
        self._has_world = True
        if trial != self.trial:
            self._begin_trial(trial)
        self._latest = max(self._latest, at)

    def _is_now(self, trial: int) -> bool:
        """Whether what a robot says is about the present trial; where there is no world, robots say which one that is."""
        if trial > self.trial and not self._has_world:
            self._begin_trial(trial)
        return trial == self.trial

    def _begin_trial(self, trial: int) -> None:
        self._end_all(NEW_TRIAL)
        self.trial, self._latest = trial, 0.0
        for task in self.tasks.values():
            task.applicable, task.complete, task.progress, task.completed_at = False, False, 0.0, None

    def _heard_event(self, one: Happened | None, size: int) -> Happened | None:
        if one is None:
            return None
        self._enter(one.trial, one.at)
        seen = self.robots.get(one.robot or "")
        if one.kind in {"trial", "trial_over"}:
            self.faults.clear()
        elif one.kind == "fault":
            self.faults[one.fault or one.text] = one.text.removeprefix("fault: ")
            if len(self.faults) > MOST_NAMES:
                del self.faults[next(iter(self.faults))]
        elif one.kind == "fault_over":
            self.faults.pop(one.fault or "", None)
        elif one.kind == "complete" and one.task is not None and (task := self._task(one.task)) is not None:
            task.complete, task.progress, task.completed_at = True, 1.0, one.at
        elif one.kind in {"present", "gone"} and seen is not None:
            self._came_or_went(seen, one.kind == "present", one.at)
        elif one.kind == "end":
            self._end_all(OVER)
        return self._note(one, size)

    def _note(self, one: Happened, size: int = 0) -> Happened:
        self.happened.append(one)
        self._sizes.append(size)
        self._size += size
        while len(self.happened) > MOST_HAPPENED or self._size > HEAVIEST_HAPPENED:
            self.happened.popleft()
            self._size -= self._sizes.popleft()
        return one

    def _decided(self, made: DecisionMade, now: float, size: int) -> Happened | None:
        one = of_decision(made, self.elapsed(now))
        if self.status is not None and made.trial == self.trial and one.at > self.elapsed(now) + MOST_AHEAD:
            one = replace(one, at=self.elapsed(now))
        seen = self._robot(made.sender)
        if seen is not None and (threshold := number(made.terms.get("threshold"))) > 0:
            seen.threshold = threshold
        if seen is not None and self._is_now(made.trial):
            if made.verb == Verb.ACTIVATE:
                attempt = self._begin(seen, made.task, one.at)
                attempt.since, attempt.began = one.at, made.cause
            elif made.task in seen.attempts:
                self._end(seen, seen.attempts[made.task], one.at, made.cause)
            elif seen.last is not None and seen.last.task == made.task and seen.last.ended is None:
                seen.last.until, seen.last.ended = one.at, made.cause
        return self._note(one, size)

    def _heard_robot(self, message: Message, now: float) -> None:
        # The world speaks of bodies too, and is none.
        seen = None if message.sender.startswith("@") else self._robot(message.sender)
        if seen is None:
            return
        match message:
            case Hello():
                seen.tasks = tuple(message.tasks[:MOST_NAMES])
            case Motivations():
                seen.motivations = message
            case LinkReport():
                seen.link = message
            case Activity() | Heartbeat() if self._has_world and self.status is None:
                # What the past told ends before the present, and only the world's status says how late that is.
                pass
            case Activity() if self._is_now(message.trial):
                self._begin(seen, message.task, max(self.elapsed(now) - message.active_for, 0.0))
            case Heartbeat() if self._is_now(message.trial):
                for attempt in list(seen.attempts.values()):
                    self._end(seen, attempt, self.elapsed(now), None)
            case _:
                pass

    def _begin(self, seen: RobotSeen, task: str, at: float) -> Attempt:
        """The attempt that goes on of this robot at this task, begun if there is none."""
        attempt = seen.attempts.get(task)
        if attempt is None:
            if len(seen.attempts) >= MOST_AT_ONCE:
                self._end(seen, next(iter(seen.attempts.values())), at, None)
            attempt = seen.attempts[task] = Attempt(seen.name, task, self.trial, at)
            self.attempts.append(attempt)
        return attempt

    @staticmethod
    def _end(seen: RobotSeen, attempt: Attempt, at: float, why: str | None) -> None:
        attempt.until, attempt.ended = max(at, attempt.since), why
        seen.last = seen.attempts.pop(attempt.task, None)

    def _end_all(self, why: str) -> None:
        for seen in self.robots.values():
            for attempt in list(seen.attempts.values()):
                self._end(seen, attempt, self._latest, why)


def _has_room(known: dict[str, Any], name: str, own: Container[str]) -> bool:
    """Whether `name` can be told apart as well; what the world calls its own takes the place of what was made up."""
    if len(known) < MOST_NAMES:
        return True
    stranger = next((one for one in known if one not in own), None) if name in own else None
    if stranger is not None:
        del known[stranger]
    return stranger is not None
