"""A mission in the hands of a test: wait for what happens, inject and heal faults, see it through to its end.

Time passes only as far as the test waits in a simulated mission, and by itself in one of real processes. So a test says what it
waits for, one thing after the other, and never sleeps; then the same test holds for both.
"""

import json
from collections.abc import Iterable
from typing import Any

from lalliance_agents.config import Mission
from lalliance_agents.errors import LallianceError, UserError
from lalliance_agents.fault_checks import misfit
from lalliance_agents.faults import describe, kind_of
from lalliance_agents.mission_file import read_fault
from lalliance_agents.suggestions import like_or_any
from lalliance_testing.blame import ExpectationError, blames_its_caller
from lalliance_testing.engine import Engine
from lalliance_testing.happenings import Wanted
from lalliance_testing.judgement import broken, unfired
from mission_control.watch.happened import Happened

#: Mission seconds after which what a fault does is sure to have been told: robots report each second, in turn with the world.
REPORTED = 2.5


class RunningMission:
    """One mission of a test.

    Attributes:
        mission: what its file says, with the seed in force.
        engine: what moves it: `real` or `simulated`.
        speed: mission seconds per real second; of a simulated one it means nothing.
    """

    def __init__(self, mission: Mission, engine: Engine, kind: str, speed: float) -> None:
        self.mission = mission
        self.engine = kind
        self.speed = speed
        self._engine = engine
        self._excused: set[str] = set()
        self._injected: dict[str, tuple[dict[str, Any], float | None]] = {}
        self._next = 0
        self._summary: dict[str, Any] | None = None
        self._judged = False

    def __repr__(self) -> str:
        return f"<{self.engine} mission {self.mission.name}: {self._engine.ended or 'runs'}>"

    @property
    def events(self) -> list[Happened]:
        """All that has happened so far."""
        return list(self._engine.events)

    def excuse(self, faults: Iterable[str]) -> None:
        """Let these faults of the mission file end without having fired; they are named, or told by their text.

        Raises:
            UserError: there are no such faults.
        """
        names = [f"{number}-{kind_of(fault)}" for number, fault in enumerate(self.mission.faults, 1)]
        for fault in faults:
            if fault not in names and fault not in map(describe, self.mission.faults):
                raise UserError(f"may_not_fire: {fault!r} is no fault of this mission{like_or_any(fault, names)}")
            self._excused.add(fault)

    def start(self) -> None:
        """Have it run, until its first trial has begun."""
        self._engine.start()

    @blames_its_caller
    def wait_for(
        self, kind: str, /, *, within: float | None = None, anywhere: bool = False, **facts: str | None
    ) -> Happened:
        """Wait for an event; the first one that fits and came after the one that was waited for before.

        Args:
            kind: its kind, see `happenings.KINDS`.
            within: how long it may take from now, in mission seconds; None: as long as the mission lasts.
            anywhere: whether also events count that came before the one that was waited for last.
            facts: what else is to be true of it: robot, task, cause, other, fault, and text, which it is to contain.

        Raises:
            ExpectationError: it does not come.
            UserError: it cannot come in this mission.
        """
        wanted, at = Wanted.of(kind, facts, self.mission), 0 if anywhere else self._next
        events = self._engine.events

        def found() -> bool:
            nonlocal at
            while at < len(events) and not wanted.fits(events[at]):
                at += 1
            return at < len(events)

        if not self._engine.wait(found, within):
            ended = self._engine.ended
            limit = "within the time that the mission may take" if within is None else f"within {within:g} s"
            raise ExpectationError(f"no {wanted} {limit if ended is None else f'before the mission ended: {ended}'}")
        self._next = max(self._next, at + 1)
        return events[at]

    @blames_its_caller
    def happened(self, kind: str, /, **facts: str | None) -> list[Happened]:
        """The events so far that fit, from the very first.

        Raises:
            UserError: it cannot come in this mission.
        """
        wanted = Wanted.of(kind, facts, self.mission)
        return [event for event in self.events if wanted.fits(event)]

    @blames_its_caller
    def inject(self, *, lasts: float | None = None, may_not_fire: bool = False, **fields: Any) -> str:
        """Put a fault in force now, as `lalliance chaos … inject` does; its name, for `heal`.

        Args:
            lasts: how long, in mission seconds; None: until it is healed.
            may_not_fire: whether it may end without having done anything.
            fields: the fault as in a mission file, as in `kind="hang", robot="lifter"`.

        Raises:
            UserError: it is no fault, or the world refuses it.
        """
        if timed := fields.keys() & {"at", "until"}:
            raise UserError(f"{min(timed)}: an injected fault begins now; expected lasts= for how long")
        try:
            spelled = json.dumps(fields)
        except (TypeError, ValueError) as error:
            raise UserError(f"the fault is not plain data ({error}); expected the fields of a mission file") from None
        fault = read_fault(spelled)
        wrong = misfit(fault, self.mission.robots, lambda robot: self.mission.robots[robot].tasks)
        if wrong is not None:
            raise UserError(f"{'.'.join(map(str, wrong[0]))}: {wrong[1]}")
        name = self._engine.inject(fault, spelled, lasts)
        self._injected[name] = json.loads(spelled), lasts
        if may_not_fire:
            self._excused.add(name)
        return name

    def injected(self) -> list[dict[str, Any]]:
        """The faults that the test has injected so far, as a mission file would plan them."""
        began, ended = (
            {one.fault: one.at for one in self.events if one.kind == kind} for kind in ("fault", "fault_over")
        )
        planned = []
        for name, (fields, lasts) in self._injected.items():
            if name in began:
                until = ended.get(name, None if lasts is None else began[name] + lasts)
                planned.append(_planned(fields, began[name], until, self.mission))
        return planned

    @blames_its_caller
    def heal(self, name: str = "") -> None:
        """End the fault `name` now, or all; a robot that was killed is started again.

        Raises:
            UserError: there is no such fault in force.
        """
        self._engine.heal(name)

    @blames_its_caller
    def faults(self) -> dict[str, dict[str, Any]]:
        """What became of each fault so far, by name, in the words of the summary."""
        return {fault["name"]: fault for fault in self._engine.faults()}

    @blames_its_caller
    def kill_router(self) -> None:
        """Kill the router of a mission of real processes; it is started again, and everybody comes back.

        Raises:
            UserError: there is none.
        """
        self._engine.kill("router")

    @blames_its_caller
    def kill_world(self) -> None:
        """Kill the world server of a mission of real processes.

        Raises:
            UserError: there is none.
        """
        self._engine.kill("world")

    @blames_its_caller
    def finish(self, *, complete: bool = True) -> dict[str, Any]:
        """See the mission through to its end; its summary, the document of `lalliance run --json`.

        Args:
            complete: whether it is to be complete; False: it is to miss its deadline.

        Raises:
            ExpectationError: it ended otherwise, a fault has never fired, or its account cannot be true.
            LallianceError: it ended without a summary.
        """
        self._judged = True
        if self._summary is None:
            self._summary = self._engine.conclude()
        summary = self._summary
        if summary["complete"] != complete:
            raise ExpectationError(f"mission {self.mission.name} {_outcome(summary, self.mission)}")
        wrong = [
            *unfired(summary["faults"], self._excused),
            *broken(self.mission, summary),
            *self._engine.violations(),
        ]
        if wrong:
            raise ExpectationError("; ".join(wrong))
        return summary

    def settle(self) -> str | None:
        """Judge the faults of a mission that its test did not finish, as of now; what is wrong, in a sentence."""
        if self._judged:
            return None
        self._judged = True
        try:
            if self._unfired(waiting=False):
                # What a fault has done is told with the next reports.
                self._engine.wait(lambda: False, REPORTED)
            return "; ".join(self._unfired(waiting=True)) or None
        except LallianceError as error:
            return f"mission {self.mission.name} could not be asked for its faults: {error}"

    def _unfired(self, *, waiting: bool) -> list[str]:
        faults = self._engine.faults()
        return unfired([fault for fault in faults if waiting or fault["state"] != "waiting"], self._excused)

    def close(self) -> None:
        """Have nothing left that runs."""
        self._engine.close()


def _planned(fields: dict[str, Any], at: float, until: float | None, mission: Mission) -> dict[str, Any]:
    """An injected fault in the fields of a mission file; what would last beyond the deadline has no end."""
    times: dict[str, Any] = {"at": at}
    if until is not None and at < until < mission.deadline:
        times["until"] = until
    if fields.get("kind") == "crash":
        times["restart"] = "until" in times
    return {**fields, **times}


def _outcome(summary: dict[str, Any], mission: Mission) -> str:
    if summary["complete"]:
        return f"is complete after {summary['makespan']:.1f} s; its test expected it to fail"
    left = ", ".join(task for task, record in summary["tasks"].items() if record["completed_at"] is None)
    return f"was not complete by its deadline of {mission.deadline:g} s; left: {left}"
