"""The faults of the live trial: those that the mission schedules and those that are injected, and whether each really happened.

A fault waits for its time, is in force, and is over. What it does is made in four places. The body: `pace` says how fast a
robot's body works. The links: `rules` and `blind` go to every bus, and the buses report what they did. The process: orders go
to whoever holds the robots' processes; an order stands until it has been confirmed, so whoever carries it out may miss it a
few times, and must not carry it out twice: its number tells. A fault has fired only when its effect was seen: the process gone
or reported as stopped, a message touched, a working body held up.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.fault_checks import contradiction
from lalliance_agents.faults import Blind, Crash, Fault, Hang, Slow, Stuck, describe, kind_of, robot_of
from lalliance_agents.model.equations import reaches
from lalliance_agents.wire.messages import Blindness, Effect, LinkRule
from world_server.rules import link_rules


class Deed(StrEnum):
    """What whoever holds the processes is asked to do."""

    KILL = "kill"
    START = "start"
    HANG = "hang"
    RESUME = "resume"


@dataclass(frozen=True, slots=True)
class Order:
    """A deed at one robot's process."""

    number: int
    deed: Deed
    robot: str
    because: str


class State(StrEnum):
    """How far a fault is."""

    WAITING = "waiting"
    ON = "on"
    OVER = "over"


@dataclass(slots=True)
class Entry:
    """One fault and what became of it."""

    name: str
    fault: Fault
    begins: float
    ends: float
    state: State = State.WAITING
    count: int = 0
    fired_at: float | None = None
    order: Order | None = None
    """What is yet to be confirmed."""

    @property
    def must_die(self) -> bool:
        """Whether a process is to be killed and was not seen to end yet."""
        return self.order is not None and self.order.deed is Deed.KILL

    def fire(self, elapsed: float, count: int = 1) -> None:
        """Its effect was seen, `count` times more."""
        self.count += count
        if self.fired_at is None:
            self.fired_at = elapsed

    def report(self) -> dict[str, Any]:
        """The fault as plain data."""
        return {
            "name": self.name,
            "kind": kind_of(self.fault),
            "robot": robot_of(self.fault),
            "text": describe(self.fault),
            "at": self.begins,
            "until": None if self.ends == math.inf else self.ends,
            "state": self.state.value,
            "fired": self.fired_at is not None,
            "fired_at": self.fired_at,
            "count": self.count,
        }


@dataclass(frozen=True, slots=True)
class Change:
    """A fault began or ended."""

    entry: Entry
    on: bool


