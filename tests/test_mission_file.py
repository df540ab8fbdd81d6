"""Mission files as people write them: what loads, and the one sentence that each mistake gets.

The tables are literal: a change of a mission on the left, the whole sentence on the right.
"""

import random
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field, ValidationError

from lalliance_agents.config import Mission, misplaced
from lalliance_agents.errors import MissionError
from lalliance_agents.faults import RadioFault
from lalliance_agents.mission_file import (
    LARGEST,
    MissionText,
    load_mission,
    load_mission_text,
    parse_mission,
    read_fault,
)
from lalliance_agents.model.parameters import Learning, Ordering, Positive, Record, Strategy

DEPOT = """\
name: depot
tasks: {a: {}, b: {after: [a]}}
robots:
  r1:
    tasks: {a: 8, b: 4}
  r2: {tasks: {b: 9}}
"""

WAREHOUSE = """\
name: warehouse
environment: {kind: task_pool, hand_over: shared_max}
tasks: {crate-1: {}, crate-2: {after: [crate-1]}, barrel-1: {arrives: 20}}
robots:
  lifter: {tasks: {crate-1: 8, crate-2: 8}}               # own time in seconds
  pusher: {tasks: {crate-1: 20, crate-2: 20, barrel-1: 10}}
parameters: {strategy: II, ordering: derived, broadcast_rate: 5, silence_timeout: 1.0, min_delay: 0.2, max_delay: 1.0}
phases: [{learning: active, trials: 5}, {learning: adaptive}]
faults:
  - {at: 6, robot: lifter, kind: crash}
deadline: 300
seed: 7
"""


def sentence(text: str) -> str:
    with pytest.raises(MissionError) as caught:
        parse_mission(text, "x.yaml")
    return str(caught.value)


def test_the_documented_example_loads() -> None:
    mission = parse_mission(WAREHOUSE, "warehouse.yaml")
    assert mission.name == "warehouse"
    assert mission.environment.kind == "task_pool"
    assert mission.environment.options == {"hand_over": "shared_max"}
    assert list(mission.tasks) == ["crate-1", "crate-2", "barrel-1"]
    assert mission.tasks["crate-2"].after == ("crate-1",)
    assert mission.tasks["barrel-1"].arrives == 20
    assert mission.robots["pusher"].tasks == {"crate-1": 20, "crate-2": 20, "barrel-1": 10}
    assert mission.parameters.strategy is Strategy.II
    assert mission.parameters.ordering is Ordering.DERIVED
    assert [(phase.learning, phase.trials) for phase in mission.phases] == [
        (Learning.ACTIVE, 5),
        (Learning.ADAPTIVE, 1),
    ]
    assert [(fault.at, fault.robot, fault.kind) for fault in mission.faults] == [(6, "lifter", "crash")]
    assert (mission.deadline, mission.seed) == (300, 7)


def test_what_is_not_said_follows_what_is() -> None:
    mission = parse_mission(DEPOT + "parameters: {max_delay: 2, broadcast_rate: 4.0}\n", "x.yaml")
    assert mission.parameters.effective_boredom_rate == pytest.approx(1 / 2.4)
    assert mission.parameters.effective_collision_window == 0.5
    assert (mission.deadline, mission.seed, mission.control_period) == (600, 0, 0.1)
    assert mission.live.learning is Learning.ADAPTIVE


def test_a_robot_overrides_parameters_in_the_spelling_of_the_file() -> None:
    own = "{b: 9}, parameters: {strategy: III, ordering: longest_first, readings: {credit: literal}}"
    mission = parse_mission(DEPOT.replace("{b: 9}", own) + "parameters: {max_delay: 0.5}", "x.yaml")
    assert mission.parameters_of("r1").strategy is Strategy.II
    assert mission.parameters_of("r2").strategy is Strategy.III
    assert mission.parameters_of("r2").ordering is Ordering.LONGEST_FIRST
    assert mission.parameters_of("r2").max_delay == 0.5


def test_anchors_and_merge_keys_serve_to_write_a_team() -> None:
    text = "name: x\ntasks: {a: }\nrobots:\n  r1: &r {tasks: {a: 1e1}, joins: 3}\n  r2: {joins: 4, <<: *r}\n"
    mission = parse_mission(text, "x.yaml")
    assert [(robot.tasks, robot.joins) for robot in mission.robots.values()] == [({"a": 10}, 3), ({"a": 10}, 4)]


