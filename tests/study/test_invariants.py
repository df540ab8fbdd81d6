"""Each invariant can fail: true evidence is falsified, and the judge sees it. A check that cannot fail is none."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import pytest

from lalliance_agents.mission_file import parse_mission
from lalliance_study.evidence import Choice, Evidence, Sight, gather
from lalliance_study.invariants import INVARIANTS, judge
from lalliance_study.logbook import Line

CRASH = """
name: crash
tasks: {a: {}, b: {after: [a], arrives: 1}}
robots: {one: {tasks: {a: 4, b: 2}}, two: {tasks: {a: 6, b: 3}}}
parameters: {min_delay: 0.1, max_delay: 0.3}
knowledge: given
faults: [{at: 2, robot: one, kind: crash}]
deadline: 300
"""

TWO_TRIALS = """
name: trials
tasks: {a: {}, b: {}}
robots: {one: {tasks: {a: 2}}, two: {tasks: {b: 2}}}
phases: [{trials: 2}]
deadline: 300
"""

RULES = """
name: rules
tasks: {a: {}, b: {}}
robots: {one: {tasks: {a: 8}}, two: {tasks: {b: 8, a: 30}}, three: {tasks: {b: 40}}}
parameters: {min_delay: 0.1, max_delay: 0.3}
knowledge: given
faults:
  - {at: 0.5, robot: one, kind: slow, factor: 1.5}
  - {at: 1, until: 3, robot: two, kind: hang}
  - {at: 0.5, robot: three, kind: blind, until: 4}
  - {at: 4, robot: two, kind: stuck, task: b, until: 5}
  - {at: 5, until: 9.5, link: {from: one, to: two}, loss: 0.9}
  - {at: 10, until: 11, robot: two, kind: mute}
