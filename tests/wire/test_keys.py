"""Keys: how each kind is spelled, and that nothing else is taken for one."""

import string

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lalliance_agents.bus.patterns import check_key, check_pattern, matches
from lalliance_agents.errors import MessageError
from lalliance_agents.wire.keys import LAUNCHER, OPERATOR, WORLD, Key, Keys, Kind

KEYS = Keys("warehouse")
NAMES = st.text(string.ascii_letters + string.digits + "_-", min_size=1, max_size=64)

SPELLED = {
    Kind.ACTIVITY: ("activity/crate-1/lifter", "lifter", "crate-1", "lifter"),
    Kind.HEARTBEAT: ("heartbeat/lifter", "lifter", None, "lifter"),
    Kind.HELLO: ("hello/lifter", "lifter", None, "lifter"),
    Kind.ACTION: ("body/lifter/action", "lifter", None, "lifter"),
    Kind.SENSE_TASK: ("sense/task/crate-1", None, "crate-1", WORLD),
    Kind.SENSE_ROBOT: ("sense/robot/lifter", "lifter", None, WORLD),
    Kind.DECISION: ("mind/lifter/decision", "lifter", None, "lifter"),
    Kind.MOTIVATION: ("mind/lifter/motivation", "lifter", None, "lifter"),
    Kind.LINK: ("link/lifter", "lifter", None, "lifter"),
    Kind.EVENT: ("world/event", None, None, WORLD),
    Kind.STATUS: ("world/status", None, None, WORLD),
    Kind.CHAOS_RULES: ("@chaos/rules", None, None, WORLD),
    Kind.CHAOS_COMMAND: ("@chaos/command", None, None, OPERATOR),
    Kind.CHAOS_DEED: ("@chaos/deed", None, None, LAUNCHER),
    Kind.LAUNCHER: ("@chaos/launcher", None, None, None),
    Kind.ALIVE: ("alive/lifter", "lifter", None, "lifter"),
}


@pytest.mark.parametrize("kind", Kind)
def test_each_kind_is_spelled_parsed_and_spoken_on_as_the_design_says(kind: Kind) -> None:
    spelled, robot, task, speaker = SPELLED[kind]
    key = KEYS.build(kind, robot="lifter", task="crate-1")
    assert key == f"lalliance/warehouse/{spelled}"
    assert KEYS.parse(key) == Key(kind, robot, task)
    assert KEYS.parse(key).speaker == speaker


@settings(deadline=None)
@given(kind=st.sampled_from(Kind), mission=NAMES, robot=NAMES, task=NAMES)
def test_what_was_built_is_parsed_back_and_fits_the_bus(kind: Kind, mission: str, robot: str, task: str) -> None:
    keys = Keys(mission)
    key = keys.build(kind, robot=robot, task=task)
    check_key(key)
    parsed = keys.parse(key)
    assert parsed.kind is kind
    assert parsed.robot == (robot if "{robot}" in kind.value else None)
    assert parsed.task == (task if "{task}" in kind.value else None)


@settings(deadline=None)
@given(one=st.sampled_from(Kind), other=st.sampled_from(Kind), robot=NAMES, task=NAMES)
def test_a_pattern_matches_the_keys_of_its_kind_and_no_others(one: Kind, other: Kind, robot: str, task: str) -> None:
    pattern = KEYS.build(one)
    check_pattern(pattern)
    assert matches(pattern, KEYS.build(other, robot=robot, task=task)) == (one is other)
    assert not matches(pattern, Keys("other").build(one, robot=robot, task=task))


def test_presence_is_one_stream_and_every_other_key_its_own() -> None:
    built = {kind: KEYS.parse(KEYS.build(kind, robot="r", task="t")) for kind in Kind}
    assert built[Kind.ACTIVITY].stream == built[Kind.HEARTBEAT].stream == Key(Kind.ACTIVITY, "r", "other").stream
    assert len({key.stream for key in built.values()}) == len(Kind) - 1
    assert Key(Kind.SENSE_TASK, task="a").stream != Key(Kind.SENSE_TASK, task="b").stream


@pytest.mark.parametrize(
    "rest",
    [
        "heartbeat/*", "heartbeat/**", "activity/*/left", "heartbeat/", "heartbeat//left", "heartbeat/left/",
        "heartbeat/left\n", "heartbeat/left\0", "heartbeat/@left", "heartbeat/le ft", "heartbeat/" + "x" * 65,
        "heartbeat/lëft", "heartbeat/left/x", "heartbeat/{robot}", "heartbeat", "", "mind/left/thought", "Heartbeat/left",
        "@chaos/rules/x", "world/event\n", "sense/task/a/b", "heartbeat/\ud800", "heartbeat/١٢", "body/left/action/..",
        "\U000e0001" * 90,
    ],
)  # fmt: skip
def test_a_hostile_key_is_refused(rest: str) -> None:
    with pytest.raises(MessageError) as refused:
        KEYS.parse(f"lalliance/warehouse/{rest}")
    assert refused.value.reason == "key"
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 200


@settings(deadline=None)
@given(st.text(max_size=200))
def test_no_text_does_worse_than_be_refused(text: str) -> None:
    for key in (text, KEYS.prefix + text):
        try:
            parsed = KEYS.parse(key)
        except MessageError:
            continue
        assert KEYS.build(parsed.kind, robot=parsed.robot or "", task=parsed.task or "") == key


def test_keys_of_another_mission_are_refused() -> None:
    for key in ("lalliance/warehouse2/heartbeat/left", "lalliance/ware/heartbeat/left", "heartbeat/left"):
        with pytest.raises(MessageError):
            KEYS.parse(key)