NOT_A_DOCUMENT = {
    "": "x.yaml: the file is empty; expected a mission",
    "# nothing\n": "x.yaml: the file is empty; expected a mission",
    "~": "x.yaml:1: the file holds nothing; expected a mapping with name, tasks and robots",
    "\n- a\n": "x.yaml:2: the file holds a list; expected a mapping with name, tasks and robots",
    "a: b: c": "x.yaml:1:5: not readable as YAML: mapping values are not allowed here; expected a space after each "
    "colon, quotes around text with a colon, and the entries of one mapping at the same indentation",
    "a:\n  b: 1\n   c: 2": "x.yaml:3:5: not readable as YAML: mapping values are not allowed here; expected a space after "
    "each colon, quotes around text with a colon, and the entries of one mapping at the same indentation",
    "a:\n  b: {}\n   c: {}": "x.yaml:3:4: not readable as YAML: while parsing a block mapping, expected <block end>, but "
    "found '<block mapping start>'; expected the entries of one mapping or list at the same indentation",
    "a:\n  [1": "x.yaml:2:5: not readable as YAML: while parsing a flow sequence, expected ',' or ']', "
    "but got '<stream end>'",
    "a: 1\n\tb: 2": "x.yaml:2:1: not readable as YAML: while scanning for the next token, found character '\\t' "
    "that cannot start any token; expected spaces instead of the tab",
    "a: *x": "x.yaml:1:4: not readable as YAML: found undefined alias 'x'",
    "a: 1\n---\nb: 2\n": "x.yaml:2:1: not readable as YAML: expected a single document in the stream, "
    "but found another document",
    "a:\n b: \x07": "x.yaml:2:5: not readable as YAML: the character '\\x07' is not allowed",
    "a: " + "[" * 99: "x.yaml:1:52: not readable as YAML: nested deeper than 50 levels",
    "a: &a [*a]": "x.yaml:1: a.0: contains itself; expected a mission without such aliases",
    "name: !!python/object/apply:os.system [ls]": "x.yaml:1: name: the tag !!python/object/apply:os.system is not "
    "allowed; expected a plain value",
    "a: !mine b": "x.yaml:1: a: the tag !mine is not allowed; expected a plain value",
    "a: !!int b": "x.yaml:1: a: b is not read alike by all; expected a plain number like 12 or 0.5, or text in "
    "quotes: 'b'",
    "a: 1\n? [b]\n: 3": "x.yaml:2: a list or a mapping cannot be a key; expected text",
    "{{name}}: 1": "x.yaml:1: a list or a mapping cannot be a key; expected text",
    "<<: 3": "x.yaml:1: << names a number; expected a mapping",
    'name: "\\ud800"': "x.yaml:1: name: '\\ud800' holds half a character; expected whole ones",
    "name: x\ntasks: {}\nname: y\n": "x.yaml:3: name: given twice, in lines 1 and 3; expected it once",
    "on: 1\n1: 2\n": "x.yaml:1: the key on is a truth value in YAML; expected text in quotes: 'on' (and 1 more)",
}


@pytest.mark.parametrize(("text", "expected"), NOT_A_DOCUMENT.items())
def test_text_that_is_no_document(text: str, expected: str) -> None:
    assert sentence(text) == expected


