"""What comes through a bus with faults: what each link rule does to it, when, and how it is counted."""

import asyncio
import itertools
from collections.abc import Awaitable, Callable

import pytest
from support.faulty_stage import KEYS, LATE, RULES, Stage, blind, rule
from support.virtual_time import hold_up

from lalliance_agents.bus import delay_line, faulty
from lalliance_agents.bus.base import Delivery, Registration, Sample
from lalliance_agents.bus.inbox import BATCH
from lalliance_agents.bus.link import LinkRules
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.wire.keys import WORLD, Kind
from lalliance_agents.wire.messages import ChaosRules, LinkRule, encode

pytestmark = pytest.mark.virtual_time


async def test_without_rules_everything_comes_as_it_is() -> None:
    """Even what does not decode, and what no key of the mission carries: it is read by whoever listens."""
    stage = Stage()
    await stage.obey()
    await stage.listen("lalliance/**")
    stage.beat()
    stage.sense()
    stage.others.put(KEYS.build(Kind.HEARTBEAT, robot="left"), b"\xc1", Delivery.PRESENCE)
    stage.others.put("lalliance/m/activity/a/no name", b"what", Delivery.PRESENCE)
    await stage.pause(0.0)
    assert stage.take_log() == [(0.0, "left 1"), (0.0, "a 2"), (0.0, r"b'\xc1'"), (0.0, "b'what'")]
    assert (stage.effects(), dict(stage.bus.dropped)) == ({}, {})


SOME = [
    rule("cut", cut=True),
    rule("loss", loss=0.5),
    rule("bursts", burst_loss=1.0, burst_enter=0.3, burst_leave=0.3),
    rule("constant", **LATE),
    rule("uniform", delay="uniform", delay_by=0.1, delay_to=0.9),
    rule("tail", delay="lognormal", delay_by=0.3, delay_to=1.0),
    rule("twice", duplicate=0.4),
    rule("held", reorder=0.4, held=0.25),
    rule("all", loss=0.3, delay="uniform", delay_by=0.0, delay_to=0.9, duplicate=0.4, reorder=0.4, held=0.25),
]


@pytest.mark.parametrize("speed", [1.0, 20.0])
@pytest.mark.parametrize("one", SOME, ids=lambda one: one.fault)
@pytest.mark.parametrize("lazy", [False, True], ids=["at once", "lazily"])
async def test_each_rule_does_to_each_message_what_its_verdict_says(one: LinkRule, speed: float, lazy: bool) -> None:
    """Activity and heartbeats alike; delays are mission time, whatever the clock's speed and whenever they are collected."""
    stage = Stage(speed)
    await stage.obey(one, seed=11)
    listen = stage.listen_lazily if lazy else stage.listen
    await listen(KEYS.build(Kind.HEARTBEAT), KEYS.build(Kind.ACTIVITY, task="a"))
    on, start = LinkRules(11, [one]).on("left", "right"), stage.clock.now()
    assert on is not None
    expected, touched, lost = [], 0, 0
    for seq in range(1, 31):
        if seq % 2:
            stage.beat()
        else:
            stage.left.send(Kind.ACTIVITY, key_task="a", task="a", trial=1, active_for=0.0, expected=1.0)
        verdict = on.verdict(1, seq)
        expected += [(start + 0.1 * (seq - 1) + delay, f"left {seq}") for delay in verdict.delays]
        touched += len(verdict.faults)
        lost += not verdict.delays
        await stage.pause(0.1)
        if seq % 4 == 0:
            stage.bus.collect()
    await stage.pause(60.0)
    stage.bus.collect()
    assert [text for _, text in stage.log] == [text for _, text in sorted(expected, key=lambda each: each[0])]
    assert [at for at, _ in stage.log] == pytest.approx([at for at, _ in sorted(expected)], abs=2e-6)
    assert stage.effects() == {(one.fault, "left"): touched}
    assert 0 < touched <= 30
    assert stage.bus.dropped == ({"link fault": lost} if lost else {})


