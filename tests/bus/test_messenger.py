"""The messenger: what is dropped, what is counted, and that nothing which comes can raise."""

import asyncio
import logging
from collections.abc import Callable
from typing import Any

import pytest

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.wire.keys import WORLD, Key, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, Heartbeat, Message, encode

pytestmark = pytest.mark.virtual_time

KEYS = Keys("m")


def sample(kind: Kind = Kind.HEARTBEAT, robot: str = "right", **fields: Any) -> Sample:
    """A message of `right` in its first life, on its own key, unless said otherwise."""
    fields = {"sender": "right", "incarnation": 1, "seq": 1, "at": 0.0, "trial": 1} | fields
    return Sample(KEYS.build(kind, robot=robot, task=fields.get("task") or "a"), encode(BODY_OF[kind](**fields)))


class Ear:
    """A messenger of `left` and what its receiver was given."""

    def __init__(self, me: str = "left") -> None:
        self.heard: list[tuple[str, int]] = []
        self.now = 0.0
        self.messenger = Messenger(MemoryBus(MemoryHub()), KEYS, me, 1, lambda: self.now, ["left", "right"])

    def take(self, *samples: Sample) -> None:
        for one in samples:
            self.messenger.take(one, self._receive)

    def _receive(self, key: Key, message: Message) -> None:
        self.heard.append((message.sender, message.seq))


async def test_only_fresh_messages_of_others_who_speak_for_themselves_are_handed_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    ear = Ear()
    ear.take(
        sample(seq=5),
        sample(seq=5),  # doubled
        sample(seq=4),  # overtaken
        sample(Kind.ACTIVITY, task="a", active_for=1.0, expected=2.0, seq=3),  # the same stream
        sample(Kind.HELLO, tasks=["a"], seq=3),  # another stream
        sample(incarnation=2, seq=1),  # a new life
        sample(seq=99),  # its ghost
        sample(robot="left", sender="left", seq=9),  # itself
        sample(robot="third"),  # somebody speaks for another
        sample(Kind.SENSE_TASK, learning="active", applicable=True, complete=True, progress=1.0),  # or for the world
        Sample(KEYS.build(Kind.HEARTBEAT, robot="right"), b"\xc1"),
        Sample("lalliance/m/heartbeat/*", b""),
        Sample("lalliance/other/heartbeat/right", b""),
        Sample(KEYS.build(Kind.LAUNCHER), b""),
    )
    assert ear.heard == [("right", 5), ("right", 3), ("right", 1)]
    assert ear.messenger.received == 3
    assert dict(ear.messenger.dropped) == {"stale": 4, "sender": 2, "msgpack": 1, "key": 3}
    assert [record.message for record in caplog.records] == [
        "dropping messages of third: sender: right on a key of third",
        "dropping messages of @world: sender: right on a key of @world (2 dropped for this reason so far)",
        "dropping messages of right: msgpack: FormatError",
        "dropping messages of an unknown key: key: 'lalliance/m/heartbeat/*' is not a key of this mission",
        "dropping messages of lalliance/m/@chaos/launcher: key: LAUNCHER carries no message (3 dropped for this reason so far)",
    ]


async def test_a_robot_called_world_is_no_world_and_the_world_does_not_hear_itself() -> None:
    world = Ear(WORLD)
    world.take(
        sample(Kind.ACTION, robot="world", sender="world", task="a", fewest=0),
        sample(Kind.SENSE_ROBOT, sender=WORLD, mission="running", learning="active"),
    )
    assert world.heard == [("world", 1)]
    assert not world.messenger.dropped


async def test_made_up_names_fill_neither_the_log_nor_the_account(caplog: pytest.LogCaptureFixture) -> None:
    ear = Ear()
    for number in range(1000):
        ear.take(Sample(KEYS.build(Kind.HEARTBEAT, robot="right"), b""))
        ear.take(Sample(KEYS.build(Kind.HELLO, robot=f"made-up-{number}"), b""))
        ear.take(Sample(f"lalliance/m/heartbeat/\n{number} ERROR", b""))
    assert ear.messenger.dropped == {"msgpack": 2000, "key": 1000}
    lines = [record.message for record in caplog.records]
    assert len(lines) == 8
    assert lines[-1].endswith("(1000 dropped for this reason so far)")
    assert all(line.isprintable() for line in lines)
    assert ear.messenger.dropped_of == {
        ("right", "msgpack"): 1000, ("@others", "msgpack"): 1000, ("@others", "key"): 1000,
    }  # fmt: skip


async def test_a_sender_cut_off_by_one_made_up_message_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    """Its later messages are older than that one for good, and nobody could see why it is not heard."""
    ear = Ear()
    ear.take(sample(seq=1), sample(seq=2**63 - 1))
    for seq in range(2, 62):
        ear.now += 0.5
        ear.take(sample(seq=seq), sample(Kind.HELLO, tasks=["a"], seq=seq))
    assert [seq for _, seq in ear.heard if seq > 2**40 or seq == 1] == [1, 2**63 - 1]
    assert ear.messenger.received == 62
    assert ear.messenger.dropped == {"stale": 19, "cut off": 41}
    assert ear.messenger.dropped_of == {("right", "stale"): 19, ("right", "cut off"): 41}
    [record] = caplog.records
    assert record.message == (
        "right is cut off: for 10 s nothing on lalliance/m/heartbeat/right is newer than its message 9223372036854775807 of "
        "life 1, which somebody made up, unless another process goes by this name or messages come very late; none of them "
        "is used"
    )