class Failures:
    """Faults of the live trial, and the robots that join it late. Instants are seconds since that trial began.

    Args:
        mission: whose faults.
    """

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        self.entries: list[Entry] = []
        self._numbers = 0
        self._joins = {name: spec.joins for name, spec in mission.robots.items() if spec.joins > 0}
        self._joining = {
            name: self._order(Deed.START, name, f"joins at {joins:g} s") for name, joins in self._joins.items()
        }
        for fault in mission.faults:
            self._add(fault, fault.at, fault.end)

    def _add(self, fault: Fault, begins: float, ends: float) -> Entry:
        entry = Entry(f"{len(self.entries) + 1}-{kind_of(fault)}", fault, begins, ends)
        self.entries.append(entry)
        return entry

    def _order(self, deed: Deed, robot: str, because: str) -> Order:
        self._numbers += 1
        return Order(self._numbers, deed, robot, because)

    def next_instant(self, elapsed: float) -> float:
        """The next instant after `elapsed` at which a fault begins or ends; infinite if none does."""
        due = [entry.begins for entry in self.entries if entry.state is State.WAITING]
        due += [entry.ends for entry in self.entries if entry.state is State.ON and not reaches(elapsed, entry.ends)]
        due += [self._joins[robot] for robot in self._joining if not reaches(elapsed, self._joins[robot])]
        return min(due, default=math.inf)

    def advance(self, elapsed: float) -> list[Change]:
        """Let faults begin and end that are due at `elapsed`; what changed."""
        changes = []
        for entry in self.entries:
            if entry.state is State.WAITING and reaches(elapsed, entry.begins):
                changes.append(self._begin(entry))
            # A robot is not started again before it was seen to be dead.
            if entry.state is State.ON and reaches(elapsed, entry.ends) and not entry.must_die:
                changes.append(self._end(entry))
        return changes

    def _begin(self, entry: Entry) -> Change:
        entry.state = State.ON
        deed = {Crash: Deed.KILL, Hang: Deed.HANG}.get(type(entry.fault))
        if deed is not None:
            entry.order = self._order(
                deed, robot_of(entry.fault) or "", f"{kind_of(entry.fault)} at {entry.begins:g} s"
            )
        return Change(entry, on=True)

    def _end(self, entry: Entry) -> Change:
        entry.state = State.OVER
        robot = robot_of(entry.fault) or ""
        if entry.must_die:
            entry.order = None
        elif isinstance(entry.fault, Crash):
            entry.order = self._order(Deed.START, robot, f"restart at {entry.ends:g} s")
        elif isinstance(entry.fault, Hang):
            entry.order = self._order(Deed.RESUME, robot, f"hang until {entry.ends:g} s")
        return Change(entry, on=False)

    def inject(self, fault: Fault, elapsed: float, lasts: float | None) -> tuple[Entry, list[Change]]:
        """Put a fault in force now.

        Args:
            fault: the fault; its own times are not looked at but for the length between them.
            elapsed: the present instant, in seconds.
            lasts: how long, in seconds; None: as long as the fault itself says.

        Raises:
            UserError: the fault does not fit the team or contradicts another one.
        """
        ends = elapsed + (fault.end - fault.at if lasts is None else lasts)
        timed = _timed(fault, elapsed, ends)
        wrong = self._mission.misfit(timed)
        if wrong is not None:
            raise UserError(f"{'.'.join(map(str, wrong[0]))}: {wrong[1]}")
        for entry in self.entries:
            earlier = _timed(entry.fault, entry.begins, entry.ends)
            against = contradiction(timed, earlier, self._mission.robots) if entry.state is not State.OVER else None
            if against is not None:
                raise UserError(f"{against} (see fault {entry.name})")
        entry = self._add(timed, elapsed, ends)
        return entry, self.advance(elapsed)

    def heal(self, name: str, elapsed: float, *, killing: bool) -> tuple[list[str], list[Change]]:
        """End the fault `name`, or all that are in force if it is empty; which they are, and what has changed already.

        Args:
            name: which.
            elapsed: the present instant, in seconds.
            killing: whether somebody may be killing a process just now: its crash is over once it was seen to be dead.

        Raises:
            UserError: there is no such fault in force.
        """
        on = [entry for entry in self.entries if entry.state is State.ON and name in {"", entry.name}]
        if name and not on:
            known = ", ".join(entry.name for entry in self.entries if entry.state is State.ON) or "none"
            raise UserError(f"no fault {name!r} is in force; expected one of: {known}")
        for entry in on:
            entry.ends = elapsed
        over = [self._end(entry) for entry in on if not (killing and entry.must_die)]
        return [entry.name for entry in on], over

    def orders(self, elapsed: float) -> list[Order]:
        """All orders that are due and not confirmed, in the order in which they became due (joins first)."""
        due = [entry.order for entry in self.entries if entry.order is not None]
        due += [order for robot, order in self._joining.items() if reaches(elapsed, self._joins[robot])]
        return sorted(due, key=lambda order: order.number)

    def done(self, number: int, elapsed: float) -> None:
        """Whoever holds the processes has carried out an order."""
        for entry in self.entries:
            if entry.order is not None and entry.order.number == number:
                if entry.order.deed is Deed.HANG:
                    entry.fire(elapsed)
                if entry.order.deed in {Deed.HANG, Deed.RESUME}:
                    entry.order = None

    def presence(self, robot: str, present: bool, elapsed: float) -> None:
        """`robot` came or went, which may confirm an order."""
        if present:
            self._joining.pop(robot, None)
        awaited = Deed.START if present else Deed.KILL
        for entry in self.entries:
            if entry.order is not None and entry.order.robot == robot and entry.order.deed is awaited:
                if not present:
                    entry.fire(elapsed)
                entry.order = None

    def killed(self) -> set[str]:
        """The robots that a fault in force has killed."""
        return {robot_of(one.fault) or "" for one in self._on() if isinstance(one.fault, Crash) and not one.must_die}

    def killed_for_good(self) -> set[str]:
        """The robots that the mission itself has killed, which does not mean to start them again."""
        scheduled = [one for one in self.entries[: len(self._mission.faults)] if one.state is State.ON]
        return self.killed() & {
            robot_of(one.fault) or "" for one in scheduled if isinstance(one.fault, Crash) and one.ends == math.inf
        }

    def joining(self) -> set[str]:
        """The robots that are to join the live trial and have not come yet."""
        return set(self._joining)

    @property
    def hold_up(self) -> bool:
        """Whether any body may be held up just now."""
        return any(isinstance(entry.fault, Hang | Stuck | Slow) for entry in self._on())

    def is_hung(self, robot: str) -> bool:
        """Whether the robot's process is to be stopped just now."""
        return any(isinstance(entry.fault, Hang) and robot_of(entry.fault) == robot for entry in self._on())

    def pace(self, robot: str, task: str) -> float:
        """How fast a robot's body works on `task`: 1 as always, 0 not at all."""
        pace = 1.0
        for entry in self._holding(robot, task):
            pace = pace / entry.fault.factor if isinstance(entry.fault, Slow) else 0.0
        return pace

    def worked(self, robot: str, task: str, elapsed: float) -> None:
        """The robot's body worked on `task` for a while: a fault that held it up has fired."""
        for entry in self._holding(robot, task):
            if entry.fired_at is None and not isinstance(entry.fault, Hang):
                entry.fire(elapsed)

    def _holding(self, robot: str, task: str) -> list[Entry]:
        return [entry for entry in self._on() if _holds_up(entry.fault, robot, task)]

    def _on(self) -> list[Entry]:
        return [entry for entry in self.entries if entry.state is State.ON]

    def rules(self) -> list[LinkRule]:
        """The link rules in force."""
        return [rule for entry in self._on() for rule in link_rules(entry.fault, entry.name)]

    def blind(self) -> list[Blindness]:
        """The robots whose sensory feedback is held back just now."""
        return [
            Blindness(fault=entry.name, robot=entry.fault.robot, delay=entry.fault.delay)
            for entry in self._on()
            if isinstance(entry.fault, Blind)
        ]

    def touched(self, effects: list[Effect], elapsed: float) -> None:
        """What faults have newly done to messages."""
        by_name = {entry.name: entry for entry in self.entries}
        for effect in effects:
            if effect.count > 0 and effect.fault in by_name:
                by_name[effect.fault].fire(elapsed, effect.count)

    def faults(self) -> tuple[Fault, ...]:
        """Each fault as it came to pass: also those that were injected, and until they were healed."""
        return tuple(_timed(entry.fault, entry.begins, entry.ends) for entry in self.entries)

    def report(self) -> list[dict[str, Any]]:
        """Each fault, and whether and how often it fired."""
        return [entry.report() for entry in self.entries]


def _timed(fault: Fault, begins: float, ends: float) -> Fault:
    times = {"at": begins, "until": None if ends == math.inf else ends}
    # Whoever says how long a crash lasts means that the robot returns.
    return fault.model_copy(update=times | ({"restart": ends < math.inf} if isinstance(fault, Crash) else {}))


def _holds_up(fault: Fault, robot: str, task: str) -> bool:
    match fault:
        case Stuck():
            return fault.robot == robot and fault.task in {None, task}
        case Slow() | Hang():
            return fault.robot == robot
        case _:
            return False