REPLACED = {
    ("name: depot\n", ""): "1: a field is missing; expected a field 'name'",
    ("name: depot", "name: no"): "1: name: no is a truth value; expected text, in quotes: 'no'",
    ("name: depot", "name: 5"): "1: name: 5 is a number; expected text, in quotes: '5'",
    ("name: depot", "name: 2024-01-01"): "1: name: 2024-01-01 is a date in YAML; expected text in quotes: '2024-01-01'",
    ("name: depot", "name: ''"): "1: name: '' is not a name; expected 1 to 64 of A-Z a-z 0-9 _ -",
    ("name: depot", "name: dépôt"): "1: name: 'dépôt' is not a name; expected 1 to 64 of A-Z a-z 0-9 _ -",
    ("depot", "x" * 65): f"1: name: '{'x' * 55} ... is not a name; expected 1 to 64 of A-Z a-z 0-9 _ -",
    ("{a: {}, b: {after: [a]}}", "[a, b]"): "2: tasks: ['a', 'b'] is a list; expected a mapping, as in {a: ...}",
    ("[a]", "a"): "2: tasks.b.after: 'a' is text; expected a list, as in [a]",
    ("[a]", "[c]"): "2: tasks.b.after.0: 'c' is not a task of this mission; expected one of a, b",
    ("[a]", "[a, a]"): "2: tasks.b.after.1: 'a' is listed twice; expected it once",
    ("[a]", "[b]"): "2: tasks.b.after: the prerequisites form a circle: b after b",
    ("{a: {},", "{a: {after: [b]},"): "2: tasks.a.after: the prerequisites form a circle: a after b after a",
    ("{a: {},", "{c: {}, a: {},"): "2: tasks.c: no robot can do this task; expected at least one robot that lists it",
    ("{a: {},", "{a: {arrives: 600},"): "2: tasks.a.arrives: 600 s is not before the mission's deadline; "
    "expected less than 600 s",
    ("    tasks:", "    task:"): "5: robots.r1.task: unknown field; did you mean 'tasks'?",
    ("{a: 8, b: 4}", ""): "5: robots.r1.tasks: nothing is given; expected a mapping",
    ("{a: 8, b: 4}", "{}"): "5: robots.r1.tasks: {} is not allowed; expected 1 or more entries",
    ("a: 8", "a: -3"): "5: robots.r1.tasks.a: -3 is not allowed; expected a number greater than 0",
    ("a: 8", "a: eight"): "5: robots.r1.tasks.a: 'eight' is text; expected a number",
    ("a: 8", "a: 8s"): "5: robots.r1.tasks.a: '8s' is text; expected a number without a unit",
    ("a: 8", "a: 8.5 min"): "5: robots.r1.tasks.a: '8.5 min' is text; expected a number without a unit",
    ("a: 8", "a: '8'"): "5: robots.r1.tasks.a: '8' is text; expected a number without quotes",
    ("a: 8", "a: yes"): "5: robots.r1.tasks.a: yes is a truth value; expected a number",
    ("a: 8", "a: [8]"): "5: robots.r1.tasks.a: [8] is a list; expected a number",
    ("a: 8", "a:"): "5: robots.r1.tasks.a: nothing is given; expected a number",
    ("a: 8", "a: .nan"): "5: robots.r1.tasks.a: .nan is not allowed; expected a finite number",
    ("a: 8", "a: -.inf"): "5: robots.r1.tasks.a: -.inf is not allowed; expected a finite number",
    ("a: 8", "a: 1e308"): "5: robots.r1.tasks.a: 1e308 is not allowed; expected a number of at most 1000000000",
    ("a: 8", "a: 10:00"): "5: robots.r1.tasks.a: 10:00 is not read alike by all; expected a plain number like 12 or "
    "0.5, or text in quotes: '10:00'",
    ("a: 8", "a: 010"): "5: robots.r1.tasks.a: 010 is not read alike by all; expected a plain number like 12 or 0.5, "
    "or text in quotes: '010'",
    ("a: 8", "aa: 8"): "5: robots.r1.tasks.aa: 'aa' is not a task of this mission; did you mean 'a'?",
    ("a: 8", "a/b: 8"): "5: robots.r1.tasks: 'a/b' is not a name; expected 1 to 64 of A-Z a-z 0-9 _ -",
    ("{a: 8, b: 4}", "{a:8}"): "5: robots.r1.tasks: 'a:8' is not a name; expected 1 to 64 of A-Z a-z 0-9 _ -, and a "
    "space after a colon (and 1 more)",
    ("a: 8", "1: 8"): "5: robots.r1.tasks: the key 1 is a number in YAML; expected text in quotes: '1'",
    ("a: 8", "a: 8, a: 9"): "5: robots.r1.tasks.a: given twice, in line 5; expected it once",
    ("{b: 9}", "{b: 9}, joins: 700"): "6: robots.r2.joins: 700 s is not before the mission's deadline; "
    "expected less than 600 s",
    ("{b: 9}", "{b: 9}, behaviors: arm"): "6: robots.r2.behaviors: 'arm' is not allowed; "
    "expected package.module:factory",
    ("{b: 9}", "{b: 9}, parameters: {strateg: II}"): "6: robots.r2.parameters.strateg: unknown field; "
    "did you mean 'strategy'?",
    ("{b: 9}", "{b: 9}, parameters: {trials: true}"): "6: robots.r2.parameters.trials: true is a truth value; "
    "expected a whole number",
    ("{b: 9}", "{b: 9}, parameters: {trials: x, max_delay: -1}"): "6: robots.r2.parameters.trials: 'x' is text; "
    "expected a whole number (and 1 more)",
    ("{b: 9}", "{b: 9}, parameters: {max_delay: 0.1}"): "6: robots.r2.parameters: max_delay 0.1 s is below "
    "min_delay 0.2 s",
    ("{b: 9}", "{b: 9}, parameters: {by_hand_tasks: {c: }}"): "6: robots.r2.parameters.by_hand_tasks.c: nothing is "
    "given; expected a mapping",
    ("{b: 9}", "{b: 9}, parameters: {broadcast_rate: 20}"): "6: robots.r2.parameters.broadcast_rate: robot r2 cannot "
    "send 20 messages/s with a control_period of 0.1 s; expected at most 10",
}


