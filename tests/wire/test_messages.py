"""Messages: what is packed comes back, and whatever else comes in is a `MessageError` and nothing more."""

import random
import tracemalloc
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from wire.samples import valid

from lalliance_agents.errors import MessageError
from lalliance_agents.wire import messages
from lalliance_agents.wire.keys import WORLD, Key, Kind
from lalliance_agents.wire.messages import BODY_OF, MAX_PAYLOAD, Message, decode, decode_at, encode

NAMES = st.text("abcXYZ019_-", min_size=1, max_size=64)
COUNTS = st.integers(0, 2**63 - 1)
SECONDS = st.floats(0, 1e12)
FLOATS = st.floats(allow_nan=False, allow_infinity=False)
SCALARS = st.dictionaries(
    st.text(max_size=8), st.none() | st.booleans() | FLOATS | st.integers(-(2**63), 2**63 - 1) | st.text(max_size=8),
    max_size=4,
)  # fmt: skip
RECEPTIONS = st.builds(
    messages.Reception,
    received=COUNTS,
    silence=st.none() | SECONDS,
    lapses=COUNTS,
    lost_for=st.none() | SECONDS,
)
STAGES = st.sampled_from(["waiting", "running", "complete", "failed"])
LEARNING = st.sampled_from(["active", "adaptive"])

EFFECTS = st.builds(messages.Effect, fault=st.text(max_size=8), sender=st.just(WORLD) | NAMES, count=COUNTS)
GLOBS = st.lists(st.text("ab*?", max_size=8), max_size=3)
SHARES = st.floats(0, 1)
RULES = st.builds(
    messages.LinkRule, fault=st.text(max_size=8), senders=GLOBS, receivers=GLOBS, cut=st.booleans(), loss=SHARES,
    burst_loss=SHARES, burst_enter=SHARES, burst_leave=SHARES, duplicate=SHARES, reorder=SHARES, held=SECONDS,
    delay=st.sampled_from(["none", "constant", "uniform", "lognormal"]), delay_by=SECONDS, delay_to=SECONDS,
)  # fmt: skip
BLIND = st.builds(messages.Blindness, fault=st.text(max_size=8), robot=NAMES, delay=st.none() | SECONDS)

FIELDS: dict[Kind, dict[str, st.SearchStrategy[Any]]] = {
    Kind.ACTIVITY: {"task": NAMES, "trial": COUNTS, "active_for": SECONDS, "expected": SECONDS},
    Kind.HEARTBEAT: {"trial": COUNTS},
    Kind.HELLO: {"tasks": st.lists(NAMES, max_size=4)},
    Kind.ACTION: {"task": st.none() | NAMES, "trial": COUNTS, "fewest": COUNTS},
    Kind.SENSE_TASK: {
        "trial": COUNTS, "learning": LEARNING, "applicable": st.booleans(), "complete": st.booleans(),
        "progress": st.floats(0, 1),
    },
    Kind.SENSE_ROBOT: {
        "mission": STAGES, "trial": COUNTS, "learning": LEARNING, "failures": st.lists(st.text(max_size=8), max_size=3),
    },
    Kind.DECISION: {
        "verb": st.text(max_size=8), "task": NAMES, "cause": st.text(max_size=8), "other": st.none() | NAMES,
        "active_for": SECONDS, "trial": COUNTS, "factors": SCALARS, "teammates": st.lists(SCALARS, max_size=3),
    },
    Kind.MOTIVATION: {"active": st.lists(NAMES, max_size=3), "sets": st.dictionaries(NAMES, SCALARS, max_size=3)},
    Kind.LINK: {
        "sent": COUNTS, "received": COUNTS, "dropped": st.dictionaries(st.text(max_size=8), COUNTS, max_size=3),
        "teammates": st.dictionaries(NAMES, RECEPTIONS, max_size=3), "effects": st.lists(EFFECTS, max_size=3),
        "ticks": COUNTS, "missed": COUNTS,
        "final": st.booleans(),
    },
    Kind.EVENT: {
        "kind": st.text(max_size=8), "robot": st.none() | NAMES, "task": st.none() | NAMES, "elapsed": SECONDS,
        "trial": COUNTS, "text": st.text(max_size=30), "details": SCALARS,
    },
    Kind.STATUS: {
        "mission": STAGES, "trial": COUNTS, "trials": COUNTS, "learning": LEARNING, "elapsed": SECONDS,
        "tasks": st.dictionaries(NAMES, SCALARS, max_size=3), "robots": st.dictionaries(NAMES, SCALARS, max_size=3),
    },
    Kind.CHAOS_RULES: {
        "seed": COUNTS, "rules": st.lists(RULES, max_size=3), "blind": st.lists(BLIND, max_size=3),
    },
    Kind.CHAOS_COMMAND: {
        "verb": st.sampled_from(["inject", "heal", "status"]), "fault": st.text(max_size=30), "lasts": st.none() | SECONDS,
        "name": st.text(max_size=8),
    },
    Kind.CHAOS_DEED: {"number": COUNTS},
}  # fmt: skip


