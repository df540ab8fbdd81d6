"""What every bus promises, checked on each of them: publishing, subscribing, limits, leaving.

A declaration on the real bus takes effect a moment later, so tests publish until somebody hears (`linked`). Where it
matters that something does *not* arrive, a later message shows that it would have.
"""

import asyncio
import logging
import threading

import pytest

from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.inbox import CAPACITY
from lalliance_agents.bus.patterns import MAX_KEY
from lalliance_agents.wire.messages import MAX_PAYLOAD

pytestmark = pytest.mark.timeout(60)

TIMEOUT = 20.0


async def test_messages_arrive_in_the_order_of_their_publisher(team, linked, make_ear):
    left, right = await team.bus(), await team.bus()
    ear = make_ear()
    await right.subscribe("m/activity/*", ear)
    publication = await left.publication("m/activity/t1", Delivery.PRESENCE)
    await linked(left, "m/activity/t1", ear)
    expected = [Sample("m/activity/t1", b"%d" % number) for number in range(500)]
    for sample in expected:
        publication.put(sample.payload)
    await ear.until(b"499")
    assert ear.samples == expected


async def test_lazy_subscribers_hear_when_each_message_came_and_nothing_before_what_came_earlier(
    team, linked, eventually, make_ear
):
    left, right = await team.bus(), await team.bus()
    loop = asyncio.get_running_loop()
    ear, times, nested = make_ear(), [], []

    def hear_lazily(sample):
        ear(sample)
        times.append(sample.came)
        nested.append(right.collect())

    await right.subscribe("m/eager", ear)
    registration = await right.subscribe("m/lazy", hear_lazily, lazy=True)
    await linked(left, "m/eager", ear)
    await eventually(lambda: left.put("m/lazy", b"early", Delivery.STATE) or (right.collect() and ear.samples))
    left.put("m/eager", b"linked", Delivery.STATE)
    await ear.until(b"linked")
    ear.samples.clear()
    times.clear()
    began = loop.time()
    for number in range(8):
        left.put("m/lazy" if number % 4 else "m/eager", b"%d" % number, Delivery.STATE)
    await eventually(lambda: right.collect() and len(ear.samples) == 8)
    assert ear.payloads == [b"%d" % number for number in range(8)]
    instants = [began, *times, loop.time()]
    assert instants == sorted(instants)
    assert len(times) == 6
    assert not any(nested)
    await registration.close()
    left.put("m/lazy", b"too late", Delivery.STATE)
    left.put("m/eager", b"last", Delivery.STATE)
    await ear.until(b"last")
    assert ear.payloads[8:] == [b"last"]
    assert ear.threads == {threading.get_ident()}


@pytest.mark.parametrize("delivery", Delivery)
async def test_put_reaches_subscribers_with_every_delivery(team, linked, delivery, make_ear):
    left, right = await team.bus(), await team.bus()
    ear = make_ear()
    await right.subscribe("m/**", ear)
    publication = await left.publication("m/x", delivery)
    await linked(left, "m/x", ear)
    await linked(left, "m/a/b", ear)
    left.put("m/a/b", b"one", delivery)
    await ear.until(b"one")
    publication.put(b"two")
    await ear.until(b"two")
    assert ear.samples == [Sample("m/a/b", b"one"), Sample("m/x", b"two")]


async def test_one_publisher_keeps_its_order_across_subscriptions(team, linked, make_ear):
    left, right = await team.bus(), await team.bus()
    ear = make_ear()
    for chunk in ("a", "b", "c"):
        await right.subscribe(f"m/{chunk}", ear)
        await linked(left, f"m/{chunk}", ear)
    expected = [b"%d" % number for number in range(300)]
    for number, payload in enumerate(expected):
        left.put(f"m/{'abc'[number % 3]}", payload, Delivery.STATE)
    await ear.until(expected[-1])
    assert ear.payloads == expected


async def test_a_chunk_with_an_at_sign_is_heard_only_by_name(team, linked, make_ear):
    left, right = await team.bus(), await team.bus()
    wild, named = make_ear(), make_ear()
    await right.subscribe("m/**", wild)
    await right.subscribe("m/@chaos/*", named)
    await linked(left, "m/@chaos/rules", named)
    await linked(left, "m/plain", wild)
    left.put("m/@chaos/rules", b"hidden", Delivery.STATE)
    left.put("m/plain", b"plain", Delivery.STATE)
    await wild.until(b"plain")
    await named.until(b"hidden")
    assert (wild.payloads, named.payloads) == ([b"plain"], [b"hidden"])
    assert (wild.ready, named.ready) == ({"m/plain"}, {"m/@chaos/rules"})