@pytest.mark.parametrize(("change", "expected"), REPLACED.items())
def test_a_mistake_in_the_depot(change: tuple[str, str], expected: str) -> None:
    assert change[0] in DEPOT
    assert sentence(DEPOT.replace(*change)) == f"x.yaml:{expected}"


ADDED = {
    "color: red": "color: unknown field; expected one of name, environment, tasks, robots, parameters, phases, faults, "
    "knowledge, control_period, deadline, seed",
    "dead_line: 4\nsed: 3": "dead_line: unknown field; did you mean 'deadline'? (and 1 more)",
    '"a\\nb": 3\nseed: 1': "'a\\nb': unknown field; expected one of name, environment, tasks, robots, parameters, "
    "phases, faults, knowledge, control_period, deadline, seed",
    "parameters:": "parameters: nothing is given; expected a mapping",
    "parameters: {strateg: II}": "parameters.strateg: unknown field; did you mean 'strategy'?",
    "parameters: {strategy: 2}": "parameters.strategy: 2 is not allowed; expected one of I, II, III",
    "parameters: {ordering: longest}": "parameters.ordering: 'longest' is not allowed; expected one of derived, "
    "modified_shortest_first, modified_random, longest_first; did you mean 'longest_first'?",
    "parameters: {trials: 1.5}": "parameters.trials: 1.5 is not allowed; expected a whole number",
    "parameters: {readings: {credit: lit}}": "parameters.readings.credit: 'lit' is not allowed; expected one of "
    "literal, mended; did you mean 'literal'?",
    "parameters: {architecture: aliance}": "parameters.architecture: 'aliance' is not allowed; expected one of "
    "l-alliance, alliance; did you mean 'alliance'?",
    "parameters: {max_delay: 0.1}": "parameters: max_delay 0.1 s is below min_delay 0.2 s",
    "parameters: {by_hand: {patience: '5'}}": "parameters.by_hand.patience: '5' is text; expected a number "
    "without quotes",
    "parameters: {by_hand_tasks: {aa: {}}}": "parameters.by_hand_tasks.aa: 'aa' is not a task of this mission; "
    "did you mean 'a'?",
    "phases: []": "phases: [] is not allowed; expected 1 or more entries",
    "phases: {learning: active}": "phases: {'learning': 'active'} is a mapping; expected a list",
    "phases: [{learning: activ}]": "phases.0.learning: 'activ' is not allowed; expected one of active, adaptive; "
    "did you mean 'active'?",
    "phases: [{until: ful}]": "phases.0.until: 'ful' is not allowed; expected full; did you mean 'full'?",
    "phases: [{until: full}]": "phases.0: until: full needs learning: active, robots that are adaptive need not try "
    "all tasks",
    "phases: [{learning: active, until: full, trials: 3}]\nfaults: [{kind: crash, robot: r1, at: 3}]": "phases.0.until: "
    "faults and joins belong to the last trial, and until: full leaves open which one that is; expected a further "
    "phase after this one",
    "faults: [{kind: crash, robot: r1}]": "faults.0: a field is missing; expected a field 'at'",
    "faults: [{kind: crash, robot: rr2, at: 3}]": "faults.0.robot: 'rr2' is not a robot of this mission; "
    "did you mean 'r2'?",
    "faults: [{kind: crsh, robot: r1, at: 1}]": "faults.0.kind: 'crsh' is not allowed; expected one of crash, "
    "hang, stuck, slow, mute, deaf, blind; did you mean 'crash'?",
    "faults: [{kind: slow, robot: r1, at: 1, factor: 2, loss: 0.1}]": "faults.0.loss: unknown field; expected one of at, "
    "until, kind, robot, factor",
    "faults: [{link: {}, robot: r1, at: 1, cut: yes}]": "faults.0.robot: unknown field; expected one of at, until, link, "
    "loss, delay, duplicate, reorder, held, cut",
    "faults: [{kind: crash, robot: r1, at: 600}]": "faults.0.at: 600 s is not before the mission's deadline; "
    "expected less than 600 s",
    "faults: [{kind: crash, robot: r1, at: 1, restart: 'yes'}]": "faults.0.restart: 'yes' is text; "
    "expected true or false",
    "faults: [{kind: crash, robot: r1, at: 1, until: 1, restart: yes}]": "faults.0: until 1 s must come after at 1 s",
    "faults: [{kind: crash, robot: r1, at: 3}, {kind: crash, robot: r1, at: 1}]": "faults.1: at 3 s robot r1 is "
    "down from an earlier crash; expected no further fault of it (see faults.0)",
    "faults: [{kind: crash, robot: r1, at: 3, restart: on}, {kind: crash, robot: r1, at: 8}]": "faults.1: at 8 s "
    "robot r1 is down from an earlier crash; expected more than 8 s (see faults.0)",
    "faults: [{kind: hang, robot: r1, at: 3}, {kind: crash, robot: r1, at: 8}]": "faults.1: at 8 s robot r1 is down from "
    "an earlier hang; expected no further fault of it (see faults.0)",
    "faults: [{kind: crash, robot: r1, at: 3}, {kind: mute, robot: r1, at: 8}]": "faults.1: robot r1 is down from 3 s on; "
    "expected a time at which it is there (see faults.0)",
    "faults: [{kind: mute, robot: r1, at: 3}, {kind: mute, robot: r1, at: 8}]": "faults.1: robot r1 is mute already at that "
    "time; expected one fault of a kind at a time (see faults.0)",
    "faults: [{kind: crash, robot: r1, at: 3, until: 9}]": "faults.0: until 9 needs restart: true, a crashed robot does not "
    "return by itself",
    "faults: [{kind: slow, robot: r1, at: 3, factor: 0.5}]": "faults.0.factor: 0.5 is not allowed; expected a number greater "
    "than 1",
    "faults: [{kind: slow, robot: r1, at: 3}]": "faults.0: a field is missing; expected a field 'factor'",
    "faults: [{kind: stuck, robot: r2, at: 3, task: a}]": "faults.0.task: 'a' is not a task of robot r2; expected one of b",
    "faults: [{robot: r1, at: 3}]": "faults.0: a field is missing; expected a field 'kind'",
    "faults: [{at: -3, link: {}, loss: 0.5}]": "faults.0.at: -3 is not allowed; expected a number of at least 0",
    "faults: [{at: 3, link: {}, loss: 1.5}]": "faults.0.loss: 1.5 is not allowed; expected a number of at most 1",
    "faults: [{at: 3, link: {}, loss: {enter: 0.1}}]": "faults.0.loss: a field is missing; expected a field 'leave'",
    "faults: [{at: 3, kind: loss, link: {}, loss: 0.5}]": "faults.0.kind: 'loss' is not allowed; expected one of crash, hang, "
    "stuck, slow, mute, deaf, blind; loss is a field without a kind",
    "faults: [{at: 3, link: {}, los: 0.5}]": "faults.0.los: unknown field; did you mean 'loss'?",
    "faults: [{at: 3, link: {form: r1}, loss: 0.5}]": "faults.0.link.form: unknown field; did you mean 'from'?",
    "faults: [{at: 3, link: {from: r1}}]": "faults.0: the rule does nothing; expected loss, delay, duplicate, reorder or "
    "cut: true",
    "faults: [{at: 3, link: {from: r3}, loss: 0.5}]": "faults.0.link.from: 'r3' matches no robot of this "
    "mission; expected one of r1, r2",
    "faults: [{at: 3, link: {from: r/2}, loss: 0.5}]": "faults.0.link.from: 'r/2' is no name and no glob; expected 1 to 64 "
    "of A-Z a-z 0-9 _ - * ?",
    "faults: [{at: 3, link: {}, delay: {uniform: [2, 1]}}]": "faults.0.delay.uniform: the second number 1 s is below the "
    "first one 2 s",
    "faults: [{at: 3, link: {}, delay: {unifrm: [1, 2]}}]": "faults.0.delay.unifrm: unknown field; did you mean 'uniform'?",
    "faults: [{at: 3, link: {}, loss: 0.5}, {at: 5, link: {to: r2}, loss: 0.3}]": "faults.1: another rule sets loss from r1 "
    "to r2 at the same time; expected one of them (see faults.0)",
    "faults: [{at: 3, link: {from: r1, to: r1}, loss: 0.5}]": "faults.0.link: r1 is the only robot at both ends, and none "
    "hears itself; expected two different robots",
    "faults: [{at: 3, link: {from: '*1', to: [r1, '?1'], both: true}, cut: true}]": "faults.0.link: r1 is the only robot at "
    "both ends, and none hears itself; expected two different robots",
    "faults: [{at: 3, link: {from: []}, loss: 0.5}]": "faults.0.link.from: [] is not allowed; expected 1 or more entries",
    "faults: [{at: 3, link: {from: [r1, 5]}, loss: 0.5}]": "faults.0.link.from.1: 5 is a number; expected text, in quotes: "
    "'5'",
    "faults: [{at: 3, link: {from: 5}, loss: 0.5}]": "faults.0.link.from: 5 is a number; expected a list or text, in quotes: "
    "'5'",
    "faults: [{at: 3, partition: [[], []]}]": "faults.0.partition.0: [] is not allowed; expected 1 or more entries "
    "(and 1 more)",
    "faults: [{at: 3, link: {}, delay: {uniform: [1.0000001, 1]}}]": "faults.0.delay.uniform: the second number 1 s is "
    "below the first one 1.0000001 s",
    "faults: [{at: 3, partition: [r1]}]": "faults.0.partition: ['r1'] is not allowed; expected 2 or more entries",
    "faults: [{at: 3, partition: [r1, [r2, 'r*']]}]": "faults.0.partition.1: r1 is in two groups of the partition; expected "
    "it in one",
    "faults: [5]": "faults.0: 5 is a number; expected a mapping",
    "deadline: 0": "deadline: 0 is not allowed; expected a number greater than 0",
    "seed: 1.0": "seed: 1.0 is not allowed; expected a whole number",
    "seed: -1": "seed: -1 is not allowed; expected a number of at least 0",
    "knowledge: all": "knowledge: 'all' is not allowed; expected one of none, given",
    "control_period: 1e-9": "control_period: 1e-9 is not allowed; expected a number of at least 0.001",
    "environment: box_pushing": "environment: 'box_pushing' is text; expected a mapping",
    "environment: {kind: ''}": "environment.kind: '' is not allowed; expected the name of an environment or "
    "package.module:Class",
}