def some(kind: Kind) -> st.SearchStrategy[Message]:
    """Valid messages of one kind."""
    sender = st.just(WORLD) | NAMES
    return st.builds(BODY_OF[kind], sender=sender, incarnation=COUNTS, seq=COUNTS, at=SECONDS, **FIELDS[kind])


SOME = st.sampled_from(list(BODY_OF)).flatmap(some)

HEADER = {"v": 1, "sender": "left", "incarnation": 1, "seq": 1, "at": 0.0}
HEARTBEAT = {**HEADER, "trial": 1}


def refusal(kind: type[Message], document: object) -> MessageError:
    """Why `document`, packed, is no message of `kind`."""
    payload = document if isinstance(document, bytes) else msgpack.packb(document)
    with pytest.raises(MessageError) as refused:
        decode(kind, payload)
    return refused.value


def test_every_kind_that_carries_a_message_is_tested_here() -> None:
    assert FIELDS.keys() == BODY_OF.keys()


@settings(max_examples=200, deadline=None)
@given(SOME)
def test_a_message_comes_back_as_it_was(message: Message) -> None:
    assert decode(type(message), encode(message)) == message


@settings(max_examples=1500, deadline=None)
@given(st.binary(max_size=200))
def test_random_bytes_are_refused_at_worst(payload: bytes) -> None:
    for kind in (messages.Heartbeat, messages.Status):
        refusal(kind, payload)


DOCUMENTS = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=5)
    | st.binary(max_size=5) | st.builds(msgpack.ExtType, st.integers(0, 127), st.binary(max_size=4))
    | st.builds(msgpack.Timestamp, st.integers(0, 2**33), st.integers(0, 999)),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5) | st.binary(max_size=3), inner, max_size=4),
    max_leaves=8,
)  # fmt: skip


@settings(max_examples=1000, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_a_message_with_any_field_replaced_is_refused_or_whole(data: st.DataObject) -> None:
    """Also where a field of a valid message holds just anything, nothing but a checked message comes out."""
    message = data.draw(SOME)
    document = message.model_dump()
    field = data.draw(st.sampled_from([*document, "unknown"]))
    document[field] = data.draw(DOCUMENTS)
    try:
        decoded = decode(type(message), msgpack.packb(document))
    except MessageError as error:
        told = str(error)
    else:
        told = ""
        assert decode(type(message), encode(decoded)) == decoded
    assert told == "" or (told.isprintable() and len(told) < 200)


def test_thousands_of_messages_with_flipped_bytes_are_refused_or_whole() -> None:
    draw = random.Random(7)
    valid = [
        (messages.Activity, {**HEARTBEAT, "task": "a", "active_for": 1.5, "expected": 8.0}),
        (messages.LinkReport, {**HEADER, "sent": 1, "received": 2, "dropped": {"stale": 3}, "ticks": 4, "missed": 0,
                               "teammates": {"right": {"received": 1, "silence": 0.5}}}),
    ]  # fmt: skip
    refused = 0
    for kind, document in valid:
        packed = msgpack.packb(document)
        assert decode(kind, packed)
        for _ in range(3000):
            payload = bytearray(packed)
            for _ in range(draw.randint(1, 4)):
                payload[draw.randrange(len(payload))] = draw.randrange(256)
            cut = payload[: draw.randint(1, len(payload))] if draw.random() < 0.2 else payload
            try:
                assert encode(decode(kind, bytes(cut)))
            except MessageError:
                refused += 1
    assert 3000 < refused < 6000


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"v": 2}, "version"), ({"v": None}, "version"), ({"v": "1"}, "version"), ({"v": [1]}, "version"),
        ({"seq": -1}, "content"), ({"seq": 2**63}, "content"), ({"seq": 2**64 - 1}, "content"),
        ({"seq": 1.0}, "content"), ({"seq": True}, "content"), ({"seq": "1"}, "content"), ({"seq": None}, "content"),
        ({"at": float("nan")}, "content"), ({"at": float("inf")}, "content"), ({"at": -1e-9}, "content"),
        ({"at": 1e13}, "content"), ({"at": 2**64 - 1}, "content"),
        ({"sender": ""}, "content"), ({"sender": "*"}, "content"), ({"sender": "left\n"}, "content"),
        ({"sender": "a/b"}, "content"), ({"sender": "x" * 65}, "content"), ({"sender": "@"}, "content"),
        ({"sender": "@@world"}, "content"), ({"sender": b"left"}, "content"), ({"sender": "l\0"}, "content"),
    ],
)  # fmt: skip
def test_a_header_is_checked_field_by_field(change: dict[str, object], reason: str) -> None:
    assert refusal(messages.Heartbeat, {**HEARTBEAT, **change}).reason == reason


