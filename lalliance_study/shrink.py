"""From a mission that fails to a smaller one that fails alike: fewer faults, tasks, robots and phases, defaults, round numbers.

Only documents are changed, by steps that each take something away; a step is kept if what is left still fails. What is no
mission any more does not fail, so no step has to know what a mission may say. The steps are gone through until none helps or
the number of trials is used up: whatever `fails` says, that is the end.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from typing import Any

Document = dict[str, Any]
Fails = Callable[[Document], bool]

#: How many documents are tried at most.
BUDGET = 400


class _Shrinker:
    def __init__(self, document: Document, fails: Fails, budget: int) -> None:
        self.best = document
        self._fails = fails
        self._left = budget

    @property
    def spent(self) -> bool:
        return self._left <= 0

    def take(self, smaller: Document) -> bool:
        """Whether `smaller` fails too; it is the best then."""
        if self.spent or smaller == self.best:
            return False
        self._left -= 1
        if not self._fails(smaller):
            return False
        self.best = smaller
        return True


def shrink(document: Document, fails: Fails, *, budget: int = BUDGET) -> Document:
    """The smallest document found that still fails.

    Args:
        document: one that fails.
        fails: whether a document is a mission and fails in the same way.
        budget: how many documents are tried at most.
    """
    work = _Shrinker(deepcopy(document), fails, budget)
    before: Document | None = None
    while before != work.best and not work.spent:
        before = work.best
        for name, without in (("faults", _without_faults), ("robots", _without_robots), ("tasks", _without_tasks)):
            _take_away_parts(work, name, without)
        for steps in (_simpler_phases, _defaults, _rounder):
            _try_steps(work, steps)
    return work.best


def _take_away_parts(work: _Shrinker, name: str, without: Callable[[Document, list[Any]], Document]) -> None:
    """Delta debugging: halves first, then smaller and smaller shares, at last one by one."""
    size = max(len(work.best[name]) // 2, 1)
    while size >= 1 and not work.spent:
        start = 0
        while start < len(work.best[name]):
            gone = list(_labels(work.best[name]))[start : start + size]
            if not work.take(without(work.best, gone)):
                start += size
        size //= 2


def _labels(parts: Document | Sequence[Any]) -> Iterator[Any]:
    return iter(parts) if isinstance(parts, dict) else iter(range(len(parts)))


def _try_steps(work: _Shrinker, steps: Callable[[Document], Iterator[Document]]) -> None:
    progress = True
    while progress and not work.spent:
        progress = any(work.take(smaller) for smaller in steps(work.best))


def _without_faults(document: Document, gone: list[int]) -> Document:
    return {**document, "faults": [one for at, one in enumerate(document["faults"]) if at not in gone]}


def _without_robots(document: Document, gone: list[str]) -> Document:
    smaller = deepcopy(document)
    smaller["robots"] = {name: spec for name, spec in smaller["robots"].items() if name not in gone}
    smaller["faults"] = [one for one in smaller["faults"] if one.get("robot") not in gone]
    for fault in smaller["faults"]:
        for groups in _lists_of_globs(fault):
            groups[:] = [glob for glob in groups if glob not in gone]
    return _without_idlers(smaller)


def _lists_of_globs(fault: Document) -> Iterator[list[str]]:
    ends = [fault.get("link", {}).get("from"), fault.get("link", {}).get("to"), *fault.get("partition", ())]
    return (end for end in ends if isinstance(end, list))


def _without_tasks(document: Document, gone: list[str]) -> Document:
    smaller = deepcopy(document)
    smaller["tasks"] = {name: spec for name, spec in smaller["tasks"].items() if name not in gone}
    for spec in smaller["tasks"].values():
        if "after" in spec:
            spec["after"] = [needed for needed in spec["after"] if needed not in gone]
    for spec in smaller["robots"].values():
        spec["tasks"] = {task: time for task, time in spec["tasks"].items() if task not in gone}
    by_hand = smaller["parameters"].get("by_hand_tasks", {})
    for task in gone:
        by_hand.pop(task, None)
    smaller["faults"] = [one for one in smaller["faults"] if one.get("task") not in gone]
    return _without_idlers(smaller)


def _without_idlers(document: Document) -> Document:
    """Without robots that can do nothing any more, and tasks that nobody can do."""
    idlers = [name for name, spec in document["robots"].items() if not spec["tasks"]]
    if idlers:
        return _without_robots(document, idlers)
    able = {task for spec in document["robots"].values() for task in spec["tasks"]}
    orphans = [task for task in document["tasks"] if task not in able]
    return _without_tasks(document, orphans) if orphans else document


def _simpler_phases(document: Document) -> Iterator[Document]:
    phases = document["phases"]
    if len(phases) > 1:
        yield {**document, "phases": phases[1:]}
        yield {**document, "phases": phases[:-1]}
    for at, phase in enumerate(phases):
        simpler = {"learning": phase["learning"], "trials": 1}
        if phase != simpler:
            yield {**document, "phases": [*phases[:at], simpler, *phases[at + 1 :]]}


def _defaults(document: Document) -> Iterator[Document]:
    """One field less, which falls back to its default."""
    holders: list[tuple[Any, ...]] = [(), ("parameters",), ("environment",)]
    holders += [(part, name) for part in ("tasks", "robots") for name in document[part]]
    holders += [("robots", name, "parameters") for name, spec in document["robots"].items() if "parameters" in spec]
    holders += [("robots", name, "tasks") for name in document["robots"]]
    holders += [("faults", at) for at in range(len(document["faults"]))]
    for holder in holders:
        for field in _at(document, holder):
            if (*holder, field) not in {("name",), ("environment", "kind")}:
                smaller = deepcopy(document)
                del _at(smaller, holder)[field]
                if _has_its_parts(smaller):
                    yield smaller


def _has_its_parts(document: Document) -> bool:
    """Whether the parts that other steps rely on are there, and no robot is without tasks."""
    parts = ("tasks", "robots", "phases", "faults", "parameters", "environment")
    return all(part in document for part in parts) and all(spec.get("tasks") for spec in document["robots"].values())


def _rounder(document: Document) -> Iterator[Document]:
    """One number less long."""
    for path, value in _numbers(document, ()):
        for digits in (0, 1):
            rounder = float(round(value, digits))
            if rounder != value and len(f"{rounder:g}") < len(f"{value:g}"):
                smaller = deepcopy(document)
                _at(smaller, path[:-1])[path[-1]] = rounder
                yield smaller


def _numbers(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[tuple[Any, ...], float]]:
    if isinstance(value, float):
        yield path, value
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _numbers(inner, (*path, key))
    elif isinstance(value, list):
        for at, inner in enumerate(value):
            yield from _numbers(inner, (*path, at))


def _at(document: Document, path: tuple[Any, ...]) -> Any:
    found: Any = document
    for part in path:
        found = found[part]
    return found