@pytest.mark.parametrize(("lines", "expected"), ADDED.items())
def test_a_mistake_below_the_depot(lines: str, expected: str) -> None:
    assert sentence(DEPOT + lines) == f"x.yaml:7: {expected}"


def test_the_first_error_by_line_is_told_and_the_others_are_counted() -> None:
    text = DEPOT.replace("a: 8", "a: -3").replace("b: 9", "b: -9") + "seed: x\ncolor: red\n"
    assert sentence(text) == (
        "x.yaml:5: robots.r1.tasks.a: -3 is not allowed; expected a number greater than 0 (and 3 more)"
    )


@pytest.mark.parametrize("at", ["4", "4.9999999999"])
def test_a_fault_of_a_robot_that_has_not_joined(at: str) -> None:
    text = DEPOT.replace("{b: 9}", "{b: 9}, joins: 5") + f"faults: [{{kind: crash, robot: r2, at: {at}}}]"
    assert (
        sentence(text) == f"x.yaml:7: faults.0.at: at {at} s robot r2 is not there; expected not before it joins, 5 s"
    )


NEVER_DONE = {
    "{at: 3, robot: r1, kind: crash}": ["tasks.a: no robot is left for it after crash of r1 at 3 s; if it"],
    "{at: 3, robot: r1, kind: hang}": ["tasks.a: no robot is left for it after hang of r1 at 3 s; if it"],
    "{at: 3, until: 5, robot: r1, kind: hang}": [],
    "{at: 3, robot: r1, kind: crash, restart: true}": [],
    "{at: 3, robot: r1, kind: stuck, task: b}": [],
    "{at: 3, robot: r1, kind: blind, delay: 1}": [],
    "{at: 3, robot: r2, kind: crash}": [],
    "{at: 3, robot: r1, kind: blind}, {at: 2, robot: r1, kind: stuck}, {at: 4, robot: r2, kind: stuck, task: b}": [
        "tasks.a: no robot is left for it after stuck of r1 at 2 s; if it",
        "tasks.b: no robot is left for it after stuck of r1 at 2 s and stuck of r2 at b at 4 s; if it",
    ],
}


