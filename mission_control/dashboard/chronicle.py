"""A mission as it is and as it was: a story with its past, numbered so that viewers can be told what is new. Pure.

The page shows all trials one after the other on one line of time: its instants are seconds since the first trial began, the
pauses between trials included. Each thing that a viewer can see has the version at which it changed last; who has seen the
chronicle up to a version is new to all that is above it. How much is kept of the past is limited, whatever comes.
"""

from collections import Counter, deque
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import msgpack

from lalliance_agents.errors import MessageError
from lalliance_agents.model.events import OCCASIONS, Cause
from lalliance_agents.wire.keys import PRESENCE, Keys
from lalliance_agents.wire.messages import LinkReport, Motivations
from mission_control.dashboard.bars import ENDED, ENDS, Bar
from mission_control.dashboard.losses import Losses
from mission_control.dashboard.series import Series
from mission_control.watch.explain import explain
from mission_control.watch.gaps import Gap
from mission_control.watch.happened import Happened
from mission_control.watch.seen import Attempt, RobotSeen
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import MOST_NAMES, Story
from mission_control.watch.words import printable
from world_server.world import TRIAL_PAUSE

#: Bars, marks and lines that are kept: the latest.
MOST_BARS = 5000
MOST_MARKS = 3000
MOST_TOLD = 3000
#: Instants that are kept of one task's progress or one robot's work.
MOST_INSTANTS = 2000
#: Motivations that are kept in all, of curves and of their factors; and those kept of one robot at least and at most.
MOST_CURVES = 200_000
MOST_FACTORS = 30_000
CURVES_OF_ONE = (300, 6000)
FACTORS_OF_ONE = (100, 1500)
LINKS_OF_ONE = (60, 1500)
MOST_LINKS = 20_000
#: Room for the curves of all robots, as much for their factors and for their links, in bytes; and for those of one robot.
MOST_BYTES = 2**27
BYTES_OF_ONE = (2**17, 2**24)
#: Trials told apart, of which the last stands for further ones; and bars that may still change.
MOST_TRIALS, MOST_UNSETTLED = 4096, 1024
#: Among how many of the latest things that happened the reason for another one is looked for.
RECENT = 200
#: Time between two factors that are kept of one robot, in seconds.
FACTORS_PERIOD = 1.0

#: What the timeline shows as a sign.
_MARKS = frozenset({"takeover", "gone", "present", "complete"})
#: Why an attempt begins that takes a task over.
_TAKEN = frozenset(OCCASIONS) - {Cause.FREE}


@dataclass(slots=True)
class Versioned:
    """What can be seen of one thing: a value, its version, and its past."""

    past: Series[Any]
    version: int = 0