async def test_a_participant_hears_itself_but_never_inside_put(team, make_ear):
    bus = await team.bus()
    ear = make_ear()
    await bus.subscribe("**/k", ear)
    bus.put("m/k", b"mine", Delivery.STATE)
    assert ear.samples == []
    await ear.until(b"mine")


async def test_a_pattern_need_not_be_canonical(team, make_ear):
    bus = await team.bus()
    ear = make_ear()
    await bus.subscribe("m/**/*", ear)
    bus.put("m/a/b", b"x", Delivery.STATE)
    await ear.until(b"x")


async def test_handlers_run_in_the_thread_of_the_loop(team, linked, asked, make_ear, make_watch):
    left, right = await team.bus(), await team.bus()
    ear, watch, threads = make_ear(), make_watch(), set()

    def answer(_):
        threads.add(threading.get_ident())
        return [Sample("m/q", b"yes")]

    await right.subscribe("m/k", ear)
    await right.answer("m/q", answer)
    await right.watch_presence("m/alive/*", watch)
    await linked(left, "m/k", ear)
    left.put("m/k", b"x", Delivery.STATE)
    await ear.until(b"x")
    await left.announce_presence("m/alive/r1")
    await watch.until(("m/alive/r1", True))
    assert await asked(left, "m/q", 1) == [("m/q", b"yes")]
    assert ear.threads == watch.threads == threads == {threading.get_ident()}


async def test_a_handler_that_raises_is_logged_once_and_harms_nobody(team, caplog, make_ear):
    bus = await team.bus()
    ear = make_ear()

    def fail(sample):
        raise KeyError(sample.payload)

    await bus.subscribe("m/k", fail)
    await bus.subscribe("m/k", ear)
    with caplog.at_level(logging.ERROR, "lalliance_agents.bus"):
        for payload in (b"1", b"2", b"3"):
            bus.put("m/k", payload, Delivery.STATE)
        await ear.until(b"3")
    assert ear.payloads == [b"1", b"2", b"3"]
    assert ["m/k" in record.message and "KeyError" in record.message for record in caplog.records] == [True]


async def test_nothing_is_delivered_after_unsubscribing(team, make_ear):
    bus = await team.bus()
    gone, ear = make_ear(), make_ear()
    registration = await bus.subscribe("m/k", gone)
    await bus.subscribe("m/k", ear)
    bus.put("m/k", b"queued", Delivery.STATE)
    await registration.close()
    await registration.close()
    bus.put("m/k", b"later", Delivery.STATE)
    await ear.until(b"later")
    assert gone.samples == []


async def test_that_the_bus_is_up_is_told_at_once_and_nothing_after_unsubscribing(team, eventually):
    bus, told = await team.bus(), []
    watch = await bus.watch_connection(told.append)
    await eventually(lambda: told)
    await watch.close()
    await watch.close()
    await bus.close()
    assert told == [True]
    with pytest.raises(RuntimeError, match="closed"):
        await bus.watch_connection(told.append)


async def test_a_handler_may_unsubscribe_itself(team, make_ear):
    bus = await team.bus()
    ear, once, closing = make_ear(), make_ear(), []

    def hear_once(sample):
        once(sample)
        closing.append(asyncio.ensure_future(registration.close()))

    registration = await bus.subscribe("m/k", hear_once)
    await bus.subscribe("m/k", ear)
    bus.put("m/k", b"1", Delivery.STATE)
    await ear.until(b"1")
    await asyncio.gather(*closing)
    bus.put("m/k", b"2", Delivery.STATE)
    await ear.until(b"2")
    assert once.payloads == [b"1"]


async def test_a_publication_knows_whether_somebody_listens(team, eventually, make_ear):
    left, right = await team.bus(), await team.bus()
    publication = await left.publication("m/mind/r1", Delivery.TELEMETRY)
    await right.subscribe("m/other/*", make_ear())
    assert not publication.has_listeners
    registration = await right.subscribe("m/mind/*", make_ear())
    await eventually(lambda: publication.has_listeners)
    assert publication.has_listeners is True
    await registration.close()
    await eventually(lambda: not publication.has_listeners)
    await publication.close()
    await publication.close()
    publication.put(b"ignored")
    assert not publication.has_listeners