async def test_a_rule_holds_on_its_links_in_its_direction_and_for_presence_only() -> None:
    stage = Stage()
    await stage.obey(
        rule("cut", senders="l*", cut=True),
        rule("other way", senders="right", receivers="left", cut=True),
        rule("itself", senders="*", receivers="elsewhere", cut=True),
    )
    await stage.listen(KEYS.build(Kind.HEARTBEAT), KEYS.build(Kind.HELLO), KEYS.build(Kind.SENSE_TASK))
    stage.beat()
    stage.beat(by=stage.voice("third"))
    stage.beat(by=stage.voice("right"))
    stage.left.send(Kind.HELLO, tasks=["a"])
    stage.sense()
    await stage.pause(0.0)
    assert stage.take_log() == [(0.0, "third 1"), (0.0, "right 1"), (0.0, "left 1"), (0.0, "a 2")]
    assert stage.effects() == {("cut", "left"): 1}


async def test_a_robot_hears_itself_untouched_by_a_rule_on_all_links() -> None:
    stage = Stage()
    await stage.obey(rule(senders="*", receivers="*", cut=True))
    await stage.listen()
    stage.beat(by=stage.voice("right"))
    stage.beat()
    await stage.pause(0.0)
    assert stage.take_log() == [(0.0, "right 1")]
    assert stage.effects() == {("1-link", "left"): 1}


async def test_rules_that_change_or_end_count_for_what_comes_from_then_on() -> None:
    """What is under way arrives when it was to; the same rules again, refreshed each second, change nothing."""
    stage = Stage()
    await stage.obey(rule(**LATE))
    await stage.listen()
    stage.beat()
    await stage.pause(0.25)
    on = stage.bus._links
    await stage.obey(rule(**LATE))
    assert stage.bus._links is on
    stage.beat()
    await stage.pause(0.25)
    await stage.obey(rule("2-link", cut=True))
    stage.beat()
    await stage.pause(0.25)
    await stage.obey()
    stage.beat()
    await stage.pause(1.0)
    assert stage.take_log() == [(0.75, "left 4"), (1.0, "left 1"), (1.25, "left 2")]
    assert stage.effects() == {("1-link", "left"): 2, ("2-link", "left"): 1}
    assert stage.bus.dropped == {"link fault": 1}


async def test_the_seed_counts_and_rules_can_be_asked_for_at_the_start() -> None:
    stage = Stage()
    half = [rule(loss=0.5)]
    await stage.world.offer(
        RULES, lambda _: [Sample(RULES, stage.world.compose(Kind.CHAOS_RULES, seed=3, rules=half, blind=[]))]
    )
    await stage.bus.obey(timeout=1.0)
    await stage.listen()
    stage.beat(20)
    await stage.obey(*half, seed=4)
    stage.beat(20)
    await stage.pause(0.0)
    heard = [text for _, text in stage.log]
    for seed, numbers in ((3, range(1, 21)), (4, range(21, 41))):
        on = LinkRules(seed, half).on("left", "right")
        assert on is not None
        expected = [f"left {seq}" for seq in numbers if on.verdict(1, seq).delays]
        assert [text for text in heard if int(text.split()[1]) in numbers] == expected


async def test_rules_that_are_hostile_old_or_of_an_older_world_are_not_heeded_and_counted() -> None:
    stage = Stage()
    cut, late = rule(cut=True), rule("late", **LATE)
    reborn, ghost = stage.voice(WORLD, 2), stage.world
    await stage.bus.obey(timeout=1.0)
    await stage.listen()
    header = {"incarnation": 9, "seq": 9, "at": 0.0, "seed": 1}
    old = encode(ChaosRules(sender=WORLD, **header | {"incarnation": 2, "seq": 1}))
    stage.put_in_force(late, by=reborn)
    stage.put_in_force(cut, by=reborn)
    stage.put_in_force(late, by=ghost)
    for bad in (
        b"",
        b"\xc1" * 1000,
        bytes(200_000),
        old,
        encode(ChaosRules(sender="left", **header)),
        encode(ChaosRules(sender=WORLD, **header)).replace(b"\xa4seed\x01", b"\xa4seed\xc0"),
        encode(ChaosRules(sender=WORLD, **header)).replace(b"\xa5rules\x90", b"\xa5rules\x91\x80"),
    ):
        stage.others.put(RULES, bad, Delivery.STATE)
    await stage.pause(0.0)
    stage.beat()
    await stage.pause(2.0)
    assert stage.log == []
    assert stage.effects() == {("1-link", "left"): 1}
    assert stage.bus.dropped == {"stale": 2, "msgpack": 2, "sender": 1, "content": 2, "link fault": 1}
    assert stage.inner.dropped_oversize == 1


