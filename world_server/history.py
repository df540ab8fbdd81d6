"""The history of a world: what goes into it, and how that comes into the journal and back.

All that changes a world goes through here: it is put into the world and recorded, and after a restart put in again, while
nobody is told what comes of it. Each time the world advances is an input too, so that the world made again is the same one to
the last bit, also where an environment's roundings depend on how time is cut.

Two kinds of input come each second from every robot, for as long as the mission lasts, and need no entry each. An action that
says the same again only prolongs the entry it repeats. A robot's counters replace those that it reported before in the same
life and that they include, unless those were the first to show that a fault had fired. Neither changes what the world
becomes: the tests hold it against one that was never interrupted.
"""

import math
from collections import deque
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

from lalliance_agents.config import Mission
from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.mission_file import read_fault
from lalliance_agents.wire.messages import (
    Action,
    ChaosCommand,
    DecisionMade,
    DeedDone,
    LinkReport,
    Message,
    decode,
    encode,
)
from world_server.journal import Entry, Journal
from world_server.world import Happening, Stage, World

#: Kept of what happened and of what was decided, for whoever looks on later: the latest.
MOST_PAST = 2000
#: Decisions kept of each robot at least, however many robots there are.
LEAST_DECISIONS = 20
#: Larger decisions are not kept, in bytes: whoever makes up large ones cannot fill the memory.
LARGEST_DECISION = 32 * 1024


class Input(StrEnum):
    """What goes into a world; the words of the journal."""

    ADVANCE = "advance"
    BEGIN = "begin"
    PRESENCE = "presence"
    LAUNCHER = "launcher"
    ACT = "act"
    DECIDED = "decided"
    REPORTED = "reported"
    DONE = "done"
    COMMAND = "command"


