"""Behaviour sets for a base under ROS 2: Nav2 drives it to places, and teammates hear which were visited."""

import asyncio
import threading
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from lalliance_agents import AutonomousBehaviorSet, BehaviorSet

PLACES = {"gate": (4.0, 1.5), "fence": (-2.0, 6.0)}


class Base:
    """The base. ROS calls back in a thread of its own, beside the robot's event loop."""

    def __init__(self) -> None:
        # Lalliance handles the signals that end this process, and has its sets clean up first.
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node("lalliance_base")
        kept = QoSProfile(depth=len(PLACES), durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.visited: set[str] = set()
        self.visits = node.create_publisher(String, "/visited", kept)
        node.create_subscription(String, "/visited", lambda heard: self.visited.add(heard.data), kept)
        self.navigation = ActionClient(node, NavigateToPose, "navigate_to_pose")
        threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()


class Visit(AutonomousBehaviorSet):
    """Drives to one place."""

    def __init__(self, place: str, base: Base) -> None:
        super().__init__(place)
        self.base = base

    def complete(self) -> bool:
        """Whether somebody was there, this robot or another one."""
        return super().complete() or self.task in self.base.visited

    def applicable(self) -> bool:
        """Whether nobody was there yet, and Nav2 takes goals."""
        return not self.complete() and self.base.navigation.server_is_ready()

    async def perform(self) -> None:
        """Drive there and return. Cancelled, it cancels the goal and waits for its end."""
        accepting = told(self.base.navigation.send_goal_async(self._goal()))
        try:
            goal = await asyncio.shield(accepting)
            if not goal.accepted:
                raise RuntimeError(f"Nav2 refuses to drive to the {self.task}")
            ended = await told(goal.get_result_async())
        except asyncio.CancelledError:
            goal = await accepting  # one that is only just being accepted drives as well
            if goal.accepted:
                await told(goal.cancel_goal_async())
                await told(goal.get_result_async())
            raise
        if ended.status != GoalStatus.STATUS_SUCCEEDED:
            raise RuntimeError(f"Nav2 did not reach the {self.task}: status {ended.status}")
        self.base.visits.publish(String(data=self.task))

    def _goal(self) -> Any:
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.x, goal.pose.pose.position.y = PLACES[self.task]
        goal.pose.pose.orientation.w = 1.0
        return goal


def told(future: Any) -> "asyncio.Future[Any]":
    """What comes of a future of ROS, which its thread completes, as one of this event loop."""
    loop = asyncio.get_running_loop()
    here: asyncio.Future[Any] = loop.create_future()

    def pass_on() -> None:
        if here.cancelled():
            return
        if future.exception() is not None:
            here.set_exception(future.exception())
        else:
            here.set_result(future.result())

    future.add_done_callback(lambda _: loop.call_soon_threadsafe(pass_on))
    return here


def behaviors() -> list[BehaviorSet]:
    """One set for each place, and one base for both."""
    base = Base()
    return [Visit(place, base) for place in PLACES]
