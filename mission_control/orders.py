"""The world's orders at the robots' processes, carried out.

Faults of processes are decided by the world and made by whoever holds the processes: kill (SIGKILL), start, hang (SIGSTOP)
and resume (SIGCONT). The world repeats an order each second until it has seen the deed, so each is carried out once, by its
number, and reported each time it comes. What cannot be done yet, such as starting a robot whose process has not quite ended,
is not reported; the world asks again.
"""

import signal
from collections.abc import Callable, Mapping
from typing import Protocol

from lalliance_agents.config import Mission
from lalliance_agents.faults import Crash
from lalliance_agents.model.equations import reaches
from lalliance_agents.wire.messages import Event
from world_server.failures import Deed


class Process(Protocol):
    """A robot's process, as far as orders are about it."""

    @property
    def running(self) -> bool:
        """Whether it has not ended yet; a stopped one has not."""

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal, unless it has ended."""

    def stop(self) -> None:
        """Have it make no further step until it is continued."""

    def resume(self) -> None:
        """Let it go on where it was stopped."""


class Orders:
    """Carries out orders.

    Args:
        mission: whose robots may be named.
        processes: the latest process of each robot that was started.
        start: called to start a robot in its next life.
        report: called with the number of each order that has been carried out.
    """

    def __init__(
        self,
        mission: Mission,
        processes: Mapping[str, Process],
        start: Callable[[str], None],
        report: Callable[[int], None],
    ) -> None:
        self._mission = mission
        self._processes = processes
        self._start = start
        self._report = report
        self._done: set[int] = set()
        #: Robots that were killed and may be started again: by the mission, or when an operator heals what they died of.
        self.may_return: set[str] = set()

    def take(self, order: Event) -> None:
        """Do what the world orders, unless it was done before, and report it."""
        number, robot = order.details.get("number"), order.robot
        if not isinstance(number, int) or robot not in self._mission.robots:
            return
        if number not in self._done and not self._carry_out(order.details.get("deed"), robot, order.elapsed):
            return
        self._done.add(number)
        self._report(number)

    def returned(self, robot: str) -> None:
        """A robot's process runs again."""
        self.may_return.discard(robot)

    def _carry_out(self, deed: object, robot: str, elapsed: float) -> bool:
        """Whether it could be done."""
        process = self._processes.get(robot)
        if deed == Deed.START:
            return self._bring_back(robot, process)
        if process is None:
            return False
        if deed == Deed.KILL:
            process.send_signal(signal.SIGKILL)
            if not self._is_for_good(robot, elapsed):
                self.may_return.add(robot)
        elif deed == Deed.HANG and process.running:
            process.stop()
        elif deed == Deed.RESUME:
            process.resume()
        else:
            return False
        return True

    def _bring_back(self, robot: str, process: Process | None) -> bool:
        if process is not None and process.running:
            return False
        self._start(robot)
        return True

    def _is_for_good(self, robot: str, elapsed: float) -> bool:
        """Whether a robot killed now was killed by the mission itself, which does not mean to start it again.

        No other crash of the robot can be in force once such a one is.
        """
        return any(
            isinstance(fault, Crash) and fault.robot == robot and not fault.restart and reaches(elapsed, fault.at)
            for fault in self._mission.faults
        )
