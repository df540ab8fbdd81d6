"""Faults as words of a command line."""

import json

import pytest

from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.messages import LONGEST_FAULT
from mission_control.chaos_words import read_injection

MISSION = parse_mission(
    """
name: team
tasks: {a: {}, b: {}}
robots:
  lifter: {tasks: {a: 5}}
  pusher: {tasks: {a: 5, b: 5}}
  late: {tasks: {b: 5}, joins: 9}
""",
    "team.yaml",
)

GOOD = {
    "kind=hang robot=lifter for=5": ({"kind": "hang", "robot": "lifter"}, 5.0),
    "kind=crash robot=late": ({"kind": "crash", "robot": "late"}, None),
    "kind=slow robot=pusher factor=1e1 for=.5": ({"kind": "slow", "robot": "pusher", "factor": 10.0}, 0.5),
    "from=* to=pusher loss=0.3": ({"link": {"from": "*", "to": "pusher"}, "loss": 0.3}, None),
    "link.from=l* both=yes cut=true": ({"link": {"from": "l*", "both": True}, "cut": True}, None),
    "to=pusher delay=[0.05,0.4]": ({"link": {"to": "pusher"}, "delay": {"uniform": [0.05, 0.4]}}, None),
    "to=late loss.enter=0.1 loss.leave=0.5": ({"link": {"to": "late"}, "loss": {"enter": 0.1, "leave": 0.5}}, None),
    "partition=[[lifter,late],[pusher]] for=3": ({"partition": [["lifter", "late"], ["pusher"]]}, 3.0),
}


@pytest.mark.parametrize("words", GOOD)
def test_words_spell_a_fault_as_a_mission_file_does(words: str) -> None:
    injection = read_injection(words.split(), MISSION)
    assert (json.loads(injection.fault), injection.lasts) == GOOD[words]


BAD = {
    "": "no word says what is to fail; expected kind= and robot=, from= and to=, or partition=, as in",
    "loss=0.3": "no word says what is to fail; expected kind=",
    "kind": "'kind' is not FIELD=VALUE; expected words like kind=hang",
    "=hang": "'=hang' is not FIELD=VALUE",
    "kind=hnag robot=lifter": "kind: 'hnag' is not allowed; expected one of crash, hang, stuck, slow, mute, deaf, blind; "
    "did you mean 'hang'?",
    "kind=hang": "a field is missing; expected a field 'robot'",
    "kind=hang robot=litfer": "robot: 'litfer' is not a robot of this mission; did you mean 'lifter'?",
    "kind=hang robot=lifter factor=2": "factor: unknown field; expected one of at, until, kind, robot",
    "kind=hang robot=lifter at=3": "at: an injected fault begins now; expected for=SECONDS for how long it lasts",
    "kind=hang robot=lifter for=-1": "for: -1 is not allowed; expected a number greater than 0, in seconds",
    "kind=hang robot=lifter for=yes": "for: True is not allowed; expected a number greater than 0",
    "kind=hang robot=lifter for=.nan": "for: nan is not allowed; expected a number greater than 0",
    "kind=hang robot=lifter for=1e30": "for: 1e+30 is not allowed; expected a number of at most 1e+12",
    "kind=hang robot=lifter for=1000000000001": "for: 1000000000001 is not allowed; expected a number of at most 1e+12",
    f"kind=hang robot=lifter for=1{'0' * 400}": f"for: 1{'0' * 55} ... is not allowed; expected a number of at most 1e+12",
    "kind=slow robot=lifter factor=1e999": "factor: .inf is not allowed; expected a finite number",
    "from=lifter to=lif* loss=1": "link: lifter is the only robot at both ends, and none hears itself",
    "from=[] loss=1": "link.from: [] is not allowed; expected 1 or more entries",
    "kind=hang kind=mute robot=lifter": "'kind=mute' is about a field that has a value already; expected it once",
    "link=1 from=lifter": "'from=lifter' is about a field that has a value already; expected it once",
    "kind=stuck robot=lifter task=b": "task: 'b' is not a task of robot lifter",
    "from=* to=pusher": "the rule does nothing; expected loss, delay, duplicate, reorder or cut: true",
    "from=* loss=1.5": "loss: 1.5 is not allowed; expected a number of at most 1",
    "from=* loss=-0.1": "loss: -0.1 is not allowed; expected a number of at least 0",
    "from=x* loss=1": "link.from: 'x*' matches no robot of this mission",
    "from=* delay=[2,1]": "delay.uniform: the second number 1 s is below the first one 2 s",
    "from=* delay=2024-01-01": "delay: 2024-01-01 is a date in YAML; expected text in quotes",
    "from=* loss={": "loss: not readable as YAML: while parsing a flow node, expected the node content, but found '<stream",
    "partition=[[lifter],[*]]": 'a glob inside a list needs quotes, as in [[a], ["b*"]]',
    "partition=[[lifter],[lifter]]": "partition.1: lifter is in two groups of the partition; expected it in one",
    "kind=hang robot=\udcff": "robot: ",
}


@pytest.mark.parametrize("words", BAD)
def test_what_spells_no_fault_of_this_mission_is_refused_in_one_line(words: str) -> None:
    with pytest.raises(UserError) as refused:
        read_injection(words.split(), MISSION)
    assert BAD[words] in str(refused.value)
    assert str(refused.value).isprintable()


def test_a_value_is_one_line_and_a_fault_has_an_end() -> None:
    with pytest.raises(UserError, match="more than one value; expected it in one line"):
        read_injection(["kind=hang\nrobot: lifter"], MISSION)
    many = ",".join(["lifter"] * LONGEST_FAULT)
    with pytest.raises(UserError, match=f"letters; expected at most {LONGEST_FAULT}"):
        read_injection([f"partition=[[{many}],[pusher]]"], MISSION)
