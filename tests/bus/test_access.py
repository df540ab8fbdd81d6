"""Who may say what on an encrypted bus: a real router, and participants that try what is not theirs.

Nothing tells a sender that it was denied. So each attempt is followed by a message that is allowed: messages of one sender
arrive in order, and what has not come before that one does not come.
"""

from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
import zenoh
from support.secured import new_keys

from lalliance_agents.bus.access import access_control
from lalliance_agents.bus.base import Delivery, Sample
from lalliance_agents.bus.credentials import ROUTER, Credentials, KeysError, credentials_in
from lalliance_agents.bus.patterns import matches
from lalliance_agents.bus.router import Router, free_endpoint, open_router
from lalliance_agents.bus.session import client_settings, open_session
from lalliance_agents.bus.zenoh_bus import ZenohBus, open_bus
from lalliance_agents.errors import BusError, MessageError
from lalliance_agents.wire.keys import OPERATOR, WORLD, Keys, Kind

pytestmark = pytest.mark.timeout(60)

M = "lalliance/m/"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return new_keys(tmp_path_factory.mktemp("made") / "keys", "r1", "r2")


@pytest.fixture
async def router(keys: Path) -> AsyncIterator[Router]:
    async with await open_router(free_endpoint("tls"), credentials=credentials_in(keys, ROUTER)) as running:
        yield running


@pytest.fixture
async def join(router: Router, keys: Path) -> AsyncIterator[Callable]:
    """A participant of the bus, with the keys of its name."""
    opened: list[ZenohBus] = []

    async def open_as(name: str) -> ZenohBus:
        opened.append(await open_bus(router.endpoint, credentials=credentials_in(keys, name)))
        return opened[-1]

    yield open_as
    for bus in opened:
        await bus.close()


async def heard_from(speaker, listener, eventually, attempts: list[str], allowed: str) -> list[str]:
    """Which of the keys under the mission arrive when `speaker` publishes on each."""
    heard: list[Sample] = []
    for pattern in (f"{M}**", f"{M}@chaos/**"):
        await listener.subscribe(pattern, heard.append)

    async def pass_through(mark: bytes) -> None:
        def is_through() -> bool:
            speaker.put(M + allowed, mark, Delivery.STATE)
            return mark in [sample.payload for sample in heard]

        await eventually(is_through)

    await pass_through(b"before")
    for key in attempts:
        speaker.put(M + key, b"attempt", Delivery.STATE)
    await pass_through(b"after")
    return [sample.key.removeprefix(M) for sample in heard if sample.payload == b"attempt"]


EVERY_KEY = [
    "activity/a/r1",
    "activity/a/r2",
    "heartbeat/r1",
    "heartbeat/r2",
    "hello/r1",
    "hello/r2",
    "body/r1/action",
    "body/r2/action",
    "sense/task/a",
    "sense/robot/r1",
    "mind/r1/decision",
    "mind/r1/motivation",
    "mind/r2/decision",
    "link/r1",
    "link/r2",
    "world/event",
    "world/status",
    "@chaos/rules",
    "@chaos/command",
    "@chaos/deed",
    "@chaos/launcher",
    "alive/r1",
    "of/no/kind",
]

PUBLISHED = {
    "r1": [
        "activity/a/r1",
        "heartbeat/r1",
        "hello/r1",
        "body/r1/action",
        "mind/r1/decision",
        "mind/r1/motivation",
        "link/r1",
    ],
    WORLD: ["sense/task/a", "sense/robot/r1", "world/event", "world/status", "@chaos/rules"],
    OPERATOR: ["@chaos/deed"],
}