async def test_close_twice_and_use_after_close(team, linked, make_ear):
    bus, other = await team.bus(), await team.bus()
    ear = make_ear()
    await other.subscribe("m/k", ear)
    publication = await bus.publication("m/k", Delivery.STATE)
    registration = await bus.subscribe("m/k", make_ear())
    await linked(bus, "m/k", ear)
    await bus.close()
    await bus.close()
    bus.put("m/k", b"late", Delivery.STATE)
    publication.put(b"late")
    other.put("m/k", b"alive", Delivery.STATE)
    await ear.until(b"alive")
    assert ear.payloads == [b"alive"]
    assert not publication.has_listeners
    await registration.close()
    await publication.close()
    assert await bus.query("m/**", timeout=TIMEOUT) == []
    with pytest.raises(RuntimeError, match="closed"):
        await bus.subscribe("m/k", ear)
    with pytest.raises(RuntimeError, match="closed"):
        await bus.publication("m/k", Delivery.STATE)
    with pytest.raises(RuntimeError, match="closed"):
        await bus.announce_presence("m/k")


async def test_a_closed_bus_delivers_nothing_that_was_queued(team, make_ear):
    bus = await team.bus()
    ear = make_ear()
    await bus.subscribe("m/k", ear)
    bus.put("m/k", b"queued", Delivery.STATE)
    await bus.close()
    assert ear.samples == []


async def test_close_goes_on_when_cancelled(team, make_watch):
    left, right = await team.bus(), await team.bus()
    watch = make_watch()
    await right.watch_presence("m/*", watch)
    await left.announce_presence("m/r1")
    await watch.until(("m/r1", True))
    closing = asyncio.ensure_future(left.close())
    await asyncio.sleep(0)
    closing.cancel()
    await watch.until(("m/r1", False))
    await asyncio.gather(closing, return_exceptions=True)


async def test_oversize_payloads_are_dropped_and_counted_where_they_arrive(team, linked, asked, make_ear):
    left, right = await team.bus(), await team.bus()
    ear = make_ear()
    await right.subscribe("m/k", ear)
    publication = await left.publication("m/k", Delivery.STATE)
    await linked(left, "m/k", ear)
    largest = bytes(MAX_PAYLOAD)
    publication.put(largest + b"!")
    left.put("m/k", largest, Delivery.STATE)
    await ear.until(largest)
    assert (ear.payloads, right.dropped_oversize, left.dropped_oversize) == ([largest], 1, 0)

    await right.answer("m/q", lambda _: [Sample("m/q", b"small"), Sample("m/q", largest + b"!")])
    assert await asked(left, "m/q", 1) == [("m/q", b"small")]
    assert (right.dropped_oversize, left.dropped_oversize) == (1, 1)
    async with asyncio.timeout(TIMEOUT):
        assert await left.query("m/q", largest + b"!", timeout=3600.0) == []
    assert (right.dropped_oversize, left.dropped_oversize) == (2, 1)


@pytest.mark.parametrize("bad", ["", "m//k", "/m", "m/$*", "k" * (MAX_KEY + 1), "k" * 70_000])
async def test_keys_and_patterns_that_are_none_are_refused(team, bad, make_ear, make_watch):
    bus = await team.bus()
    with pytest.raises(ValueError, match=r"a key of|not a key"):
        bus.put(bad, b"", Delivery.STATE)
    with pytest.raises(ValueError, match=r"a key of|not a key"):
        await bus.publication(bad, Delivery.STATE)
    with pytest.raises(ValueError, match=r"a key of|not a key"):
        await bus.announce_presence(bad)
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.subscribe(bad, make_ear())
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.answer(bad, lambda _: [])
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.watch_presence(bad, make_watch())
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.query(bad, timeout=TIMEOUT)
    ear = make_ear()
    await bus.subscribe("m/k", ear)
    bus.put("m/k", b"still well", Delivery.STATE)
    await ear.until(b"still well")


@pytest.mark.parametrize("key", ["m/*", "**"])
async def test_a_pattern_is_not_a_key(team, key):
    bus = await team.bus()
    with pytest.raises(ValueError, match="not a key"):
        bus.put(key, b"", Delivery.STATE)
    with pytest.raises(ValueError, match="not a key"):
        await bus.announce_presence(key)


async def test_a_flood_drops_the_oldest_and_counts_them(team, make_ear):
    bus = await team.bus()
    ear = make_ear()
    await bus.subscribe("m/k", ear)
    for number in range(CAPACITY + 10):
        bus.put("m/k", b"%d" % number, Delivery.TELEMETRY)
    await ear.until(b"%d" % (CAPACITY + 9))
    assert ear.payloads == [b"%d" % number for number in range(10, CAPACITY + 10)]
    assert bus.dropped_overflow == 10