@pytest.mark.parametrize("faults", NEVER_DONE)
def test_a_task_that_faults_leave_no_robot_for_is_warned_of(faults: str) -> None:
    mission = parse_mission(f"{DEPOT}parameters: {{max_delay: 0.3}}\nfaults: [{faults}]", "x.yaml")
    assert [warning[: warning.index("; if it") + 7] for warning in mission.warnings()] == NEVER_DONE[faults]


def test_a_task_without_a_robot_before_the_last_trial_is_warned_of() -> None:
    text = DEPOT.replace("tasks: {a: 8, b: 4}", "tasks: {a: 8, b: 4}\n    joins: 3") + "parameters: {max_delay: 0.3}\n"
    assert parse_mission(text, "x.yaml").warnings() == []
    trained = parse_mission(text + "phases: [{learning: active}, {}]", "x.yaml")
    assert trained.warnings() == ["tasks.a: its robots join in the last trial; those before it cannot complete"]


def test_a_silence_timeout_in_milliseconds_is_warned_of() -> None:
    text = DEPOT + "parameters: {max_delay: 0.3, silence_timeout: 1000}\n"
    assert parse_mission(text, "x.yaml").warnings() == [
        "parameters.silence_timeout: with 1000 s no failure is noticed before the deadline of 600 s"
    ]