@pytest.mark.parametrize("name", PUBLISHED)
async def test_each_publishes_on_its_own_keys_and_on_no_other(join, eventually, name: str) -> None:
    own = PUBLISHED[name]
    came = await heard_from(
        await join(name), await join("r2"), eventually, [k for k in EVERY_KEY if k != own[0]], own[0]
    )
    assert sorted(came) == sorted(own[1:])


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_rules_let_each_publish_on_its_own_keys_and_on_no_other(name: str) -> None:
    """The same without a router."""
    rules = access_control(["r1", "r2"])
    bound = {rule for policy in rules["policies"] if name in policy["subjects"] for rule in policy["rules"]}
    allowed = [
        key
        for rule in rules["rules"]
        if rule["id"] in bound and "put" in rule["messages"] and "ingress" in rule["flows"]
        for key in rule["key_exprs"]
    ]
    assert [key for key in EVERY_KEY if any(matches(pattern, M + key) for pattern in allowed)] == [
        key for key in EVERY_KEY if key in PUBLISHED[name]
    ]


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
async def test_whatever_a_session_says_that_it_is_its_certificate_decides(
    router: Router, keys: Path, join, eventually, mode: str
) -> None:
    listener, heard = await join("r2"), []
    await listener.subscribe(f"{M}**", lambda sample: heard.append(sample.payload))
    settings = client_settings(router.endpoint, 5.0, credentials_in(keys, "r1"))
    session = await open_session(settings | {"mode": mode, "listen": {"endpoints": []}})
    try:
        for mark in (b"before", b"after"):

            def is_through(mark: bytes = mark) -> bool:
                session.put(f"{M}heartbeat/r1", mark)
                return mark in heard

            await eventually(is_through)
            for key in (f"{M}heartbeat/r2", f"{M}heartbeat/*", "lalliance/**", f"{M}sense/task/a"):
                session.put(key, b"forged")
            session.delete(f"{M}heartbeat/r1")
    finally:
        session.close()
    assert set(heard) == {b"before", b"after"}


async def test_a_wildcard_inside_what_is_its_own_passes_the_router_and_is_no_key_to_a_receiver(
    router: Router, keys: Path, join, eventually
) -> None:
    """What the router cannot refuse the receivers do: a key with a wildcard is none."""
    listener, heard = await join("r2"), []
    await listener.subscribe("lalliance/**", lambda sample: heard.append(sample.key))
    session = await open_session(client_settings(router.endpoint, 5.0, credentials_in(keys, "r1")))
    try:

        def is_through() -> bool:
            session.put("lalliance/*/activity/*/r1", b"to all missions")
            return bool(heard)

        await eventually(is_through)
    finally:
        session.close()
    with pytest.raises(MessageError, match="is not a key of this mission"):
        Keys("m").parse(heard[0])


async def test_a_robot_cannot_be_there_as_another(join, eventually) -> None:
    watcher, robot, seen = await join(OPERATOR), await join("r1"), []
    await watcher.watch_presence(f"{M}alive/*", lambda *change: seen.append(change))
    await watcher.watch_presence(f"{M}@chaos/launcher", lambda *change: seen.append(change))
    await robot.announce_presence(f"{M}alive/r2")
    await robot.announce_presence(f"{M}@chaos/launcher")
    await robot.announce_presence(f"{M}alive/r1")
    await eventually(lambda: seen == [(f"{M}alive/r1", True)])


async def test_a_robot_answers_for_itself_and_not_for_the_world(join, eventually) -> None:
    world, robot, asker = await join(WORLD), await join("r1"), await join("r2")
    await robot.answer(f"{M}sense/task/*", lambda _: [Sample(f"{M}sense/task/a", b"forged")])
    await robot.answer(f"{M}**", lambda _: [Sample(f"{M}sense/task/a", b"forged")])
    await world.answer(f"{M}sense/task/*", lambda _: [Sample(f"{M}sense/task/a", b"true")])
    await robot.answer(f"{M}hello/r1", lambda _: [Sample(f"{M}hello/r1", b"hello")])
    for key in ("mind/r1/decision", "world/event"):
        await robot.answer(M + key, lambda asked: [Sample(asked.key, b"forged")])
        await world.answer(M + key, lambda asked: [Sample(asked.key, b"remembered")])
    kinds = ("sense/task/*", "hello/*", "mind/r1/decision", "world/event")

    async def answers() -> set[bytes]:
        return {one.payload for kind in kinds for one in await asker.query(M + kind, timeout=5.0)}

    async def all_that_may() -> bool:
        return await answers() >= {b"true", b"hello", b"remembered"}

    await eventually(all_that_may)
    assert await answers() == {b"true", b"hello", b"remembered"}


