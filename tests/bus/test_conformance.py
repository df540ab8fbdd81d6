"""What every bus promises, checked on each of them.

A declaration on the real bus takes effect a moment later, so tests publish `READY` until it is heard, or ask again until
somebody answers. Where it matters that something does *not* arrive, a later message shows that it would have.
"""

import asyncio
import logging
import threading

import pytest

from lalliance_agents.bus.base import MAX_PAYLOAD, Delivery, Sample
from lalliance_agents.bus.inbox import CAPACITY
from lalliance_agents.bus.patterns import MAX_KEY

pytestmark = pytest.mark.timeout(60)

TIMEOUT = 10.0
READY = b"ready?"


class Ear:
    """A handler that remembers all but `READY`, and in which thread it was called."""

    def __init__(self):
        self.ready = set()
        self.samples = []
        self.threads = set()
        self._grown = asyncio.Event()

    def __call__(self, sample):
        if sample.payload == READY:
            self.ready.add(sample.key)
            return
        self.samples.append(sample)
        self.threads.add(threading.get_ident())
        self._grown.set()

    @property
    def payloads(self):
        return [sample.payload for sample in self.samples]

    async def until(self, payload):
        async with asyncio.timeout(TIMEOUT):
            while all(sample.payload != payload for sample in reversed(self.samples)):
                self._grown.clear()
                await self._grown.wait()


class Watch:
    """A presence handler that remembers."""

    def __init__(self):
        self.news = []
        self.threads = set()
        self._grown = asyncio.Event()

    def __call__(self, key, present):
        self.news.append((key, present))
        self.threads.add(threading.get_ident())
        self._grown.set()

    async def until(self, *news):
        async with asyncio.timeout(TIMEOUT):
            while news not in (tuple(self.news[-len(news) :]),):
                self._grown.clear()
                await self._grown.wait()


@pytest.fixture
def linked(eventually):
    """Wait until what `bus` puts on `key` is heard by `ear`."""

    async def link(bus, key, ear):
        def heard():
            bus.put(key, READY, Delivery.STATE)
            return key in ear.ready

        await eventually(heard)

    return link


@pytest.fixture
def asked(eventually):
    """Ask until `count` answers come; return the payloads, sorted."""

    async def ask(bus, pattern, count, payload=b""):
        replies = []

        async def enough():
            replies[:] = await bus.query(pattern, payload, timeout=TIMEOUT)
            return len(replies) == count

        await eventually(enough)
        return sorted((reply.key, reply.payload) for reply in replies)

    return ask


async def test_messages_arrive_in_the_order_of_their_publisher(team, linked):
    left, right = await team.bus(), await team.bus()
    ear = Ear()
    await right.subscribe("m/activity/*", ear)
    publication = await left.publication("m/activity/t1", Delivery.PRESENCE)
    await linked(left, "m/activity/t1", ear)
    expected = [Sample("m/activity/t1", b"%d" % number) for number in range(500)]
    for sample in expected:
        publication.put(sample.payload)
    await ear.until(b"499")
    assert ear.samples == expected


@pytest.mark.parametrize("delivery", Delivery)
async def test_put_reaches_subscribers_with_every_delivery(team, linked, delivery):
    left, right = await team.bus(), await team.bus()
    ear = Ear()
    await right.subscribe("m/**", ear)
    publication = await left.publication("m/x", delivery)
    await linked(left, "m/x", ear)
    await linked(left, "m/a/b", ear)
    left.put("m/a/b", b"one", delivery)
    await ear.until(b"one")
    publication.put(b"two")
    await ear.until(b"two")
    assert ear.samples == [Sample("m/a/b", b"one"), Sample("m/x", b"two")]


async def test_one_publisher_keeps_its_order_across_subscriptions(team, linked):
    left, right = await team.bus(), await team.bus()
    ear = Ear()
    for chunk in ("a", "b", "c"):
        await right.subscribe(f"m/{chunk}", ear)
        await linked(left, f"m/{chunk}", ear)
    expected = [b"%d" % number for number in range(300)]
    for number, payload in enumerate(expected):
        left.put(f"m/{'abc'[number % 3]}", payload, Delivery.STATE)
    await ear.until(expected[-1])
    assert ear.payloads == expected


async def test_a_chunk_with_an_at_sign_is_heard_only_by_name(team, linked):
    left, right = await team.bus(), await team.bus()
    wild, named = Ear(), Ear()
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


async def test_a_participant_hears_itself_but_never_inside_put(team):
    bus = await team.bus()
    ear = Ear()
    await bus.subscribe("**/k", ear)
    bus.put("m/k", b"mine", Delivery.STATE)
    assert ear.samples == []
    await ear.until(b"mine")


async def test_a_pattern_need_not_be_canonical(team):
    bus = await team.bus()
    ear = Ear()
    await bus.subscribe("m/**/*", ear)
    bus.put("m/a/b", b"x", Delivery.STATE)
    await ear.until(b"x")


