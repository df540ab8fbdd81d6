"""Making failing missions small: the failure stays, and the end comes."""

from typing import Any

from lalliance_study.campaign import Failure, breaks, make_small
from lalliance_study.invariants import Violation
from lalliance_study.random_missions import draw_mission, mission_of, text_of
from lalliance_study.shrink import shrink

Document = dict[str, Any]


def is_mission(document: Document) -> bool:
    try:
        mission_of(document)
    except ValueError:
        return False
    return True


def large() -> Document:
    return next(
        document
        for document, mission in (draw_mission(2, number) for number in range(200))
        if len(mission.tasks) > 10 and len(mission.robots) > 3 and len(mission.faults) > 2
    )


def test_only_what_the_failure_needs_is_left() -> None:
    """Here: two robots that share a task, and a fault of a robot."""

    def fails(document: Document) -> bool:
        if not is_mission(document):
            return False
        mission = mission_of(document)
        shares = any(len(mission.able(task)) > 1 for task in mission.tasks)
        return shares and any("robot" in fault for fault in document["faults"])

    document = large()
    document["faults"].append({"at": 1.2345, "kind": "mute", "robot": next(iter(document["robots"]))})
    small = shrink(document, fails)
    assert fails(small)
    assert (len(small["tasks"]), len(small["robots"]), len(small["faults"])) == (1, 2, 1)
    assert small["parameters"] == {}
    assert len(small["phases"]) == 1
    assert len(text_of(small).splitlines()) < 16


def test_what_never_fails_again_stays_as_it_is() -> None:
    document = large()
    assert shrink(document, lambda _: False) == document


def test_it_ends_whatever_fails() -> None:
    tried: list[Document] = []

    def fails(document: Document) -> bool:
        tried.append(document)
        return True

    small = shrink(large(), fails, budget=300)
    assert len(tried) <= 300
    assert not small["faults"]


def test_it_ends_where_failures_come_and_go() -> None:
    count = 0

    def fails(_: Document) -> bool:
        nonlocal count
        count += 1
        return count % 3 == 0

    shrink(large(), fails, budget=250)
    assert count <= 250


def test_the_given_document_is_not_touched() -> None:
    document = large()
    before = text_of(document)
    shrink(document, is_mission)
    assert text_of(document) == before


def test_a_mission_that_breaks_an_invariant_is_made_small(monkeypatch: Any) -> None:
    """A robot with three tasks or more is taken for a defect."""

    def broken(mission: Any) -> tuple[None, list[Violation]]:
        many = [robot for robot, spec in mission.robots.items() if len(spec.tasks) >= 3]
        return None, [Violation("few_tasks", robot) for robot in many]

    monkeypatch.setattr("lalliance_study.campaign.try_mission", broken)
    number = next(number for number in range(100) if broken(draw_mission(8, number)[1])[1])
    small = make_small(8, Failure(number, (Violation("few_tasks", "r0"),)))
    assert breaks(small, "few_tasks")
    assert not breaks(small, "many_tasks")
    assert (len(small["tasks"]), len(small["robots"])) == (3, 1)