class History:
    """A world whose inputs are recorded; begins where the journal ends.

    Args:
        mission: a mission that passed `environments.check_options`.
        journal: where to record; None: nowhere.
        tell: called with everything that happens from now on, as it happens.

    Attributes:
        past: what happened before this history began, according to the journal, and in which trial.
        decisions: what each robot decided, packed, the latest last.

    Raises:
        UserError: the journal is damaged.
    """

    def __init__(self, mission: Mission, journal: Journal | None, tell: Callable[[Happening], None]) -> None:
        self._journal = journal
        self.past: deque[tuple[int, Happening]] = deque(maxlen=MOST_PAST)
        most = max(MOST_PAST // len(mission.robots), LEAST_DECISIONS)
        self.decisions: dict[str, deque[bytes]] = {robot: deque(maxlen=most) for robot in mission.robots}
        self._tell: Callable[[Happening], None] = lambda one: self.past.append((self.world.trial, one))
        self.world = World(mission, 0.0, self._pass_on)
        #: The latest instant at which anything went in, and the one until which the world has moved; in seconds.
        self.now = self.moved = 0.0
        self._next_change: float | None = None
        self._sayings: dict[str, tuple[int, tuple[int, str | None, int]]] = {}
        self._reports: dict[str, tuple[LinkReport, int]] = {}
        self._waiting: int | None = None
        if journal is not None:
            self._replay(journal)
        self._tell = tell

    def __repr__(self) -> str:
        return f"<history of {self.world!r}, until {self.now:.2f} s>"

    def _pass_on(self, happening: Happening) -> None:
        self._tell(happening)

    def _replay(self, journal: Journal) -> None:
        for entry in journal.entries():
            try:
                self._put_in(entry)
            except (MessageError, UserError, ValueError) as error:
                raise journal.damaged(entry.number) from error
            self.now = max(self.now, entry.at, entry.until or 0.0)

    def _put_in(self, entry: Entry) -> None:
        """Put an input of the journal into the world.

        Raises:
            MessageError, UserError, ValueError: there is no such input.
        """
        world, at, content = self.world, entry.at, entry.content
        match Input(entry.kind):
            case Input.ADVANCE:
                world.advance(max(at, entry.until or -math.inf))
            case Input.BEGIN:
                world.begin(at)
            case Input.PRESENCE:
                word = content.decode()
                world.presence(word[1:], word[:1] == _sign(True), at)
            case Input.LAUNCHER:
                world.launcher(content.decode() == _sign(True), at)
            case Input.ACT:
                action = decode(Action, content)
                world.act(action, at)
                if entry.until is not None:
                    world.bodies.refresh(action.sender, entry.until)
            case Input.DECIDED:
                self._decided(decode(DecisionMade, content), at)
            case Input.REPORTED:
                world.reported(decode(LinkReport, content), at)
            case Input.DONE:
                world.done(decode(DeedDone, content).number, at)
            case Input.COMMAND:
                _obey(world, decode(ChaosCommand, content), at)

    def _record(self, kind: Input, now: float, content: Message | str = "") -> int:
        """Take an input down, which the world has taken; the number of its entry."""
        self.now = max(self.now, now)
        self._next_change = None
        if kind is not Input.REPORTED or self.world.trial:
            self._waiting = None
        if self._journal is None:
            return 0
        packed = encode(content) if isinstance(content, Message) else content.encode()
        return self._journal.record(kind.value, now, packed)

    def _prolong(self, number: int, now: float) -> None:
        self.now = max(self.now, now)
        if self._journal is not None:
            self._journal.prolong(number, now)

    def commit(self) -> None:
        """Make sure that all that went in is not forgotten.

        Raises:
            UserError: the journal cannot be written any more.
        """
        if self._journal is not None:
            self._journal.commit()

    @property
    def next_change(self) -> float:
        """The instant at which the world will change by itself, at the latest, in seconds of mission time."""
        if self._next_change is None:
            self._next_change = self.world.next_change()
        return self._next_change

    def advance(self, now: float) -> None:
        """Let time pass until `now`."""
        runs = self.world.stage is Stage.RUNNING
        self.world.advance(now)
        self.moved = now
        if not runs and self._waiting is not None:
            self._prolong(self._waiting, now)
            return
        number = self._record(Input.ADVANCE, now)
        self._waiting = None if runs else number

    def begin(self, now: float) -> None:
        """Start the first trial, if it has not begun."""
        if self.world.stage is Stage.WAITING:
            self.world.begin(now)
            self._record(Input.BEGIN, now)

    def presence(self, robot: str, present: bool, now: float) -> None:
        """A robot's process came or went."""
        body = self.world.bodies.get(robot)
        if body is not None and body.present != present:
            self.world.presence(robot, present, now)
            self._record(Input.PRESENCE, now, _sign(present) + robot)

    def launcher(self, present: bool, now: float) -> None:
        """Whoever holds the robots' processes came or went."""
        if self.world.has_launcher != present:
            self.world.launcher(present, now)
            self._record(Input.LAUNCHER, now, _sign(present))

    def act(self, action: Action, now: float) -> None:
        """A robot says what its body works on."""
        saying = (action.trial, action.task, action.fewest)
        number, before = self._sayings.get(action.sender, (0, None))
        repeats = saying == before and self.world.is_refresh(action, now)
        self.world.act(action, now)
        if repeats:
            self._prolong(number, now)
        else:
            self._sayings[action.sender] = (self._record(Input.ACT, now, action), saying)

    def decided(self, made: DecisionMade, now: float) -> None:
        """A robot reports a decision."""
        self._decided(made, now)
        self._record(Input.DECIDED, now, made)

    def _decided(self, made: DecisionMade, now: float) -> None:
        self.world.decided(made, now)
        if made.sender in self.decisions and len(packed := encode(made)) <= LARGEST_DECISION:
            self.decisions[made.sender].append(packed)

    def reported(self, report: LinkReport, now: float) -> None:
        """A robot reports its counters."""
        fired = self._fired(report)
        self.world.reported(report, now)
        number = self._record(Input.REPORTED, now, report)
        before = self._reports.pop(report.sender, None)
        if before is not None and self._journal is not None and _adds_up(before[0], report):
            self._journal.remove(before[1])
        if self._fired(report) == fired and self._is_of_faults(report):
            self._reports[report.sender] = (report, number)

    def _fired(self, report: LinkReport) -> int:
        """How many faults have fired; not looked up for a report that cannot change it."""
        return sum(one.fired_at is not None for one in self.world.failures.entries) if report.effects else 0

    def _is_of_faults(self, report: LinkReport) -> bool:
        """Whether all that the report tells of was done by faults that there are already."""
        known = {one.name for one in self.world.failures.entries} if report.effects else set()
        return all(effect.fault in known for effect in report.effects)

    def done(self, deed: DeedDone, now: float) -> None:
        """Whoever holds the robots' processes has carried out an order."""
        self.world.done(deed.number, now)
        self._record(Input.DONE, now, deed)

    def obey(self, command: ChaosCommand, now: float) -> str:
        """Put a fault in force or end one; what was done, in a sentence.

        Raises:
            UserError: it cannot be made now, or here, or is no fault.
        """
        # What a refused command leaves behind is that time has passed until then.
        self.advance(now)
        text = _obey(self.world, command, now)
        self._record(Input.COMMAND, now, command)
        return text


def recall(path: Path, mission: Mission) -> World:
    """The world as the journal at `path` has it, or a fresh one if there is none; then there is one from now on.

    Raises:
        UserError: the file cannot be used.
    """
    with Journal(path, mission) as journal:
        return History(mission, journal, lambda _: None).world


def _adds_up(before: LinkReport, after: LinkReport) -> bool:
    """Whether `after` alone makes the same difference as both: counters of one life that only grow, as they should."""
    counts = {(one.fault, one.sender): one.count for one in after.effects}
    grown = all(one.count <= counts.get((one.fault, one.sender), -1) for one in before.effects)
    return before.incarnation == after.incarnation and grown and len(counts) == len(after.effects)


def _sign(present: bool) -> str:
    return "+" if present else "-"


def _obey(world: World, command: ChaosCommand, now: float) -> str:
    if command.verb == "heal":
        return world.heal(command.name, now)
    return world.inject(read_fault(command.fault), command.lasts, now)