async def test_handlers_run_in_the_thread_of_the_loop(team, linked, asked):
    left, right = await team.bus(), await team.bus()
    ear, watch, threads = Ear(), Watch(), set()

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


async def test_a_handler_that_raises_is_logged_once_and_harms_nobody(team, caplog):
    bus = await team.bus()
    ear = Ear()

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


async def test_nothing_is_delivered_after_unsubscribing(team):
    bus = await team.bus()
    gone, ear = Ear(), Ear()
    registration = await bus.subscribe("m/k", gone)
    await bus.subscribe("m/k", ear)
    bus.put("m/k", b"queued", Delivery.STATE)
    await registration.close()
    await registration.close()
    bus.put("m/k", b"later", Delivery.STATE)
    await ear.until(b"later")
    assert gone.samples == []


async def test_a_handler_may_unsubscribe_itself(team):
    bus = await team.bus()
    ear, once, closing = Ear(), Ear(), []

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


async def test_a_publication_knows_whether_somebody_listens(team, eventually):
    left, right = await team.bus(), await team.bus()
    publication = await left.publication("m/mind/r1", Delivery.TELEMETRY)
    await right.subscribe("m/other/*", Ear())
    assert not publication.has_listeners
    registration = await right.subscribe("m/mind/*", Ear())
    await eventually(lambda: publication.has_listeners)
    assert publication.has_listeners is True
    await registration.close()
    await eventually(lambda: not publication.has_listeners)
    await publication.close()
    await publication.close()
    publication.put(b"ignored")
    assert not publication.has_listeners


async def test_all_answers_come_back(team, asked):
    asker, one, two = await team.bus(), await team.bus(), await team.bus()
    await one.answer("m/sense/*", lambda ask: [Sample("m/sense/a", ask.payload), Sample("m/sense/b", b"1")])
    await two.answer("m/**", lambda ask: [Sample("m/sense/a", b"2 " + ask.key.encode())])
    await asker.answer("m/sense/c", lambda _: [Sample("m/sense/c", b"own")])
    assert await asked(asker, "m/sense/*", 4, b"what?") == [
        ("m/sense/a", b"2 m/sense/*"),
        ("m/sense/a", b"what?"),
        ("m/sense/b", b"1"),
        ("m/sense/c", b"own"),
    ]


async def test_a_query_that_nobody_answers_has_no_answers_at_once(team):
    left, right = await team.bus(), await team.bus()
    await right.answer("m/other/*", lambda _: [Sample("m/other/x", b"")])
    async with asyncio.timeout(TIMEOUT):
        assert await left.query("m/sense/*", timeout=3600.0) == []


async def test_an_answerer_that_raises_gives_no_answer_but_ends_the_query(team, asked, caplog):
    left, right = await team.bus(), await team.bus()

    def fail(_):
        raise ZeroDivisionError

    await right.answer("m/q", fail)
    await right.answer("m/q", lambda _: [Sample("m/q", b"well")])
    with caplog.at_level(logging.ERROR, "lalliance_agents.bus"):
        async with asyncio.timeout(TIMEOUT):
            assert await asked(left, "m/q", 1) == [("m/q", b"well")]
    assert ["ZeroDivisionError" in record.message for record in caplog.records] == [True]


@pytest.mark.parametrize("key", ["elsewhere", "m/*", "m//q"])
async def test_an_answer_to_what_was_not_asked_is_the_answerer_s_failure(team, asked, caplog, key):
    left, right = await team.bus(), await team.bus()
    await right.answer("m/q", lambda _: [Sample("m/q", b"lost with the other"), Sample(key, b"bad")])
    await right.answer("m/q", lambda _: [Sample("m/q", b"good")])
    with caplog.at_level(logging.ERROR, "lalliance_agents.bus"):
        assert await asked(left, "m/q", 1) == [("m/q", b"good")]
    assert ["ValueError" in record.message for record in caplog.records] == [True]


async def test_an_answerer_that_has_gone_answers_no_more(team, asked):
    left, right = await team.bus(), await team.bus()
    registration = await right.answer("m/q", lambda _: [Sample("m/q", b"")])
    await asked(left, "m/q", 1)
    await registration.close()
    await asked(left, "m/q", 0)


async def test_a_closing_bus_ends_its_queries(team, asked):
    left, right = await team.bus(), await team.bus()
    waiting = []

    def answer(_):
        waiting.append(asyncio.ensure_future(left.close()))
        return []

    await right.answer("m/q", answer)
    async with asyncio.timeout(TIMEOUT):
        while not waiting:
            await left.query("m/q", timeout=3600.0)
        await asyncio.gather(*waiting)
    assert await left.query("m/q", timeout=3600.0) == []