async def test_each_of_a_team_that_is_cut_off_is_told_once_whatever_is_made_up(
    caplog: pytest.LogCaptureFixture,
) -> None:
    ear = Ear()
    team = [f"r{number}" for number in range(10)]
    ear.messenger = Messenger(MemoryBus(MemoryHub()), KEYS, "left", 1, lambda: ear.now, team)
    names = [*(f"made-up-{number}" for number in range(50)), *team]
    for seq in (9, *range(20)):
        ear.now += 1.0
        for name in names:
            for kind, fields in ((Kind.HEARTBEAT, {}), (Kind.HELLO, {"tasks": ["a"]})):
                ear.take(sample(kind, robot=name, sender=name, seq=2**62 + seq if seq == 9 else seq, **fields))
    told = [record.message.split()[0] for record in caplog.records]
    # Of those made up, the first three and the hundredth stream.
    assert sorted(told) == sorted(["made-up-0", "made-up-1", "made-up-2", "made-up-49", *team])


async def test_who_is_doubled_and_overtaken_or_has_a_ghost_is_not_cut_off(caplog: pytest.LogCaptureFixture) -> None:
    ear = Ear()
    for seq in range(100):
        ear.now += 1.0
        ear.take(sample(seq=seq, incarnation=2), *[sample(seq=seq + ahead) for ahead in range(30)])
    ear.now += 100.0
    ear.take(sample(seq=100, incarnation=2), *[sample(seq=100, incarnation=2) for _ in range(30)])
    assert ear.messenger.dropped == {"stale": 3030}
    assert caplog.records == []


async def test_what_a_receiver_raises_is_its_own_and_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    def stumble(_: Key, message: Message) -> None:
        raise KeyError(message.seq)

    ear = Ear()
    for seq in range(3):
        ear.messenger.take(sample(seq=seq), stumble)
    ear.take(sample(seq=3))
    assert ear.heard == [("right", 3)]
    assert ear.messenger.dropped == {"receiver": 3}
    assert [record.levelno for record in caplog.records] == [logging.ERROR]


async def test_messages_and_answers_reach_a_receiver_over_the_bus_numbered_and_signed() -> None:
    hub = MemoryHub()
    heard: list[Message] = []
    clock: Callable[[], float] = lambda: 12.5  # noqa: E731
    async with MemoryBus(hub) as here, MemoryBus(hub) as there:
        left, right = Messenger(here, KEYS, "left", 7, clock), Messenger(there, KEYS, "right", 1, clock)
        await right.listen(KEYS.build(Kind.HEARTBEAT), lambda _, message: heard.append(message))
        hello = KEYS.build(Kind.HELLO, robot="left")
        await left.offer(hello, lambda _: [Sample(hello, left.compose(Kind.HELLO, tasks=["a"]))])
        left.send(Kind.HEARTBEAT, trial=1)
        answered = await right.ask(KEYS.build(Kind.HELLO), lambda _, message: heard.append(message), timeout=1.0)
        assert answered == 1
        await right.close()
        left.send(Kind.HEARTBEAT, trial=2)
        await left.close()
        assert await right.ask(KEYS.build(Kind.HELLO), lambda *_: None, timeout=1.0) == 0
    first = heard[0]
    assert (type(first), first.sender, first.incarnation, first.seq, first.at) == (Heartbeat, "left", 7, 1, 12.5)
    assert [m.seq for m in heard] == [1, 1]
    assert (left.sent, right.received) == (2, 2)


async def test_presence_is_numbered_densely_whatever_else_is_sent() -> None:
    """The numbers of each stream grow, so that nothing fresh is taken for stale."""
    hub = MemoryHub()
    heard: list[tuple[str, int]] = []
    presence = {"trial": 1, "active_for": 0.0, "expected": 1.0}
    async with MemoryBus(hub) as here, MemoryBus(hub) as there:
        left, right = Messenger(here, KEYS, "left", 1, lambda: 0.0), Messenger(there, KEYS, "right", 1, lambda: 0.0)
        for kind in (Kind.ACTIVITY, Kind.HEARTBEAT, Kind.HELLO, Kind.ACTION):
            await right.listen(KEYS.build(kind), lambda key, message: heard.append((key.kind.name, message.seq)))
        left.send(Kind.HEARTBEAT, trial=1)
        left.send(Kind.HELLO, tasks=["a"])
        left.send(Kind.ACTIVITY, key_task="a", task="a", **presence)
        left.send(Kind.ACTION, task="a", trial=1, fewest=0)
        left.send(Kind.HELLO, tasks=["a"])
        left.send(Kind.ACTIVITY, key_task="b", task="b", **presence)
        left.send(Kind.HEARTBEAT, trial=1)
        await asyncio.sleep(0)
    assert heard == [
        ("HEARTBEAT", 1), ("HELLO", 1), ("ACTIVITY", 2), ("ACTION", 2), ("HELLO", 3), ("ACTIVITY", 3), ("HEARTBEAT", 4),
    ]  # fmt: skip
    assert not right.dropped
