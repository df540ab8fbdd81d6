"""What only the real bus has: a router that comes and goes, a network to fail, threads, an interpreter to leave."""

import asyncio
import re
import socket

import pytest
import zenoh

from lalliance_agents.bus import session
from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.inbox import BATCH, CAPACITY
from lalliance_agents.bus.router import free_endpoint, open_router
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.errors import BusError

pytestmark = pytest.mark.timeout(90)

TIMEOUT = 20.0


async def test_all_works_again_after_the_router_was_killed_and_came_back(run_router, eventually):
    endpoint, heard, news, reached = free_endpoint(), [], [], []
    router = await run_router(endpoint)
    async with await open_bus(endpoint, timeout=1.0) as left, await open_bus(endpoint, timeout=1.0) as right:
        await right.subscribe("m/k", heard.append)
        await right.answer("m/q", lambda _: [Sample("m/q", b"yes")])
        await right.watch_presence("m/alive/*", lambda *change: news.append(change))
        await right.watch_connection(reached.append)
        publication = await left.publication("m/k", Delivery.STATE)
        await left.announce_presence("m/alive/r1")
        await eventually(lambda: publication.has_listeners and news == [("m/alive/r1", True)])

        await router.kill()
        await eventually(lambda: not publication.has_listeners and news[1:] == [("m/alive/r1", False)])
        publication.put(b"lost")
        async with asyncio.timeout(TIMEOUT):
            assert await left.query("m/q", timeout=3600.0) == []

        # Down for longer than the first connection may take: that limit is not one on reconnecting.
        back = asyncio.get_running_loop().time() + 1.5
        await eventually(lambda: asyncio.get_running_loop().time() > back)
        await run_router(endpoint)
        await eventually(lambda: publication.has_listeners and news[2:] == [("m/alive/r1", True)])
        publication.put(b"again")
        await eventually(lambda: heard == [Sample("m/k", b"again")])

        async def answered():
            return await left.query("m/q", timeout=TIMEOUT) == [Sample("m/q", b"yes")]

        await eventually(answered)
    assert news[3:] == []
    assert reached == [True, False, True]


async def test_what_is_declared_without_a_router_works_once_there_is_one(run_router, eventually):
    endpoint, heard, news = free_endpoint(), [], []
    router = await run_router(endpoint)
    async with await open_bus(endpoint) as left, await open_bus(endpoint) as right:
        mark = await left.announce_presence("m/mark")
        await right.watch_presence("m/mark", lambda *change: news.append(change))
        await eventually(lambda: news == [("m/mark", True)])
        await router.kill()
        await eventually(lambda: news[1:] == [("m/mark", False)])
        await mark.close()
        await right.subscribe("m/k", heard.append)
        publication = await left.publication("m/k", Delivery.STATE)
        await left.announce_presence("m/mark")
        await run_router(endpoint)
        await eventually(lambda: publication.has_listeners and news[2:] == [("m/mark", True)])
        publication.put(b"x")
        await eventually(lambda: heard == [Sample("m/k", b"x")])


async def test_an_unreachable_router_is_an_error_within_the_timeout():
    endpoint = free_endpoint()
    started = asyncio.get_running_loop().time()
    with pytest.raises(BusError, match=rf"No router could be reached at {endpoint} within 0\.3 s: check") as caught:
        await open_bus(endpoint, timeout=0.3)
    assert asyncio.get_running_loop().time() - started < 5.0
    assert ".rs" not in str(caught.value)


async def test_a_server_that_never_answers_is_not_a_router():
    with socket.create_server(("127.0.0.1", 0)) as mute, pytest.raises(BusError, match="No router could be reached"):
        await open_bus(f"tcp/127.0.0.1:{mute.getsockname()[1]}", timeout=0.3)


async def test_an_unknown_host_is_an_error():
    with pytest.raises(BusError, match=r"No router could be reached at tcp/no-such-host\.invalid:7447"):
        await open_bus("tcp/no-such-host.invalid:7447", timeout=0.3)


async def test_a_router_may_start_after_its_clients(run_router):
    endpoint = free_endpoint()
    opening = asyncio.ensure_future(open_bus(endpoint, timeout=TIMEOUT))
    await run_router(endpoint)
    await (await opening).close()


async def test_cancelled_while_connecting_leaves_no_session_behind(monkeypatch, eventually):
    opened, loop, entered = [], asyncio.get_running_loop(), asyncio.Event()
    real = zenoh.open

    def open_and_tell(config):
        loop.call_soon_threadsafe(entered.set)
        opened.append(real(config))
        return opened[0]

    monkeypatch.setattr(session.zenoh, "open", open_and_tell)
    endpoint = free_endpoint()
    opening = asyncio.ensure_future(open_bus(endpoint, timeout=TIMEOUT))
    await entered.wait()
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    monkeypatch.undo()
    async with await open_router(endpoint):
        await eventually(lambda: opened and opened[0].is_closed())


@pytest.mark.parametrize(
    "endpoint",
    ["", "nonsense", "127.0.0.1:7447", "tcp/127.0.0.1", "tcp/:7447", "tcp/h:0", "tcp/h:70000", "ftp/h:1", "tcp/a b:1"],
)
async def test_what_is_not_an_endpoint_is_refused_with_a_sentence(endpoint):
    expected = re.escape(f"{endpoint!r} is not an endpoint of the bus; expected <protocol>/<host>:<port>")
    with pytest.raises(BusError, match=expected):
        await open_bus(endpoint)
    with pytest.raises(BusError, match=expected):
        await open_router(endpoint)