def test_a_lone_robot_has_no_links() -> None:
    text = "name: x\ntasks: {a: }\nrobots: {r1: {tasks: {a: 1}}}\nfaults: [{at: 3, link: {}, loss: 0.5}]"
    assert sentence(text).startswith("x.yaml:4: faults.0.link: r1 is the only robot at both ends")
    pairs = ("{from: r1, to: 'r*'}", "{from: 'r*', to: r2}", "{}")
    for pair in pairs:
        parse_mission(DEPOT + f"faults: [{{at: 3, link: {pair}, loss: 0.5}}]", "x.yaml")


@pytest.mark.parametrize(("spelled", "shown"), [("1e999", ".inf"), ("-1e999", "-.inf"), ("NaN", ".nan")])
def test_a_fault_in_json_with_a_number_that_is_not_finite(spelled: str, shown: str) -> None:
    with pytest.raises(MissionError) as caught:
        read_fault(f'{{"kind": "slow", "robot": "NaN", "factor": {spelled}}}')
    assert str(caught.value) == f"factor: {shown} is not allowed; expected a finite number"
    assert read_fault('{"kind": "mute", "robot": "-Infinity"}') == RadioFault(at=0, kind="mute", robot="-Infinity")


def test_aliases_that_unfold_without_end_are_refused() -> None:
    text = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 20))
    assert sentence(text).endswith("unfolds to more than 200000 values; expected a mission without such aliases")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing, latin, large = tmp_path / "missing.yaml", tmp_path / "latin.yaml", tmp_path / "large.yaml"
    latin.write_bytes("name: x\n# dépôt".encode("latin-1"))
    large.write_text("#" * (LARGEST + 1))
    expected = {
        missing: "no such file; expected a mission file",
        tmp_path: "a directory; expected a mission file",
        latin: "line 2 is not UTF-8, byte 0xe9; expected a text file in UTF-8",
        large: "larger than 1048576 bytes; expected a mission file",
        latin / "x": "cannot be read: Not a directory",
    }
    for path, reason in expected.items():
        with pytest.raises(MissionError) as caught:
            load_mission(path)
        assert str(caught.value) == f"{path}: {reason}"
    assert sentence("#" * (LARGEST + 1)) == "x.yaml: larger than 1048576 bytes; expected a mission file"


def test_a_file_with_windows_line_ends_and_a_byte_order_mark_loads(tmp_path: Path) -> None:
    path = tmp_path / "depot.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + DEPOT.replace("\n", "\r\n").encode())
    assert load_mission(path) == parse_mission(DEPOT, "x.yaml")


class Uniform(Record):
    uniform: tuple[Positive, Positive]


class LogNormal(Record):
    lognormal: tuple[Positive, Positive]


class Wind(Record):
    kind: Literal["wind"]
    wind: Positive = 1


class Fog(Record):
    kind: Literal["fog"]
    since: Annotated[float, Field(alias="from")] = 0


class Options(Record):
    """The options of an environment that somebody made up."""

    delay: Positive | Uniform | LogNormal = 1
    weather: tuple[Annotated[Wind | Fog, Field(discriminator="kind")], ...] = ()


