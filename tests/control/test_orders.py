"""What is done at the robots' processes, and what is reported, for each order of the world."""

import signal

from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.messages import Event
from mission_control.orders import Orders

MISSION = parse_mission(
    """
name: pair
tasks: {a: {}}
robots:
  left: {tasks: {a: 5}}
  right: {tasks: {a: 5}}
  late: {tasks: {a: 5}, joins: 9}
faults: [{at: 6, robot: right, kind: crash}]
""",
    "pair.yaml",
)


class Puppet:
    """A process that only writes down what is done to it."""

    def __init__(self, log: list[str], name: str) -> None:
        self.log = log
        self.name = name
        self.running = True

    def send_signal(self, number: signal.Signals) -> None:
        self.log.append(f"{number.name} {self.name}")
        self.running = False

    def stop(self) -> None:
        self.log.append(f"stop {self.name}")

    def resume(self) -> None:
        self.log.append(f"resume {self.name}")


class Stage:
    """Orders at two puppets, and a log of what came of them."""

    def __init__(self) -> None:
        self.log: list[str] = []
        self.puppets = {name: Puppet(self.log, name) for name in ("left", "right")}
        self.orders = Orders(
            MISSION,
            self.puppets,
            lambda robot: self.log.append(f"start {robot}"),
            lambda number: self.log.append(f"report {number}"),
        )

    def order(self, number: object, deed: object, robot: str | None, elapsed: float = 1.0) -> list[str]:
        """What is done for one order."""
        before = len(self.log)
        details = {"number": number, "deed": deed}
        header = {"sender": "@world", "incarnation": 1, "seq": 1, "at": 0.0}
        event = Event(**header, kind="order", robot=robot, elapsed=elapsed, trial=1, text="", details=details)
        self.orders.take(event)
        return self.log[before:]


def test_each_order_is_carried_out_once_and_reported_each_time_it_comes() -> None:
    stage = Stage()
    assert stage.order(1, "hang", "left") == ["stop left", "report 1"]
    assert stage.order(1, "hang", "left") == ["report 1"]
    assert stage.order(2, "resume", "left") == ["resume left", "report 2"]
    assert stage.order(3, "kill", "left") == ["SIGKILL left", "report 3"]
    assert stage.order(4, "start", "left") == ["start left", "report 4"]
    assert stage.order(3, "kill", "left") == ["report 3"]
    assert stage.order(5, "start", "late") == ["start late", "report 5"]


def test_what_cannot_be_done_is_not_reported_so_that_the_world_asks_again() -> None:
    stage = Stage()
    assert stage.order(1, "start", "left") == []  # it still runs
    assert stage.order(2, "kill", "late") == []  # it was never started
    stage.puppets["left"].running = False
    assert stage.order(3, "hang", "left") == []
    assert stage.order(1, "start", "left") == ["start left", "report 1"]


def test_an_order_that_makes_no_sense_is_ignored() -> None:
    stage = Stage()
    assert stage.order(1, "kill", "stranger") == []
    assert stage.order(1, "kill", None) == []
    assert stage.order("1", "kill", "left") == []
    assert stage.order(None, "kill", "left") == []
    assert stage.order(1, "dance", "left") == []
    assert stage.log == []


def test_a_robot_may_return_unless_it_was_killed_by_the_mission_for_good() -> None:
    stage = Stage()
    stage.order(1, "kill", "left")
    stage.order(2, "kill", "right", elapsed=3.0)  # by an operator, before the mission's own crash of it
    assert stage.orders.may_return == {"left", "right"}
    for robot in ("left", "right"):
        stage.orders.returned(robot)
    stage.order(3, "kill", "right", elapsed=6.0)
    assert stage.orders.may_return == set()
