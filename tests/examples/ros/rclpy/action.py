"""Goals of one action server, a base that takes a moment to accept a goal and a while to drive; it prints what it does."""

from types import SimpleNamespace
from typing import Any

from action_msgs.msg import GoalStatus

from rclpy import Future, Node

ACCEPTING, DRIVING, STOPPING = 0.1, 4.0, 0.1


class ActionClient:
    def __init__(self, node: Node, _kind: type[Any], _name: str) -> None:
        self._node = node

    def server_is_ready(self) -> bool:
        return True

    def send_goal_async(self, goal: Any) -> Future:
        accepted = Future()
        self._node.later(ACCEPTING, lambda: accepted.set_result(GoalHandle(self._node, goal)))
        return accepted


class GoalHandle:
    accepted = True

    def __init__(self, node: Node, goal: Any) -> None:
        self._node = node
        self._ended = Future()
        self._is_over = False
        at = goal.pose.pose.position
        self._place = f"{at.x} {at.y}"
        print(f"drives to {self._place}", flush=True)
        node.later(DRIVING, lambda: self._end(GoalStatus.STATUS_SUCCEEDED, "reaches"))

    def get_result_async(self) -> Future:
        return self._ended

    def cancel_goal_async(self) -> Future:
        cancelled = Future()
        self._node.later(STOPPING, lambda: self._end(GoalStatus.STATUS_CANCELED, "stops on its way to"))
        self._node.later(STOPPING, lambda: cancelled.set_result(None))
        return cancelled

    def _end(self, status: int, what: str) -> None:
        if not self._is_over:
            self._is_over = True
            print(f"{what} {self._place}", flush=True)
            self._ended.set_result(SimpleNamespace(status=status))