async def test_late_watchers_are_told_who_is_present(team):
    left, right = await team.bus(), await team.bus()
    early, late, other = Watch(), Watch(), Watch()
    await right.watch_presence("m/alive/*", early)
    await left.announce_presence("m/alive/r1")
    await early.until(("m/alive/r1", True))
    await right.watch_presence("m/*/*", late)
    await right.watch_presence("m/dead/*", other)
    await late.until(("m/alive/r1", True))
    assert (early.news, other.news) == ([("m/alive/r1", True)], [])


async def test_presence_ends_politely(team):
    left, right, third = await team.bus(), await team.bus(), await team.bus()
    watch = Watch()
    await right.watch_presence("m/alive/*", watch)
    presence = await left.announce_presence("m/alive/r1")
    await watch.until(("m/alive/r1", True))
    await presence.close()
    await presence.close()
    await watch.until(("m/alive/r1", False))
    await third.announce_presence("m/alive/r2")
    await watch.until(("m/alive/r2", True))
    await third.close()
    await watch.until(("m/alive/r2", False))
    assert len(watch.news) == 4


async def test_presence_ends_with_a_participant_that_is_killed(team):
    bus = await team.bus()
    watch = Watch()
    await bus.watch_presence("m/alive/*", watch)
    kill = await team.mortal("m/alive/r1")
    await watch.until(("m/alive/r1", True))
    await kill()
    await watch.until(("m/alive/r1", False))
    assert len(watch.news) == 2


async def test_two_announcements_of_one_key_are_one_presence(team):
    left, right = await team.bus(), await team.bus()
    watch = Watch()
    await right.watch_presence("m/alive/*", watch)
    first = await left.announce_presence("m/alive/r1")
    second = await right.announce_presence("m/alive/r1")
    await watch.until(("m/alive/r1", True))
    await first.close()
    await left.announce_presence("m/alive/mark")
    await watch.until(("m/alive/r1", True), ("m/alive/mark", True))
    await second.close()
    await watch.until(("m/alive/mark", True), ("m/alive/r1", False))


async def test_a_watch_that_is_closed_hears_no_more(team):
    bus = await team.bus()
    gone, watch = Watch(), Watch()
    registration = await bus.watch_presence("m/*", gone)
    await bus.watch_presence("m/*", watch)
    await registration.close()
    await registration.close()
    await bus.announce_presence("m/r1")
    await watch.until(("m/r1", True))
    assert gone.news == []


async def test_close_twice_and_use_after_close(team, linked):
    bus, other = await team.bus(), await team.bus()
    ear = Ear()
    await other.subscribe("m/k", ear)
    publication = await bus.publication("m/k", Delivery.STATE)
    registration = await bus.subscribe("m/k", Ear())
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


async def test_a_closed_bus_delivers_nothing_that_was_queued(team):
    bus = await team.bus()
    ear = Ear()
    await bus.subscribe("m/k", ear)
    bus.put("m/k", b"queued", Delivery.STATE)
    await bus.close()
    assert ear.samples == []


async def test_close_goes_on_when_cancelled(team):
    left, right = await team.bus(), await team.bus()
    watch = Watch()
    await right.watch_presence("m/*", watch)
    await left.announce_presence("m/r1")
    await watch.until(("m/r1", True))
    closing = asyncio.ensure_future(left.close())
    await asyncio.sleep(0)
    closing.cancel()
    await watch.until(("m/r1", False))
    await asyncio.gather(closing, return_exceptions=True)


async def test_oversize_payloads_are_dropped_and_counted_where_they_arrive(team, linked, asked):
    left, right = await team.bus(), await team.bus()
    ear = Ear()
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
async def test_keys_and_patterns_that_are_none_are_refused(team, bad):
    bus = await team.bus()
    with pytest.raises(ValueError, match=r"a key of|not a key"):
        bus.put(bad, b"", Delivery.STATE)
    with pytest.raises(ValueError, match=r"a key of|not a key"):
        await bus.publication(bad, Delivery.STATE)
    with pytest.raises(ValueError, match=r"a key of|not a key"):
        await bus.announce_presence(bad)
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.subscribe(bad, Ear())
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.answer(bad, lambda _: [])
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.watch_presence(bad, Watch())
    with pytest.raises(ValueError, match=r"a pattern of|not a pattern"):
        await bus.query(bad, timeout=TIMEOUT)
    ear = Ear()
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


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
async def test_a_query_s_timeout_is_checked(team, seconds):
    bus = await team.bus()
    with pytest.raises(ValueError, match="timeout"):
        await bus.query("m/q", timeout=seconds)


async def test_a_flood_drops_the_oldest_and_counts_them(team):
    bus = await team.bus()
    ear = Ear()
    await bus.subscribe("m/k", ear)
    for number in range(CAPACITY + 10):
        bus.put("m/k", b"%d" % number, Delivery.TELEMETRY)
    await ear.until(b"%d" % (CAPACITY + 9))
    assert ear.payloads == [b"%d" % number for number in range(10, CAPACITY + 10)]
    assert bus.dropped_overflow == 10
