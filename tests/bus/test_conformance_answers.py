"""What every bus promises, checked on each of them: queries and presence.

An answerer on the real bus is found a moment after it is declared, so tests ask again until it answers (`asked`).
"""

import asyncio
import logging

import pytest

from lalliance_agents.bus.base import Sample

pytestmark = pytest.mark.timeout(60)

TIMEOUT = 20.0


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


async def test_late_watchers_are_told_who_is_present(team, make_watch):
    left, right = await team.bus(), await team.bus()
    early, late, other = make_watch(), make_watch(), make_watch()
    await right.watch_presence("m/alive/*", early)
    await left.announce_presence("m/alive/r1")
    await early.until(("m/alive/r1", True))
    await right.watch_presence("m/*/*", late)
    await right.watch_presence("m/dead/*", other)
    await late.until(("m/alive/r1", True))
    assert (early.news, other.news) == ([("m/alive/r1", True)], [])


async def test_presence_ends_politely(team, make_watch):
    left, right, third = await team.bus(), await team.bus(), await team.bus()
    watch = make_watch()
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


async def test_presence_ends_with_a_participant_that_is_killed(team, make_watch):
    bus = await team.bus()
    watch = make_watch()
    await bus.watch_presence("m/alive/*", watch)
    kill = await team.mortal("m/alive/r1")
    await watch.until(("m/alive/r1", True))
    await kill()
    await watch.until(("m/alive/r1", False))
    assert len(watch.news) == 2


async def test_two_announcements_of_one_key_are_one_presence(team, make_watch):
    left, right, third = await team.bus(), await team.bus(), await team.bus()
    watch = make_watch()
    await third.watch_presence("m/alive/*", watch)
    first = await left.announce_presence("m/alive/r1")
    await watch.until(("m/alive/r1", True))
    second = await right.announce_presence("m/alive/r1")
    await right.announce_presence("m/alive/mark")
    await watch.until(("m/alive/mark", True))
    await first.close()
    await left.announce_presence("m/alive/end")
    await watch.until(("m/alive/end", True))
    await second.close()
    await watch.until(("m/alive/r1", False))
    assert [present for key, present in watch.news if key == "m/alive/r1"] == [True, False]


async def test_a_watch_that_is_closed_hears_no_more(team, make_watch):
    bus = await team.bus()
    gone, watch = make_watch(), make_watch()
    registration = await bus.watch_presence("m/*", gone)
    await bus.watch_presence("m/*", watch)
    await registration.close()
    await registration.close()
    await bus.announce_presence("m/r1")
    await watch.until(("m/r1", True))
    assert gone.news == []


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
async def test_a_query_s_timeout_is_checked(team, seconds):
    bus = await team.bus()
    with pytest.raises(ValueError, match="timeout"):
        await bus.query("m/q", timeout=seconds)