async def test_only_an_operator_commands(join, eventually) -> None:
    world, robot, operator, asked = await join(WORLD), await join("r1"), await join(OPERATOR), []

    def carry_out(command: Sample) -> list[Sample]:
        asked.append(command.payload)
        return [Sample(command.key, b"done")]

    command = Keys("m").build(Kind.CHAOS_COMMAND)
    await world.answer(command, carry_out)

    async def is_done() -> bool:
        return [one.payload for one in await operator.query(command, b"operator", timeout=5.0)] == [b"done"]

    await eventually(is_done)
    assert await robot.query(command, b"robot", timeout=0.5) == []
    assert await robot.query(f"{M}@chaos/*", b"robot", timeout=0.5) == []
    assert set(asked) == {b"operator"}


async def test_a_client_without_a_certificate_is_refused(router: Router, keys: Path) -> None:
    """Whether it speaks TLS, knows the authority, or neither."""
    settings = client_settings(router.endpoint, 0.5, credentials_in(keys, "r1"))
    tls = settings["transport"]["link"]["tls"]
    settings["transport"]["link"]["tls"] = {"root_ca_certificate": tls["root_ca_certificate"]}
    with pytest.raises(zenoh.ZError):
        await open_session(settings)
    with pytest.raises(BusError, match="that it asks for no keys"):
        await open_bus(router.endpoint.replace("tls/", "tcp/"), timeout=0.5)
    with pytest.raises(KeysError, match="is encrypted; expected --keys"):
        await open_bus(router.endpoint)


async def test_a_foreign_certificate_is_refused(router: Router, tmp_path: Path) -> None:
    foreign = new_keys(tmp_path / "foreign", "r1")
    with pytest.raises(BusError, match="come from the same `lalliance keys init` as the router's"):
        await open_bus(router.endpoint, timeout=0.5, credentials=credentials_in(foreign, "r1"))


async def test_a_certificate_of_the_same_authority_does_not_make_a_router(keys: Path) -> None:
    """A robot cannot pose as the router to another one: its certificate names no host."""
    posing = credentials_in(keys, "r1")
    rules = credentials_in(keys, ROUTER).access.read_text()
    posing.access.write_text(rules)
    async with await open_router(free_endpoint("tls"), credentials=posing) as router:
        with pytest.raises(BusError, match="No router could be reached"):
            await open_bus(router.endpoint, timeout=0.5, credentials=credentials_in(keys, "r2"))
    posing.access.unlink()


async def test_a_router_that_is_called_by_another_name_is_not_trusted(router: Router, keys: Path) -> None:
    elsewhere = router.endpoint.replace("127.0.0.1", "127.0.0.2")
    with pytest.raises(BusError, match="which must have been told the router's host name"):
        await open_bus(elsewhere, timeout=0.5, credentials=credentials_in(keys, "r1"))


async def test_who_shows_keys_does_not_talk_in_the_clear(keys: Path) -> None:
    for opening in (open_bus, open_router):
        with pytest.raises(KeysError, match="is not encrypted and asks for no keys"):
            await opening(free_endpoint(), credentials=credentials_in(keys, ROUTER))
        with pytest.raises(KeysError, match="is encrypted; expected --keys"):
            await opening(free_endpoint("tls"))


async def test_a_certificate_that_expires_ends_the_connection(tmp_path: Path, eventually) -> None:
    keys = new_keys(tmp_path / "keys", "r1", until=4.0)

    def of(name: str) -> Credentials:
        return credentials_in(keys, name)

    gone: list[tuple[str, bool]] = []
    async with (
        await open_router(free_endpoint("tls"), credentials=of(ROUTER)) as router,
        await open_bus(router.endpoint, credentials=of("r1")) as robot,
        await open_bus(router.endpoint, credentials=of(OPERATOR)) as watcher,
    ):
        await watcher.watch_presence(f"{M}alive/*", lambda *change: gone.append(change))
        await robot.announce_presence(f"{M}alive/r1")
        await eventually(lambda: gone == [(f"{M}alive/r1", True), (f"{M}alive/r1", False)])
        with pytest.raises(BusError):
            await open_bus(router.endpoint, timeout=0.5, credentials=of("r1"))