deadline: 300
"""

CAUGHT = {
    name: gather(parse_mission(text, name))
    for name, text in {"crash": CRASH, "trials": TWO_TRIALS, "rules": RULES}.items()
}


def fresh(name: str) -> Evidence:
    return replace(CAUGHT[name], summary=deepcopy(CAUGHT[name].summary))


def edit_log(evidence: Evidence, change: Callable[[Line], Line | None]) -> Evidence:
    return replace(evidence, log=[line for line in map(change, evidence.log) if line is not None])


def edit_notes(evidence: Evidence, change: Callable[[Sight | Choice], Sight | Choice | None]) -> Evidence:
    return replace(evidence, notes=[note for note in map(change, evidence.notes) if note is not None])


def broken(evidence: Evidence) -> set[str]:
    return {one.invariant for one in judge(evidence)}


def facts(evidence: Evidence, invariant: str) -> str:
    return " | ".join(one.facts for one in judge(evidence) if one.invariant == invariant)


def is_takeover(line: Line) -> bool:
    return (line.who, line.what, line.task) == ("two", "activate", "a")


@pytest.mark.parametrize("name", CAUGHT)
def test_true_evidence_breaks_nothing(name: str) -> None:
    assert judge(fresh(name)) == []


def test_the_evidence_holds_what_is_falsified_below() -> None:
    crash, rules = fresh("crash"), fresh("rules")
    assert [one["cause"] for one in crash.summary["takeovers"]] == ["silence"]
    assert [report["fired"] for report in rules.summary["faults"]] == [True] * 6
    assert len(fresh("trials").summary["trials"]) == 2


def test_a_promised_mission_that_does_not_complete() -> None:
    evidence = fresh("crash")
    evidence.summary.update(complete=False, makespan=None)
    evidence.summary["tasks"]["b"]["completed_at"] = None
    assert "open b; sound robots {'b': ['two']}" in facts(evidence, "completes")


def test_a_mission_that_is_not_promised_need_not_complete() -> None:
    evidence = fresh("crash")
    evidence.summary.update(complete=False, makespan=None)
    evidence = replace(evidence, mission=evidence.mission.model_copy(update={"deadline": 3.0}))
    assert "completes" not in broken(evidence)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (Line(1.5, "one", "activate", "b", "free", None), "activates b while a is active"),
        (Line(1.5, "one", "yield", "b", "contender", "two"), "ends b (yield) while a is active"),
        (Line(2.6, "one", "give_up", "a", "no_success", None), "while its process does not run"),
        (Line(1.5, "one", "process", None, "started", None), "is started while it runs"),
    ],
)
def test_a_robot_that_does_two_things_at_once_or_none(line: Line, says: str) -> None:
    evidence = fresh("crash")
    evidence = replace(evidence, log=sorted([*evidence.log, line], key=lambda one: one.at))
    assert says in facts(evidence, "one_set_at_most")


def test_a_task_that_the_robot_cannot_do() -> None:
    evidence = edit_notes(fresh("trials"), lambda note: note._replace(task="b") if note.robot == "one" else note)
    assert "one decides about b, which it cannot do" in facts(evidence, "own_tasks_only")


@pytest.mark.parametrize(
    ("seen", "says"),
    [
        ({"applicable": False}, "that it is not applicable"),
        ({"complete": True}, "that it is complete"),
    ],
)
def test_a_task_that_is_not_sensed_as_open(seen: dict[str, bool], says: str) -> None:
    def change(note: Sight | Choice) -> Sight | Choice:
        return note._replace(**seen) if isinstance(note, Sight) and note.applicable else note

    assert says in facts(edit_notes(fresh("crash"), change), "only_what_is_open")


def test_a_task_that_was_not_sensed_at_all_and_one_taken_against_a_factor() -> None:
    blind = edit_notes(fresh("crash"), lambda note: None if isinstance(note, Sight) else note)
    assert "senses nothing of it" in facts(blind, "only_what_is_open")
    unready = edit_notes(fresh("crash"), lambda note: note._replace(ready=False) if isinstance(note, Choice) else note)
    assert "while a factor of its motivation is 0" in facts(unready, "only_what_is_open")


def test_a_robot_that_stays_on_a_complete_task() -> None:
    def late(line: Line) -> Line:
        return line._replace(at=line.at + 0.15) if line.why == "sensed" else line

    def also_late(note: Sight | Choice) -> Sight | Choice:
        return note._replace(at=note.at + 0.15) if isinstance(note, Choice) and note.cause == "sensed" else note

    stays = edit_notes(edit_log(fresh("trials"), late), also_late)
    assert "one sensed at" in facts(stays, "leaves_what_is_closed")
    never = edit_log(fresh("trials"), lambda line: None if line.why == "sensed" else line)
    never = edit_notes(never, lambda note: None if isinstance(note, Choice) and note.cause == "sensed" else note)
    assert "was on it until" in facts(never, "leaves_what_is_closed")


def test_a_silence_that_is_too_short() -> None:
    evidence = edit_notes(
        fresh("crash"), lambda note: note._replace(silent_for=0.9) if isinstance(note, Choice) else note
    )
    assert "because of silence after 0.900 s, tau is 1 s" in facts(evidence, "silence_is_long")


def test_a_contender_that_is_not_heard() -> None:
    def change(note: Sight | Choice) -> Sight | Choice:
        return note._replace(verb="yield", silent_for=1.1) if isinstance(note, Choice) else note

    told = facts(edit_notes(fresh("crash"), change), "contenders_are_heard")
    assert "one yields a to a teammate that it has not heard on it for 1.100 s, tau is 1 s" in told


def test_a_completion_that_is_not_sensed() -> None:
    evidence = edit_notes(fresh("trials"), lambda note: None if isinstance(note, Sight) and note.complete else note)
    assert "completions_are_sensed" not in broken(evidence)  # the trial ends before they must have
    evidence = edit_notes(fresh("crash"), lambda note: None if isinstance(note, Sight) and note.complete else note)
    assert "two has not sensed by" in facts(evidence, "completions_are_sensed")


@pytest.mark.parametrize("cause", ["sensed", "inapplicable"])
def test_a_set_that_ends_for_another_reason_than_is_sensed(cause: str) -> None:
    def change(note: Sight | Choice) -> Sight | Choice:
        return note._replace(complete=cause != "sensed") if isinstance(note, Sight) else note._replace(cause=cause)

    assert f"as {cause}, but senses it as" in facts(edit_notes(fresh("trials"), change), "causes_are_sensed")
    blind = edit_notes(fresh("trials"), lambda note: None if isinstance(note, Sight) else note)
    assert "senses nothing of it" in facts(blind, "causes_are_sensed")


@pytest.mark.parametrize(
    "cut",
    [
        "{at: 0, partition: [one, two]}",
        "{at: 0, robot: one, kind: mute}",
        "{at: 0, robot: two, kind: deaf}",
        "{at: 0, link: {from: one}, cut: true}",
    ],
)
def test_a_robot_that_hears_what_is_cut_off(cut: str) -> None:
    heard = fresh("crash")
    mission = parse_mission(CRASH.replace("faults: [", f"faults: [{cut}, "), "cut")
    assert "what_is_cut_off_is_silent" not in broken(gather(mission))
    deaf = replace(heard, mission=mission)
    deaf.summary["faults"].insert(0, gather(mission).summary["faults"][0])
    assert "two has heard one on a at" in facts(deaf, "what_is_cut_off_is_silent")


COLLISION = """
name: collision
tasks: {a: {}}
robots: {one: {tasks: {a: 3}}, two: {tasks: {a: 3}}}
parameters: {min_delay: 0.1, max_delay: 0.1}
knowledge: given
control_period: 0.01
deadline: 300
"""


def test_a_collision_that_nobody_yields_to() -> None:
    """Both begin within one message delay, which happens with some seeds only."""
    missions = [parse_mission(f"{COLLISION}seed: {seed}\n", "collision") for seed in range(60)]
    evidence = next(one for one in map(gather, missions) if any(line.why == "collision" for line in one.log))
    assert judge(evidence) == []
    assert [line.who for line in evidence.log if line.why == "collision"] == ["two"]
    both = edit_log(evidence, lambda line: None if line.why == "collision" else line)
    assert "two has not yielded by" in facts(both, "collisions_are_settled")


def test_a_log_that_goes_back_in_time() -> None:
    evidence = fresh("crash")
    assert "is logged after" in facts(replace(evidence, log=evidence.log[::-1]), "time_goes_on")


@pytest.mark.parametrize(
    ("task", "change", "says"),
    [
        ("a", {"by": ["one"]}, "credited to one"),
        ("a", {"by": []}, "completed by nobody"),
        ("b", {"completed_at": 0.5}, "is completed at 0.500 s, but opened at"),
        ("a", {"completed_at": 4.6}, "of its work done"),
    ],
)
def test_credit_that_is_not_due(task: str, change: dict[str, object], says: str) -> None:
    evidence = fresh("crash")
    evidence.summary["tasks"][task].update(change)
    assert says in facts(evidence, "credit_is_due")


def test_a_task_that_is_completed_twice_or_by_no_event() -> None:
    evidence = fresh("crash")
    done = [line for line in evidence.log if line.what == "complete" and "completed by" in line.why]
    twice = replace(evidence, log=sorted([*evidence.log, done[0]], key=lambda line: line.at))
    assert "a is completed twice in trial 1" in facts(twice, "credit_is_due")
    lost = edit_log(evidence, lambda line: None if line == done[0] else line)
    assert "nobody completed a" in facts(lost, "credit_is_due")


def test_attempts_that_nobody_made() -> None:
    evidence = fresh("trials")
    evidence.summary["tasks"]["a"]["attempts"].append({"robot": "two", "at": 1.0, "ended": None})
    assert "an attempt of two at a is told, which cannot do it" in facts(evidence, "attempts_are_real")
    evidence = fresh("crash")
    evidence.summary["tasks"]["a"]["attempts"].insert(0, {"robot": "two", "at": 2.9, "ended": None})
    told = facts(evidence, "attempts_are_real")
    assert "an attempt of two at a is told at 2.900 s, when it was not on it" in told
    assert "not in order of time" in told


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"to": "one"}, "it is the same robot"),
        ({"from": "two", "to": "one"}, "the former had never begun it"),
        ({"taken_at": 9.0}, "the latter did not begin it then"),
        ({"detected_at": 99.0}, "it was noticed later"),
        ({"failed_at": 99.0}, "the former failed later"),
        ({"after_failure": -1.0}, "the former failed later"),
    ],
)
def test_takeovers_that_were_none(change: dict[str, object], says: str) -> None:
    evidence = fresh("crash")
    evidence.summary["takeovers"][0].update(change)
    if change == {"from": "two", "to": "one"}:
        evidence.summary["tasks"]["a"]["attempts"] = evidence.summary["tasks"]["a"]["attempts"][:1]
    assert says in facts(evidence, "takeovers_are_real")


def test_totals_that_do_not_agree() -> None:
    for name, change, says in (
        ("messages", {"received": 10**6}, "messages came or were dropped"),
        ("messages", {"sent": -1}, "a counter is negative"),
        ("control", {"missed": -1}, "a counter is negative"),
    ):
        evidence = fresh("crash")
        evidence.summary[name].update(change)
        assert says in facts(evidence, "totals_agree")
    for change, says in (
        ({"makespan": 1.0}, "the makespan is 1.0"),
        ({"trials": [1.0]}, "but the last task was completed at"),
        ({"complete": False}, "is not complete, but its makespan"),
        ({"complete": False, "makespan": None}, "its deadline is 300 s"),
    ):
        evidence = fresh("trials")
        evidence.summary.update(change)
        assert says in facts(evidence, "totals_agree")
    evidence = fresh("trials")
    evidence.summary["tasks"]["a"]["completed_at"] = 301.0
    assert "outside of the mission" in facts(evidence, "totals_agree")
    evidence.summary["trials"].append(2.0)
    assert "2 trials began, 3 are told" in facts(evidence, "totals_agree")


def test_a_silent_robots_task_that_nobody_takes() -> None:
    evidence = edit_log(fresh("crash"), lambda line: None if line.who == "two" and line.task == "a" else line)
    evidence.summary["tasks"]["a"]["completed_at"] = None
    told = facts(evidence, "is_taken_again")
    assert told.startswith("one on a was killed at 2.051, and two, which is idle and can do it, has not taken it by 3.")


LIMITS = """
name: limits
tasks: {a: {}, b: {arrives: 20}}
robots: {one: {tasks: {a: 2, b: 2}}, two: {tasks: {a: 3}}}
parameters: {min_delay: 0.1, max_delay: 0.3, ordering: modified_shortest_first}
knowledge: given
faults: [{at: 0, robot: one, kind: stuck, task: a, until: 12}, {at: 0, robot: two, kind: stuck, until: 11}]
deadline: 300
"""


def test_limits_that_are_not_kept() -> None:
    """One is stuck on a, two loses its patience after 3 s, one yields, takes a again, and so on."""
    evidence = gather(parse_mission(LIMITS, "limits"))
    assert judge(evidence) == []
    told = [
        f"{line.who} {line.what} {line.why}" for line in evidence.log if line.task == "a" and line.what != "takeover"
    ]
    assert told[:3] == ["one activate free", "two activate impatience", "one yield contender"]

    patient = edit_log(evidence, lambda line: None if line.who == "two" and line.task == "a" else line)
    stays = edit_log(
        patient, lambda line: None if line.who == "one" and line.task == "a" and line.why != "free" else line
    )
    assert "two, which is idle and can do it, has not taken it by" in facts(stays, "patience_ends")
    assert "one is on a since " in facts(stays, "attempts_are_limited")
    both = edit_log(evidence, lambda line: line if line.what in {"activate", "process", "trial"} else None)
    assert "but one has not yielded by" in facts(both, "contenders_make_yield")


def test_work_at_a_pace_of_nothing_is_no_work() -> None:
    """Two tasks that a slow and a stuck robot are said to have done in the time of a sound one."""
    slow = fresh("rules")
    slow.summary["tasks"]["a"]["completed_at"] = 9.0
    assert "of its work done by one" in facts(slow, "credit_is_due")
    evidence = gather(parse_mission(LIMITS, "limits"))
    evidence.summary["tasks"]["a"].update(completed_at=9.0, by=["two"])
    assert "a is complete with 0.0% of its work done" in facts(evidence, "credit_is_due")


def test_a_busy_robot_need_not_take_it() -> None:
    evidence = fresh("crash")
    busy = Line(1.0, "two", "activate", "b", "free", None)
    evidence = edit_log(evidence, lambda line: None if line.who == "two" and line.task == "a" else line)
    evidence = replace(evidence, log=sorted([*evidence.log, busy], key=lambda line: line.at))
    assert "is_taken_again" not in broken(evidence)


@pytest.mark.parametrize("number", [0, 2, 3, 4, 5])
def test_a_fault_that_never_fired(number: int) -> None:
    evidence = fresh("rules")
    evidence.summary["faults"][number].update(fired=False, fired_at=None, count=0)
    assert f"{number + 1}-" in facts(evidence, "faults_fire")
    assert "never fired although it was due" in facts(evidence, "faults_fire")


@pytest.mark.parametrize(("name", "number", "why"), [("crash", 0, "killed"), ("rules", 1, "stopped")])
def test_a_process_that_goes_on(name: str, number: int, why: str) -> None:
    evidence = fresh(name)
    evidence.summary["faults"][number].update(fired=False, fired_at=None, count=0)
    evidence = edit_log(evidence, lambda line: None if line.why == why else line)
    assert f"{number + 1}-" in facts(evidence, "faults_fire")


def test_a_fault_without_an_occasion_need_not_fire() -> None:
    text = RULES.replace("robot: three, kind: blind, until: 4", "robot: three, kind: stuck, until: 0.6")
    evidence = gather(parse_mission(text, "no occasion"))
    assert [report["fired"] for report in evidence.summary["faults"]].count(False) == 1
    assert judge(evidence) == []


@pytest.mark.parametrize(
    ("name", "number", "change", "says"),
    [
        ("rules", 0, {"count": 0}, "is told to have fired: True, 0 times"),
        ("rules", 0, {"fired_at": 0.1}, "out of its time"),
        ("rules", 5, {"fired_at": 14.0}, "out of its time"),
        ("rules", 4, {"fired": False}, "is told to have fired: False"),
    ],
)
def test_a_fault_that_cannot_have_fired(name: str, number: int, change: dict[str, object], says: str) -> None:
    evidence = fresh(name)
    evidence.summary["faults"][number].update(change)
    assert says in facts(evidence, "what_fired_was_there")


def test_a_fault_that_fired_on_nobody() -> None:
    for name, why, says in (("crash", "killed", "one was killed then"), ("rules", "stopped", "two was stopped then")):
        evidence = edit_log(fresh(name), lambda line, why=why: None if line.why == why else line)
        assert says in facts(evidence, "what_fired_was_there")
    idle = edit_log(fresh("rules"), lambda line: None if line.who == "one" and line.what == "activate" else line)
    assert "1-slow fired, but one was on no task then" in facts(idle, "what_fired_was_there")


def test_all_invariants_were_shown_to_fail() -> None:
    """By the tests above, whose text names each; and each says in one sentence what must hold."""
    text = Path(__file__).read_text()
    for name, invariant in INVARIANTS.items():
        assert f'"{name}"' in text
        assert (invariant.__doc__ or "").split("\n")[0].endswith(".")