async def test_what_does_not_decode_on_a_ruled_link_is_left_to_whoever_reads_it() -> None:
    stage = Stage()
    await stage.obey(rule(cut=True))
    reader = Messenger(stage.bus, KEYS, "right", 1, stage.clock.now)
    await reader.listen(KEYS.build(Kind.HEARTBEAT), lambda *_: None)
    key = KEYS.build(Kind.HEARTBEAT, robot="left")
    stage.others.put(key, b"\xc1", Delivery.PRESENCE)
    stage.others.put(key, stage.voice("third").compose(Kind.HEARTBEAT, trial=1), Delivery.PRESENCE)
    stage.others.put(key, stage.left.compose(Kind.HEARTBEAT, trial=1), Delivery.PRESENCE)
    await stage.pause(0.0)
    assert (reader.dropped, stage.bus.dropped) == ({"msgpack": 1, "sender": 1}, {"link fault": 1})


async def test_what_is_sent_is_received_or_dropped() -> None:
    """But for second copies, which are one message more, and received or dropped as well."""
    stage = Stage()
    mixed = {"loss": 0.2, "delay": "uniform", "delay_by": 0.0, "delay_to": 0.5, "reorder": 0.2, "held": 0.5}
    await stage.obey(rule("lossy", **mixed), rule("twice", duplicate=0.3))
    reader = Messenger(stage.bus, KEYS, "right", 1, stage.clock.now)
    await reader.listen(KEYS.build(Kind.HEARTBEAT), lambda *_: None)
    for _ in range(200):
        stage.beat()
        await stage.pause(0.1)
    await stage.pause(2.0)
    twice = stage.effects()["twice", "left"]
    assert set(reader.dropped) == {"stale"}
    assert reader.received + reader.dropped["stale"] + stage.bus.dropped["link fault"] == 200 + twice
    assert min(twice, reader.received, reader.dropped["stale"], stage.bus.dropped["link fault"]) > 20


async def close_registration(stage: Stage, listening: list[Registration]) -> None:
    for _ in range(2):
        await listening[0].close()


async def close_bus(stage: Stage, _: list[Registration]) -> None:
    for _ in range(2):
        await stage.bus.close()


async def stop_obeying(stage: Stage, _: list[Registration]) -> None:
    for _ in range(2):
        await stage.bus.forget()


@pytest.mark.parametrize("end", [close_registration, close_bus, stop_obeying])
async def test_what_is_under_way_is_discarded_when_nobody_waits_for_it_any_more(
    end: Callable[[Stage, list[Registration]], Awaitable[None]],
) -> None:
    stage = Stage()
    await stage.obey(rule(**LATE))
    listening = await stage.listen(KEYS.build(Kind.HEARTBEAT), KEYS.build(Kind.ACTIVITY))
    stage.beat(3)
    await stage.pause(0.5)
    stage.left.send(Kind.ACTIVITY, key_task="a", task="a", trial=1, active_for=0.0, expected=1.0)
    await stage.pause(0.0)
    assert len(stage.bus._line) == 4
    await end(stage, listening)
    left_over = 1 if end is close_registration else 0
    assert len(stage.bus._line) == left_over
    await stage.pause(2.0)
    assert stage.log == [(1.5, "left 4")] * left_over


async def test_who_obeys_no_more_hears_all_and_a_closed_bus_is_closed_inside() -> None:
    stage = Stage()
    await stage.obey(rule(cut=True), blind=blind())
    await stage.listen(KEYS.build(Kind.HEARTBEAT), KEYS.build(Kind.SENSE_TASK))
    await stage.bus.forget()
    assert not stage.inner_hears(RULES)
    stage.put_in_force(rule(cut=True))
    stage.beat()
    stage.sense()
    await stage.pause(0.0)
    assert stage.take_log() == [(0.0, "left 1"), (0.0, "a 3")]
    async with stage.bus:
        pass
    with pytest.raises(RuntimeError, match="the bus is closed"):
        await stage.bus.subscribe("x", stage.hear)


async def test_a_handler_may_take_its_registration_back_while_it_is_called_with_what_is_late() -> None:
    stage = Stage()
    await stage.obey(rule(**LATE, duplicate=1.0))
    closing: list[asyncio.Task[None]] = []

    def hear_once(sample: Sample) -> None:
        stage.hear(sample)
        closing.append(asyncio.ensure_future(listening.close()))

    listening = await stage.bus.subscribe(KEYS.build(Kind.HEARTBEAT), hear_once)
    stage.beat()
    await stage.pause(0.5)
    stage.beat()
    await stage.pause(2.0)
    assert stage.log == [(1.0, "left 1"), (1.0, "left 1")]
    assert len(stage.bus._line) == 0