def test_a_field_that_is_missing_is_refused_and_one_that_is_unknown_is_ignored() -> None:
    for field in HEARTBEAT:
        assert refusal(messages.Heartbeat, {k: v for k, v in HEARTBEAT.items() if k != field})
    more = {**HEARTBEAT, "colour": {"deep": [[b"\xff"]]}}
    assert decode(messages.Heartbeat, msgpack.packb(more)) == messages.Heartbeat(**HEARTBEAT)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "msgpack"), (b"\xc1", "msgpack"), (b"\x80\x80", "msgpack"), (b"\xdf\xff\xff\xff\xff", "msgpack"),
        (b"\x91" * 100_000, "msgpack"), (b"\xa2\xff\xfe", "msgpack"), (b"\x81\x01\x01", "msgpack"),
        (b"\x90", "form"), (b"\xc0", "form"), (b"\x80", "version"), (b"\x81\xc4\x01v\x01", "version"),
        (b"\xc6" + (MAX_PAYLOAD - 4).to_bytes(4) + b"x" * (MAX_PAYLOAD - 4), "size"),
    ],
)  # fmt: skip
def test_what_is_not_even_a_document_is_refused_with_its_reason(payload: bytes, reason: str) -> None:
    assert refusal(messages.Heartbeat, payload).reason == reason


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        (messages.Hello, {"tasks": [""] * 120_000}),
        (messages.Hello, {"tasks": [1] * 120_000}),
        (messages.LinkReport, {"dropped": {str(i): -1 for i in range(15_000)}}),
        (messages.DecisionMade, {"teammates": [{"a": []}] * 30_000}),
    ],
)
def test_of_very_many_faults_only_the_first_is_looked_up(kind: type[Message], fields: dict[str, object]) -> None:
    """Spelling out 100,000 faults takes half a second, in which a robot would hear and do nothing."""
    payload = msgpack.packb({**HEADER, **fields})
    assert len(payload) <= MAX_PAYLOAD
    assert refusal(kind, payload).reason == "content"
    with pytest.raises(ValidationError) as refused:
        kind.model_validate({**HEADER, **fields})
    assert refused.value.error_count() < 20  # those of a field that is missing, or of one value, are told one by one


@pytest.mark.parametrize("kind", BODY_OF)
@pytest.mark.parametrize("wrong", [[b""] * 1000, {f"*{number}": b"" for number in range(1000)}])
def test_no_list_and_no_map_has_more_than_its_first_fault_looked_up(kind: Kind, wrong: object) -> None:
    """Else whoever fills a map with faults costs a receiver many times what a right message does."""
    document = valid(kind, random.Random(1)).document
    for name, value in document.items():
        for filling in (wrong, [wrong], {"a": wrong}):
            if isinstance(value, list | dict):
                with pytest.raises(ValidationError) as refused:
                    BODY_OF[kind].model_validate({**document, name: filling})
                assert refused.value.error_count() < 20, name


@pytest.mark.parametrize("head", [b"\xdc\xff\xff", b"\xdd\0\x01\xe0\0", b"\xde\xff\xff", b"\xc6\0\x01\xe0\0"])
@pytest.mark.parametrize("filling", [b"\xc0", b"\x80", b"\xc1"])
def test_what_a_message_claims_to_hold_takes_no_room(head: bytes, filling: bytes) -> None:
    """A list that claims 100,000 entries takes nearly a megabyte, and a payload has room for a thousand in one another."""
    payload = (b"\x82\xa1v" + head * 1000).ljust(MAX_PAYLOAD, filling)
    tracemalloc.start()
    refusal(messages.Heartbeat, payload)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10 * MAX_PAYLOAD


def test_a_fault_is_told_in_one_short_line_whatever_name_it_has() -> None:
    shouting = {**HEADER, "sent": 1, "received": 1, "teammates": {}, "ticks": 1, "missed": 1}
    for name in ("\nERROR all robots stop\x1b[2J", "x" * 100_000, "\U000e0001" * 100):
        text = str(refusal(messages.LinkReport, {**shouting, "dropped": {name: -1}}))
        assert text.isprintable()
        assert len(text) < 200


@pytest.mark.parametrize("kind", BODY_OF)
@given(data=st.data())
@settings(max_examples=10, deadline=None)
def test_nobody_speaks_for_another(kind: Kind, data: st.DataObject) -> None:
    message = data.draw(some(kind))
    key = Key(kind, robot="left" if "{robot}" in kind.value else None, task=getattr(message, "task", None) or "a")
    assert key.speaker is not None
    right = message.model_copy(update={"sender": key.speaker})
    assert decode_at(key, encode(right)) == right
    for sender in {"right", WORLD, "world", "@left"} - {key.speaker}:
        with pytest.raises(MessageError) as refused:
            decode_at(key, encode(message.model_copy(update={"sender": sender})))
        assert refused.value.reason == "sender"


def test_activity_on_one_task_is_not_taken_from_the_key_of_another() -> None:
    message = messages.Activity(**HEARTBEAT, task="a", active_for=1.0, expected=1.0)
    with pytest.raises(MessageError) as refused:
        decode_at(Key(Kind.ACTIVITY, "left", "b"), encode(message))
    assert refused.value.reason == "task"


@pytest.mark.parametrize("kind", [kind for kind in Kind if kind not in BODY_OF])
def test_a_key_that_carries_no_message_is_refused(kind: Kind) -> None:
    with pytest.raises(MessageError) as refused:
        decode_at(Key(kind, "left"), encode(messages.Heartbeat(**HEARTBEAT)))
    assert refused.value.reason == "key"