OPTIONS = {
    "delays: 3": "delays: unknown field; did you mean 'delay'?",
    "delay: fast": "delay: 'fast' is text; expected a number or a mapping",
    "delay: -1": "delay: -1 is not allowed; expected a number greater than 0",
    "delay: {uniform: 3}": "delay.uniform: 3 is a number; expected a list",
    "delay: {uniform: [1]}": "delay.uniform: an entry is missing; expected 2 or more entries",
    "delay: {lognormal: [1, -2]}": "delay.lognormal.1: -2 is not allowed; expected a number greater than 0",
    "delay: {unifrm: [1, 2]}": "delay.unifrm: unknown field; did you mean 'uniform'?",
    "weather: [{kind: rain}]": "weather.0.kind: 'rain' is not allowed; expected one of wind, fog",
    "weather: [{wind: 1}]": "weather.0: a field is missing; expected a field 'kind'",
    "weather: [{kind: wind, wind: -1}]": "weather.0.wind: -1 is not allowed; expected a number greater than 0",
    "weather: [{kind: fog, fro: 1}]": "weather.0.fro: unknown field; did you mean 'from'?",
}


@pytest.mark.parametrize(("line", "expected"), OPTIONS.items())
def test_options_that_an_environment_refuses_are_told_with_their_line(line: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(f"{DEPOT}environment:\n  kind: my.own:World\n  {line}\n")
    text = load_mission_text(path)
    with pytest.raises(ValidationError) as caught:
        Options.model_validate(text.mission().environment.options)
    assert str(text.error(caught.value, Options, ("environment",))) == f"{path}:9: environment.{expected}"


def test_a_later_check_of_the_whole_mission_gets_its_line() -> None:
    text = MissionText(DEPOT, "x.yaml")
    late = misplaced(("tasks", "b", "arrives"), "an end of the box is there from the start")
    assert str(text.error(late)) == "x.yaml:2: tasks.b.arrives: an end of the box is there from the start"
    assert str(text.wrong(("environment", "kind"), "odd")) == "x.yaml:1: environment.kind: odd"


SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.dates(),
    st.text(max_size=8),
    st.sampled_from(["a", "b", "r1", "crash", "II", "full", "active", "*", "x: y"]),
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(SCALARS, inner, max_size=3), max_leaves=5
)
KEYS = st.one_of(SCALARS, st.sampled_from([*Mission.model_fields, "at", "robot", "kind", "until", "joins", "readings"]))


def holders(value: Any) -> list[Any]:
    """Every mapping and list in `value`, itself first."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    own = [value] if isinstance(value, dict | list) else []
    return own + [found for part in inner for found in holders(part)]


def change(document: Any, key: Any, value: Any, chance: random.Random) -> None:
    """Delete, replace or insert something somewhere in `document`."""
    holder = chance.choice(holders(document))
    if isinstance(holder, list):
        start = chance.randrange(len(holder) + 1)
        holder[start : start + chance.randrange(2)] = [value] * chance.randrange(2)
        return
    old = chance.choice([*holder, None])
    match chance.randrange(4):
        case 0:
            holder.pop(old, None)
        case 1:
            holder[old if old is not None else key] = value
        case 2:
            holder[key] = holder.pop(old, value)
        case _:
            holder[key] = value


def judged(text: str) -> None:
    """`text` is a mission, or gets one line that begins with its name."""
    try:
        parse_mission(text, "x.yaml")
    except MissionError as error:
        (line,) = str(error).splitlines()
        assert line.startswith("x.yaml:")
        assert line.isprintable()
        assert "pydantic" not in line
        assert "nput should" not in line


@settings(max_examples=300, deadline=None)
@given(changes=st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=3), chance=st.randoms(use_true_random=False))
def test_whatever_is_changed_in_a_mission_is_judged_in_one_line(
    changes: list[tuple[Any, Any]], chance: random.Random
) -> None:
    document = yaml.safe_load(WAREHOUSE)
    for key, value in changes:
        change(document, key, value, chance)
    judged(yaml.safe_dump(document, allow_unicode=True, sort_keys=False))


@settings(max_examples=200, deadline=None)
@given(start=st.integers(0, len(WAREHOUSE)), length=st.integers(0, 20), text=st.text(max_size=12))
def test_whatever_is_typed_into_a_mission_is_judged_in_one_line(start: int, length: int, text: str) -> None:
    judged(WAREHOUSE[:start] + text + WAREHOUSE[start + length :])


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet=st.characters(codec=None), max_size=60) | st.text("&*!<>|{}[],:?-#'\"% \n\tab1.", max_size=60))
def test_whatever_text_is_judged_in_one_line(text: str) -> None:
    judged(text)
