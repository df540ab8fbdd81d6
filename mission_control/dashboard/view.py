"""What one viewer has seen, and what is new to it. Pure.

All that goes to a viewer is made here, as plain data in the form that `page/mission.js` reads:

    hello    once: which mission this is
    update   what changed since the update before: the present state, and additions to the history
    past     an instant that the viewer asked for: the whole state as it was then

A viewer is given an update only when it has drawn the one before, so a slow one gets fewer, each with the latest state.
"""

from typing import Any

import msgpack

from mission_control.dashboard.chronicle import Chronicle, Versioned

#: Time that a picture of the curves shows, in seconds, and points in it.
CURVES_SPAN = 32.0
MOST_POINTS = 400

State = dict[str, Any]


class View:
    """One viewer's view.

    Args:
        chronicle: what it looks at.
    """

    def __init__(self, chronicle: Chronicle) -> None:
        self._chronicle = chronicle
        self._seen = 0
        self._told = 0
        self._marked = 0
        self._robot = ""
        self._curves_until = 0.0
        self._number = 0

    def choose(self, robot: str) -> None:
        """Have the motivations of `robot` in the updates from now on; of one that is not known, nothing."""
        self._robot = robot
        self._curves_until = self._chronicle.now - CURVES_SPAN

    def update(self) -> State:
        """What is new."""
        chronicle = self._chronicle
        since, self._seen = self._seen, chronicle.version
        self._number += 1
        news: State = {"kind": "update", "number": self._number, "now": round(chronicle.now, 3)}
        if chronicle.names_version > since:
            news |= {"robots": chronicle.robot_names, "tasks": chronicle.task_names}
            news["trials"] = [{"trial": trial, "at": round(at, 3)} for trial, at in sorted(chronicle.trials.items())]
        news["scene"] = self._scene(since)
        news |= self._history(since)
        curves = self._curves(self._curves_until, chronicle.now)
        if curves["points"]:
            self._curves_until = chronicle.now
            news["curves"] = curves | {"factors": chronicle.latest_factors(self._robot)}
        return news

    def past(self, at: float, robot: str) -> State:
        """The state as it was at the instant `at`, in seconds since the first trial began, and the curves of `robot`."""
        chronicle = self._chronicle
        return {
            "kind": "past",
            "at": at,
            "scene": {
                "figures": chronicle.figures.past.at(at) or {},
                "robots": {name: _robot(one.past.at(at)) for name, one in chronicle.robots.items()},
                "tasks": {name: _task(one.past.at(at)) for name, one in chronicle.tasks.items()},
                "links": {name: _links(one.past.at(at)) for name, one in chronicle.links.items()},
            },
            "curves": self._past_curves(at, robot),
        }

    def _scene(self, since: int) -> State:
        chronicle = self._chronicle
        scene: State = {
            "robots": {name: _robot(one.past.last) for name, one in _changed(chronicle.robots, since)},
            "tasks": {name: _task(one.past.last) for name, one in _changed(chronicle.tasks, since)},
            "links": {name: _links(one.past.last) for name, one in _changed(chronicle.links, since)},
        }
        scene = {name: changed for name, changed in scene.items() if changed}
        if chronicle.figures.version > since:
            scene["figures"] = chronicle.figures.past.last
        return scene

    def _history(self, since: int) -> State:
        chronicle = self._chronicle
        news: State = {}
        if bars := list(chronicle.changed_bars(since)):
            news["bars"] = bars[::-1]
        if faults := [fault for fault in chronicle.faults.values() if fault["version"] > since]:
            news["faults"] = faults
        if told := _newer(chronicle.told, self._told):
            news["told"], self._told = told, told[-1]["id"]
        if marks := _newer(chronicle.marks, self._marked):
            news["marks"], self._marked = marks, marks[-1]["id"]
        if len(chronicle.told) == chronicle.told.maxlen or len(chronicle.marks) == chronicle.marks.maxlen:
            news["forgotten"] = {
                "told": chronicle.told[0]["id"],
                "marks": chronicle.marks[0]["id"] if chronicle.marks else 0,
                "bars": min(chronicle.bars, default=0),
            }
        return news

    def _curves(self, since: float, until: float) -> State:
        series = self._chronicle.curves.get(self._robot)
        points = [] if series is None else series.between(since, until)
        return {"robot": self._robot, "points": [_point(one) for one in points[-MOST_POINTS:]]}

    def _past_curves(self, at: float, robot: str) -> State:
        chronicle = self._chronicle
        series, factors = chronicle.curves.get(robot), chronicle.factors.get(robot)
        points = [] if series is None else series.between(at - CURVES_SPAN, at)
        packed = None if factors is None else factors.at(at)
        return {
            "robot": robot,
            "points": [_point(one) for one in points[-MOST_POINTS:]],
            "factors": {} if packed is None else msgpack.unpackb(packed),
        }


def _changed(things: dict[str, Versioned], since: int) -> list[tuple[str, Versioned]]:
    return [(name, one) for name, one in things.items() if one.version > since]


def _newer(entries: Any, than: int) -> list[State]:
    """The entries with a number above `than`; the newest are at the end."""
    news: list[State] = []
    for entry in reversed(entries):
        if entry["id"] <= than:
            break
        news.append(entry)
    return news[::-1]


def _point(one: tuple[float, bytes]) -> tuple[float, Any]:
    return round(one[0], 2), msgpack.unpackb(one[1])


def _links(packed: bytes | None) -> State:
    return {} if packed is None else dict(msgpack.unpackb(packed, use_list=False))


def _robot(value: tuple[bool | None, str | None] | None) -> State:
    present, task = value or (None, None)
    return {"present": present, "task": task}


def _task(value: tuple[Any, ...] | None) -> State:
    progress, applicable, complete, at, by = value or (0.0, False, False, None, None)
    return {"progress": progress, "applicable": applicable, "complete": complete, "at": at, "by": by}