@pytest.mark.parametrize(
    "endpoint", ["tcp/h-1.example:7447", "tls/[::1]:7447#root_ca_certificate=ca.pem", "udp/h:1?rel=0"]
)
def test_what_is_an_endpoint(endpoint):
    session.check_endpoint(endpoint)


async def test_a_port_in_use_is_an_error_that_names_it():
    async with await open_router(free_endpoint()) as router:
        with pytest.raises(BusError, match=f"cannot listen on {router.endpoint}: the port is in use") as caught:
            await open_router(router.endpoint)
        assert ".rs" not in str(caught.value)


async def test_a_foreign_address_cannot_be_listened_on():
    with pytest.raises(BusError, match=r"cannot listen on tcp/192\.0\.2\.1:7447: check"):
        await open_router("tcp/192.0.2.1:7447")


async def test_a_closed_router_frees_its_port():
    endpoint = free_endpoint()
    for _ in range(3):
        router = await open_router(endpoint)
        await router.close()
        await router.close()


async def test_a_flood_does_not_starve_the_loop(eventually):
    """Between two turns of a concurrent task at most one batch is handled."""
    heard, most, turns = [], 0, 0

    async def tick():
        nonlocal turns, most
        while True:
            before = len(heard)
            await asyncio.sleep(0)
            most, turns = max(most, len(heard) - before), turns + 1

    async with (
        await open_router(free_endpoint()) as router,
        await open_bus(router.endpoint) as left,
        await open_bus(router.endpoint) as right,
    ):
        await right.subscribe("m/k", lambda sample: heard.append(sample.payload))
        publication = await left.publication("m/k", Delivery.STATE)
        await eventually(lambda: publication.has_listeners)
        ticking = asyncio.ensure_future(tick())
        for number in range(50_000):
            publication.put(b"%d" % number)
            if number % 1000 == 0:
                await asyncio.sleep(0)

        def is_through():
            publication.put(b"end")
            return b"end" in heard[-100:]

        await eventually(is_through)
        ticking.cancel()
    numbers = [int(payload) for payload in heard if payload != b"end"]
    assert len(numbers) > BATCH
    assert numbers == sorted(numbers)
    assert most <= BATCH
    assert turns >= len(heard) / BATCH


async def test_a_flood_is_bounded_and_drops_the_oldest(eventually):
    """Nothing is lost between two ends of one session, so all that is missing was dropped here, and counted."""
    heard = []
    async with await open_router(free_endpoint()) as router, await open_bus(router.endpoint) as bus:
        await bus.subscribe("m/k", lambda sample: heard.append(int(sample.payload)))
        for number in range(50_000):
            bus.put("m/k", b"%d" % number, Delivery.STATE)
        assert (heard, bus.dropped_overflow) == ([], 50_000 - CAPACITY)
        await eventually(lambda: len(heard) == CAPACITY)
    assert heard == list(range(50_000 - CAPACITY, 50_000))


async def test_queries_dropped_in_a_flood_still_end():
    """The loop is kept busy while more queries come than may wait; each of them ends, answered or not."""
    async with await open_router(free_endpoint()) as router, await open_bus(router.endpoint) as bus:
        await bus.answer("m/q", lambda _: [Sample("m/q", b"yes")])
        async with asyncio.timeout(60):
            replies = await asyncio.gather(*(bus.query("m/q", timeout=3600.0) for _ in range(CAPACITY + 100)))
        assert bus.dropped_overflow == 100
        assert sorted(map(len, replies)) == [0] * 100 + [1] * CAPACITY


FLOOD_AND_CLOSE = """
import asyncio, sys
from lalliance_agents.bus.base import Delivery
from lalliance_agents.bus.zenoh_bus import open_bus

async def main():
    bus, listener = await open_bus(sys.argv[1]), await open_bus(sys.argv[1])
    await listener.subscribe("m/k", lambda _: None)
    publication = await bus.publication("m/k", Delivery.STATE)
    while not publication.has_listeners:
        await asyncio.sleep(0.005)
    print("connected", flush=True)
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.readline)
    for _ in range(1000):
        publication.put(bytes(60_000))
    before = asyncio.get_running_loop().time()
    await bus.close()
    await listener.close()
    print(asyncio.get_running_loop().time() - before)

asyncio.run(main())
"""

NEVER_CLOSED = """
import asyncio, sys
from lalliance_agents.bus.router import free_endpoint, open_router
from lalliance_agents.bus.zenoh_bus import open_bus

async def main():
    global router, bus
    router = await open_router(free_endpoint())
    bus = await open_bus(router.endpoint)
    await bus.subscribe("m/**", lambda _: None)
    await bus.answer("m/**", lambda _: [])
    await bus.watch_presence("m/**", lambda *_: None)
    await bus.announce_presence("m/r1")
    exec(sys.argv[1])

asyncio.run(main())
"""


async def test_a_router_that_hangs_does_not_hold_up_closing(run_router, run_python):
    """The farewell waits behind a full queue for 10 s; the bus leaves all the same, and so does the process."""
    endpoint = free_endpoint()
    router = await run_router(endpoint)
    client = await run_python(FLOOD_AND_CLOSE, endpoint)
    assert await client.first_line() == "connected"
    router.hang()
    status, out, err = await client.finish("\n")
    assert (status, err) == (0, "")
    assert float(out) < 5.0


@pytest.mark.parametrize(
    ("end", "status"), [("pass", 0), ("del globals()['bus']", 0), ("raise SystemExit(3)", 3), ("1 / 0", 1)]
)
async def test_a_bus_that_is_never_closed_does_not_keep_the_interpreter(run_python, end, status):
    process = await run_python(NEVER_CLOSED, end)
    ended, out, _ = await process.finish()
    assert (ended, out) == (status, "")