class Chronicle:
    """A mission as it is and as it was.

    Args:
        story: takes the sightings; nobody else hands it any.
        robots: those of the mission file, in its order, with the tasks that each can do; empty if that is not known.
        tasks: the same.
        literal: robots that do not hear teammates on tasks that they cannot do (erratum 17, literal).

    Attributes:
        now: the present instant, in seconds since the first trial began.
        version: grows with each change.
        takeovers: how many there were, by cause.
        heard: whether the world or a robot was heard at all.
        heard_at: when the last message came, on the clock of the sightings.
    """

    def __init__(
        self,
        story: Story,
        robots: dict[str, tuple[str, ...]] | None = None,
        tasks: list[str] | None = None,
        literal: Collection[str] = (),
    ) -> None:
        self.story = story
        self.now = 0.0
        self.version = 1
        self.takeovers: Counter[str] = Counter()
        self.heard_at: float | None = None
        self.trials: dict[int, float] = {}
        self.faults: dict[str, dict[str, Any]] = {}
        self.marks: deque[dict[str, Any]] = deque(maxlen=MOST_MARKS)
        self.told: deque[dict[str, Any]] = deque(maxlen=MOST_TOLD)
        self.figures = Versioned(Series(MOST_INSTANTS))
        self.robots: dict[str, Versioned] = {}
        self.tasks: dict[str, Versioned] = {}
        self.links: dict[str, Versioned] = {}
        self.curves: dict[str, Series[bytes]] = {}
        self.factors: dict[str, Series[bytes]] = {}
        self.bars: dict[int, Bar] = {}
        self.names_version = 1
        self._able = dict(robots or {})
        self._planned = list(tasks or [])
        self._keys = Keys(story.mission)
        self._losses = Losses()
        self._literal = literal
        self._seen_links: dict[str, LinkReport] = {}
        self._seen_motivations: dict[str, Motivations] = {}
        self._factors_due: dict[str, float] = {}
        self._unsettled: dict[int, Bar] = {}
        self._last_attempt: Attempt | None = None
        self._numbers = 0
        self._known = 0
        self._done_by: dict[str, tuple[int, str]] = {}

    def __repr__(self) -> str:
        return f"<Chronicle of {self.story.mission}: {self.now:.1f} s, version {self.version}>"

    @property
    def robot_names(self) -> list[str]:
        """The robots: those of the mission file, then others in the order in which they were heard of."""
        return list(dict.fromkeys([*self._able, *(name for name, _ in self.seen_robots())]))

    @property
    def task_names(self) -> list[str]:
        """The tasks, likewise."""
        return list(dict.fromkeys([*self._planned, *self.story.tasks]))

    def take(self, sighting: Sighting) -> None:
        """Go on with one sighting; what follows from it is seen after the next `settle`."""
        happened = self.story.take(sighting)
        self.heard_at = sighting.now
        self._count(sighting)
        status = self.story.status
        if status is not None and status.trial > 0 and status.trial == self.story.trial:
            self.now = max(self.now, self.place(status.trial, status.elapsed))
        if happened is not None:
            self._note(happened)

    def miss(self, gap: Gap) -> None:
        """Tell of a time in which nothing could be heard, where it began."""
        elapsed = self.story.elapsed(gap.since.mission)
        self._numbers += 1
        self.version += 1
        at = round(self.place(self.story.trial, elapsed), 3)
        entry = {
            "id": self._numbers,
            "from": at,
            "elapsed": round(elapsed, 3),
            "kind": "gap",
            "text": printable(str(gap)),
        }
        self.told.append(entry)

    def place(self, trial: int, elapsed: float) -> float:
        """Where an instant of a trial is on the line of time, in seconds since the first trial began."""
        trial = max(trial, 1)
        if trial not in self.trials and len(self.trials) >= MOST_TRIALS:
            trial = next(reversed(self.trials))
        if trial not in self.trials:
            later = [began for number, began in self.trials.items() if number > trial]
            self.trials[trial] = min(later) if later else self.now + TRIAL_PAUSE if self.trials else 0.0
            self.version += 1
            self.names_version = self.version
        return self.trials[trial] + elapsed

    def settle(self) -> None:
        """Take over what has changed since the last time; a few times a second."""
        self.version += 1
        if (count := len(self.story.robots) + len(self.story.tasks)) != self._known:
            self._known = count
            self.names_version = self.version
        self._settle_bars()
        self._settle_tasks()
        for name, seen in self.seen_robots():
            self._put(self.robots, name, (seen.present, seen.task), MOST_INSTANTS)
            if seen.link is not None and seen.link is not self._seen_links.get(name):
                self._settle_links(name, seen.link)
            if seen.motivations is not None and seen.motivations is not self._seen_motivations.get(name):
                self._settle_motivations(name, seen.motivations)
        if self.figures.past.change(self.now, self._figures()):
            self.figures.version = self.version

    def seen_robots(self) -> Iterator[tuple[str, RobotSeen]]:
        """Whoever was heard of and can be a robot."""
        return ((name, seen) for name, seen in self.story.robots.items() if not name.startswith("@"))

    def _count(self, sighting: Sighting) -> None:
        if "/activity/" not in sighting.key and "/heartbeat/" not in sighting.key:
            return
        try:
            key = self._keys.parse(sighting.key)
        except MessageError:
            return
        if key.kind in PRESENCE and key.robot in self.story.robots:
            self._losses.say(key.robot, key.task if key.task in self.story.tasks else None)

    def _put(self, things: dict[str, Versioned], name: str, value: Any, most: int) -> None:
        thing = things.get(name)
        if thing is None:
            thing = things[name] = Versioned(Series(most, self._room()))
        if thing.past.change(self.now, value):
            thing.version = self.version

    def _note(self, one: Happened) -> None:
        trial, next_one = one.trial or self.story.trial, self.story.trial + 1
        is_made_up = one.made is not None and self.story.status is not None and trial > next_one
        at = self.place(next_one if is_made_up else trial, one.at)
        self.now = max(self.now, at)
        self._numbers += 1
        self.version += 1
        text = printable(_in_words(one))
        entry = {"id": self._numbers, "from": round(at, 3), "elapsed": round(one.at, 3), "kind": one.kind, "text": text}
        if one.kind == "takeover":
            self.takeovers[one.cause if one.cause in _TAKEN else "unknown"] += 1
        elif one.kind == "complete" and one.task is not None and one.robot is not None:
            self._done_by[one.task] = (one.trial, one.robot)
            if len(self._done_by) > MOST_NAMES:
                del self._done_by[next(iter(self._done_by))]
        elif one.kind in {"fault", "fault_over"}:
            self._note_fault(one, at)
        elif one.kind in {"trial", "trial_over"}:
            for fault in self.faults.values():
                self._end_fault(fault, at)
        self.told.append(entry)
        if one.kind in _MARKS:
            about = {"at": entry["from"], "robot": one.robot, "task": one.task, "other": one.other}
            why = self._why(one.robot or "", one.task or "") if one.kind == "takeover" else ""
            self.marks.append({**entry, **about, "why": why})

    def _note_fault(self, one: Happened, at: float) -> None:
        name = printable(one.fault or one.text, 60)
        if one.kind == "fault_over":
            if name in self.faults:
                self._end_fault(self.faults[name], at)
            return
        if len(self.faults) >= MOST_MARKS:
            self.faults.pop(next(iter(self.faults)))
        text = printable(one.text.removeprefix("fault: "))
        self.faults[name] = {
            "id": self._numbers, "name": name, "text": text, "robot": one.robot, "from": round(at, 3), "to": None,
            "since": round(one.at, 3), "version": self.version,
        }  # fmt: skip

    def _end_fault(self, fault: dict[str, Any], at: float) -> None:
        if fault["to"] is None:
            fault["to"], fault["version"] = round(at, 3), self.version

    def _settle_bars(self) -> None:
        fresh: list[Attempt] = []
        for attempt in reversed(self.story.attempts):
            if attempt is self._last_attempt:
                break
            fresh.append(attempt)
        for attempt in reversed(fresh):
            self._last_attempt = attempt
            self._numbers += 1
            bar = self.bars[self._numbers] = self._unsettled[self._numbers] = Bar(self._numbers, attempt)
        while len(self.bars) > MOST_BARS:
            self._unsettled.pop(gone := next(iter(self.bars)), None)
            del self.bars[gone]
        while len(self._unsettled) > MOST_UNSETTLED:
            del self._unsettled[next(iter(self._unsettled))]
        for bar in list(self._unsettled.values()):
            self._settle_bar(bar)

    def _settle_bar(self, bar: Bar) -> None:
        attempt = bar.attempt
        if attempt.began is not None and bar.why is None:
            bar.why = self._why(attempt.robot, attempt.task)
        shown = self._shown(bar)
        if shown != bar.shown:
            bar.shown, bar.version = shown, self.version
            # The newest changes are at the end.
            self.bars[bar.number] = self.bars.pop(bar.number)
        if attempt.until is not None and (attempt.ended is not None or attempt.trial != self.story.trial):
            del self._unsettled[bar.number]

    def _why(self, robot: str, task: str) -> str:
        """The reasons for which a robot started a task a moment ago; empty if that was not seen."""
        for one in islice(reversed(self.story.happened), RECENT):
            if one.kind == "activate" and one.robot == robot and one.task == task:
                return printable(_in_words(one))
        return ""

    def _shown(self, bar: Bar) -> dict[str, Any]:
        attempt = bar.attempt
        until = None if attempt.until is None else round(self.place(attempt.trial, attempt.until), 3)
        ended = attempt.ended
        if until is not None and self._done_by.get(attempt.task) == (attempt.trial, attempt.robot) and ended != "lost":
            ended = "sensed"
        end = "" if until is None else ENDS.get(ended or "", "left")
        return {
            "id": bar.number,
            "robot": attempt.robot,
            "task": attempt.task,
            "from": round(self.place(attempt.trial, attempt.since), 3),
            "since": round(attempt.since, 3),
            "to": until,
            "end": end,
            "taken": attempt.began in _TAKEN,
            "ended": ENDED.get(ended or "", printable(f"ended: {ended or 'why is not known'}", 80)),
            "why": bar.why or "",
        }

    def _settle_tasks(self) -> None:
        for name, task in self.story.tasks.items():
            at, by = None, None
            if task.complete:
                at = task.completed_at
                trial, robot = self._done_by.get(name, (0, None))
                by = robot if trial == self.story.trial else None
            self._put(
                self.tasks, name, (round(task.progress, 2), task.applicable, task.complete, at, by), MOST_INSTANTS
            )

    def _settle_links(self, name: str, report: LinkReport) -> None:
        self._seen_links[name] = report
        able = self._able or {robot: seen.tasks for robot, seen in self.seen_robots()}
        mates = {mate: one for mate, one in report.teammates.items() if mate in self._able or mate in self.story.robots}
        lost = self._losses.report(name, mates, able, elsewhere=name not in self._literal)
        row = {
            mate: (one.received, _rounded(lost.get(mate)), _rounded(one.silence), one.lost_for is not None)
            for mate, one in mates.items()
        }
        self._put(self.links, name, msgpack.packb(row), self._share(MOST_LINKS, LINKS_OF_ONE))

    def _settle_motivations(self, name: str, motivations: Motivations) -> None:
        self._seen_motivations[name] = motivations
        if name not in self.curves:
            self.curves[name] = Series(self._share(MOST_CURVES, CURVES_OF_ONE), self._room())
            self.factors[name] = Series(self._share(MOST_FACTORS, FACTORS_OF_ONE), self._room())
        values = {task: _value(factors.get("motivation")) for task, factors in motivations.sets.items()}
        self.curves[name].add(self.now, msgpack.packb(values))
        # A trial may begin before the instant at which factors are due.
        if not 0 <= self._factors_due.get(name, 0.0) - self.now <= FACTORS_PERIOD:
            self._factors_due[name] = self.now + FACTORS_PERIOD
            self.factors[name].add(self.now, msgpack.packb(motivations.sets))

    def _share(self, most: int, limits: tuple[int, int]) -> int:
        return min(max(most // max(len(self.story.robots), len(self._able), 1), limits[0]), limits[1])

    def _room(self) -> int:
        """Room for the past of one robot, in bytes."""
        return self._share(MOST_BYTES, BYTES_OF_ONE)

    def _figures(self) -> dict[str, Any]:
        story, status = self.story, self.story.status
        links = [seen.link for seen in story.robots.values() if seen.link is not None]
        read = sum(count for (_, verdict), count in story.messages.items() if verdict == "read")
        return {
            "stage": status.mission if status else "waiting",
            "learning": status.learning if status else "",
            "trials": status.trials if status else 1,
            "messages": read,
            "dropped": sum(link.dropped.get(reason, 0) for link in links for reason in link.dropped),
            "periods": sum(link.ticks for link in links),
            "missed": sum(link.missed for link in links),
        }

    def latest_factors(self, robot: str) -> dict[str, Any]:
        """The factors of a robot's motivations as last heard."""
        motivations = self._seen_motivations.get(robot)
        return {} if motivations is None else dict(motivations.sets)

    def changed_bars(self, since: int) -> Iterator[dict[str, Any]]:
        """The bars that changed after version `since`, the newest change first."""
        for bar in reversed(self.bars.values()):
            if bar.version <= since:
                return
            yield bar.shown


def _in_words(one: Happened) -> str:
    """What happened, of a decision with its reasons; the instant stands beside it."""
    return one.text if one.made is None else explain(one.made, one.at).replace(f" at {one.at:.1f} s:", ":", 1)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 2)


def _value(value: object) -> float:
    return round(float(value), 3) if isinstance(value, int | float) else 0.0
