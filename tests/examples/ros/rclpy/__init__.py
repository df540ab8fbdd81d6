"""As much of rclpy as examples/rounds uses, where there is no ROS.

Callbacks come from the thread that spins, as they do there. A topic is a folder in the current directory, with a file for each
message; it is kept, so that who subscribes late hears all.
"""

import time
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Any

_TURN = 0.02


class Future:
    """What will come of a request."""

    def __init__(self) -> None:
        self._callbacks: list[Callable[[Future], None]] = []
        self._is_done = False
        self._result: Any = None

    def add_done_callback(self, callback: "Callable[[Future], None]") -> None:
        if self._is_done:
            callback(self)
        else:
            self._callbacks.append(callback)

    def set_result(self, result: Any) -> None:
        self._result, self._is_done = result, True
        for callback in self._callbacks:
            callback(self)

    def result(self) -> Any:
        return self._result

    def exception(self) -> BaseException | None:
        return None


class Node:
    def __init__(self, name: str) -> None:
        self.name = name
        self._lock = Lock()
        self._due: list[tuple[float, Callable[[], None]]] = []
        self._topics: list[tuple[Path, type[Any], Callable[[Any], None], set[str]]] = []

    def later(self, seconds: float, work: Callable[[], None]) -> None:
        """Have the spinning thread do some work in a while."""
        with self._lock:
            self._due.append((time.monotonic() + seconds, work))

    def create_publisher(self, _kind: type[Any], topic: str, _qos: object) -> "Publisher":
        return Publisher(Path(topic.strip("/")))

    def create_subscription(self, kind: type[Any], topic: str, callback: Callable[[Any], None], _qos: object) -> None:
        self._topics.append((Path(topic.strip("/")), kind, callback, set()))

    def turn(self) -> None:
        """Do what is due, and hand on what was published."""
        now = time.monotonic()
        with self._lock:
            ready = [work for due, work in self._due if due <= now]
            self._due = [(due, work) for due, work in self._due if due > now]
        for work in ready:
            work()
        for folder, kind, callback, heard in self._topics:
            for file in folder.iterdir() if folder.exists() else ():
                if file.name not in heard:
                    heard.add(file.name)
                    callback(kind(data=file.name))


class Publisher:
    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def publish(self, message: Any) -> None:
        self._folder.mkdir(exist_ok=True)
        (self._folder / message.data).touch()


def init(*, signal_handler_options: object) -> None:
    """There is nothing to begin."""


def create_node(name: str) -> Node:
    return Node(name)


def spin(node: Node) -> None:
    while True:
        node.turn()
        time.sleep(_TURN)