async def test_what_waited_to_be_collected_comes_in_the_order_of_its_arrival_after_the_delay() -> None:
    """Delayed or not, and even where a loop that was held up hears of messages only after they were due."""
    stage = Stage()
    await stage.obey(rule(**LATE))
    await stage.listen_lazily()
    third = stage.voice("third")
    for sender in (stage.left, third, stage.left):
        stage.beat(by=sender)
        hold_up(0.6)
    stage.beat(by=third)
    assert stage.log == []
    stage.bus.collect()
    assert stage.take_log() == [(0.6, "third 1"), (1.0, "left 1"), (1.8, "third 2")]
    await stage.pause(1.0)
    assert stage.take_log() == [(2.2, "left 2")]


async def test_a_handler_that_raises_harms_nothing_that_comes_after(caplog: pytest.LogCaptureFixture) -> None:
    stage = Stage()
    await stage.obey(rule(**LATE))

    def stumble(sample: Sample) -> None:
        stage.hear(sample)
        raise KeyError

    await stage.bus.subscribe(KEYS.build(Kind.HEARTBEAT), stumble)
    stage.beat(3)
    await stage.pause(2.0)
    assert [text for _, text in stage.log] == ["left 1", "left 2", "left 3"]
    assert [record.message for record in caplog.records] == [
        "The handler of the subscription 'lalliance/m/heartbeat/*' raised KeyError; the same again will not be logged."
    ]


async def test_what_is_due_at_once_keeps_its_order_and_does_not_starve_the_loop() -> None:
    stage = Stage()
    await stage.obey(rule(**LATE))
    await stage.listen()
    stage.beat(3 * BATCH)
    turns: list[int] = []
    await stage.pause(0.99)
    while len(stage.log) < 3 * BATCH:
        await (asyncio.sleep(0) if stage.log else stage.pause(0.01))
        turns.append(len(stage.log))
    assert [text for _, text in stage.log] == [f"left {seq}" for seq in range(1, 3 * BATCH + 1)]
    assert all(later - sooner <= BATCH for sooner, later in itertools.pairwise(turns))


async def test_a_flood_of_late_messages_fills_no_memory(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(delay_line, "MOST_LATE", 10 * (delay_line.OVERHEAD + 100))
    stage = Stage()
    await stage.obey(rule(**LATE))
    await stage.listen()
    stage.beat(30)
    await stage.pause(0.0)
    waiting = len(stage.bus._line)
    assert 10 <= waiting < 13
    assert stage.bus.dropped == {"late overflow": 30 - waiting}
    assert [record.message for record in caplog.records] == ["dropping messages of left: late overflow"]
    await stage.pause(2.0)
    stage.beat(5)
    await stage.pause(2.0)
    assert len(stage.log) == waiting + 5


async def test_names_made_up_fill_neither_memory_nor_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who is one too many is counted all the same, but not by name; and faults made up are counted up to a limit."""
    monkeypatch.setattr(faulty, "MOST_EFFECTS", 4)
    monkeypatch.setattr(faulty, "MOST_KEYS", 6)
    stage = Stage()
    await stage.obey(rule(senders="*", receivers="*", cut=True))
    await stage.listen()
    for number in range(10):
        stage.beat(by=stage.voice(f"r{number}"))
    await stage.pause(0.0)
    assert stage.effects() == {**{("1-link", f"r{number}"): 1 for number in range(4)}, ("1-link", "@others"): 6}
    assert len(stage.bus._treatments) <= 6
    for number in range(10):
        await stage.obey(rule(f"made-up-{number}", senders="*", cut=True))
        stage.beat(by=stage.voice(f"r{number}"))
        await stage.pause(0.0)
    assert len(stage.effects()) == 8
    assert stage.bus.dropped == {"link fault": 20}


async def test_a_faulty_bus_says_what_it_is() -> None:
    stage = Stage()
    await stage.obey(rule(**LATE), rule("other", receivers="elsewhere", cut=True), blind=blind())
    await stage.listen()
    stage.beat()
    await stage.pause(0.0)
    assert repr(stage.bus) == "<faulty bus of right: 1 rules, blind, 1 under way>"
