"""The mission's fault schedule, and whether each fault really happened.

A crash is made outside of this process: the schedule orders it, and it counts as fired only when the robot's presence was
seen to end after that. An order stands until it has been confirmed, so whoever carries it out may miss it a few times, and
must not carry it out twice: its number tells.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from lalliance_agents.config import CrashFault, Mission


class Deed(StrEnum):
    """What whoever holds the processes is asked to do."""

    KILL = "kill"
    START = "start"


@dataclass(frozen=True, slots=True)
class Order:
    """A deed at one robot's process."""

    number: int
    deed: Deed
    robot: str
    because: str


@dataclass(slots=True)
class _Crash:
    fault: CrashFault
    ordered: bool = False
    fired_at: float | None = None
    returned: bool = False


class Failures:
    """Faults of the live trial, and the robots that join it late.

    Args:
        mission: whose faults.
    """

    def __init__(self, mission: Mission) -> None:
        self._crashes = [_Crash(fault) for fault in mission.faults]
        joining = [(name, spec.joins) for name, spec in mission.robots.items() if spec.joins > 0]
        self._joining = {
            name: Order(number, Deed.START, name, f"joins at {joins:g} s")
            for number, (name, joins) in enumerate(joining, 2 * len(self._crashes))
        }
        self._joins = dict(joining)

    def orders(self, elapsed: float) -> list[Order]:
        """All orders that are due and not confirmed, `elapsed` seconds after the live trial's start."""
        due = []
        for number, crash in enumerate(self._crashes):
            if crash.fault.at <= elapsed and crash.fired_at is None:
                crash.ordered = True
                due.append(Order(2 * number, Deed.KILL, crash.fault.robot, f"crash at {crash.fault.at:g} s"))
            back = crash.fault.restart_at
            if back is not None and back <= elapsed and crash.fired_at is not None and not crash.returned:
                due.append(Order(2 * number + 1, Deed.START, crash.fault.robot, f"restart at {back:g} s"))
        return due + [order for robot, order in self._joining.items() if self._joins[robot] <= elapsed]

    def presence(self, robot: str, present: bool, elapsed: float) -> bool:
        """`robot` came or went; whether that confirms an order."""
        if present and self._joining.pop(robot, None) is not None:
            return True
        for crash in self._crashes:
            if crash.fault.robot == robot and crash.ordered:
                if not present and crash.fired_at is None:
                    crash.fired_at = elapsed
                    return True
                if present and crash.fired_at is not None and crash.fault.restart and not crash.returned:
                    crash.returned = True
                    return True
        return False

    def report(self) -> list[dict[str, Any]]:
        """Each scheduled fault, and whether and how often it fired."""
        return [
            {
                "kind": crash.fault.kind,
                "robot": crash.fault.robot,
                "at": crash.fault.at,
                "fired": crash.fired_at is not None,
                "fired_at": crash.fired_at,
                "count": int(crash.fired_at is not None),
            }
            for crash in self._crashes
        ]
