"""The processes of `bus.py`: one that publishes, one that receives in one of several ways, and a router.

    python benchmarks/bus_ends.py route --endpoint ENDPOINT
    python benchmarks/bus_ends.py receive --endpoint ENDPOINT --way WAY [--direct]
    python benchmarks/bus_ends.py publish --endpoint ENDPOINT [--direct]

Each says `ready` in a line, and ends when its standard input does; then the receiver tells what came, as JSON. What is sent
is an activity message as robots send it. Its number and its instant are packed at their full length, so that they can be set
in the packed bytes: packing each message anew would bound what can be sent. The instant is that of the machine's monotonic
clock, which all processes share.
"""

import argparse
import asyncio
import functools
import itertools
import json
import struct
import sys
import time
from collections.abc import Callable
from typing import Any

import zenoh
from rich.console import Console

from lalliance_agents.bus.base import Sample
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.router import open_router
from lalliance_agents.bus.session import client_settings, open_session
from lalliance_agents.bus.zenoh_bus import ZenohBus
from lalliance_agents.wire.keys import Key, Keys, Kind
from lalliance_agents.wire.messages import Activity, Message, encode

KEYS = Keys("benchmark")
SENDER, TASK = "robot-17", "crate-104"
#: What is sent at a pace goes to one trial's task, what is sent as fast as can be to another, so that they are told apart.
PACED, FLOOD = f"{TASK}-paced", f"{TASK}-flood"
PACE = 1000
#: A receiver looks at the clock once in so many messages of a flood.
STRIDE = 64
#: After so many seconds nothing is left to be sent.
SETTLED = 0.25
#: A number that takes eight bytes when it is packed.
_FIRST = 2**40


class Envelope:
    """The packed activity message on one task, with number and instant to be set."""

    def __init__(self, task: str) -> None:
        made = Activity(
            sender=SENDER, incarnation=3, seq=_FIRST, at=1.5, task=task, trial=1, active_for=7.25, expected=11.5
        )
        packed = encode(made)
        at = b"\xcb" + struct.pack(">d", made.at)
        numbered = b"\xcf" + struct.pack(">Q", made.seq)
        self._head, rest = packed.split(numbered)
        self._middle, self._tail = rest.split(at)
        self._number = _FIRST
        #: Where the instant is.
        self.instant = len(packed) - len(self._tail) - 8

    def next(self) -> bytes:
        """The next message, sent now."""
        self._number += 1
        return b"".join(
            (
                self._head,
                struct.pack(">BQ", 0xCF, self._number),
                self._middle,
                struct.pack(">Bd", 0xCB, time.monotonic()),
                self._tail,
            )
        )


class Tally:
    """What came of a flood, and how fast."""

    def __init__(self) -> None:
        self.count = 0
        self._stamps: list[float] = []

    def note(self, *_: object) -> None:
        """One more has come."""
        self.count += 1
        if self.count % STRIDE == 0:
            self._stamps.append(time.monotonic())

    def rate(self) -> float:
        """Messages a second between the first and the last look at the clock."""
        if len(self._stamps) < 2:
            return 0.0
        return (len(self._stamps) - 1) * STRIDE / (self._stamps[-1] - self._stamps[0])


class Lags:
    """How old each message was when it came, in seconds."""

    def __init__(self) -> None:
        self.seconds: list[float] = []
        self._instant = Envelope(PACED).instant

    def note(self, payload: bytes) -> None:
        """One more has come."""
        now = time.monotonic()
        self.seconds.append(now - struct.unpack_from(">d", payload, self._instant)[0])


class Receiver:
    """Receives in one of several ways: each method that is named like a way declares it, for what is sent in either manner.

    Args:
        session: open.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self.session = session
        self.tally = Tally()
        self.lags = Lags()
        self._tasks: list[asyncio.Task[None]] = []
        self._notes = ((FLOOD, self.tally.note), (PACED, lambda sample: self.lags.note(sample.payload)))

    async def callback(self) -> None:
        """Zenoh's callback as it is by default, which counts; of what comes at a pace it reads the instant."""
        self.session.declare_subscriber(_activity(FLOOD), self.tally.note)
        self.session.declare_subscriber(_activity(PACED), lambda raw: self.lags.note(raw.payload.to_bytes()))

    async def reading(self) -> None:
        """The same, and it reads key and payload, which is what a bus hands on."""
        for task, note in self._notes:
            self.session.declare_subscriber(_activity(task), lambda raw, note=note: note(_read(raw)))

    async def hop(self) -> None:
        """The plainest way into asyncio: for each message a call of the loop, which puts it into a queue of a coroutine."""
        call = asyncio.get_running_loop().call_soon_threadsafe
        for task, note in self._notes:
            put = self._coroutine(note)

            def leap(raw: zenoh.Sample, put: Callable[[Sample], None] = put) -> None:
                call(put, _read(raw))

            self.session.declare_subscriber(_activity(task), leap)

    async def handler(self) -> None:
        """The bus, and a handler in the event loop, as robots and world have."""
        bus = self._bus()
        for task, note in self._notes:
            await bus.subscribe(_activity(task), note)

    async def coroutine(self) -> None:
        """The bus, and a coroutine that takes each message from a queue."""
        bus = self._bus()
        for task, note in self._notes:
            await bus.subscribe(_activity(task), self._coroutine(note))

    async def messenger(self) -> None:
        """The bus and the messenger: a receiver of checked messages that are news."""

        def note(_: Key, message: Message) -> None:
            self.lags.seconds.append(time.monotonic() - message.at)

        bus = self._bus()
        for task, receiver in ((FLOOD, self.tally.note), (PACED, note)):
            # One for each, as the numbers of both are of one stream.
            await Messenger(bus, KEYS, "robot-1", 1, time.monotonic).listen(_activity(task), receiver)

    async def close(self) -> None:
        """End all that it has started."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self.session.close()

    def _coroutine(self, note: Callable[[Sample], None]) -> Callable[[Sample], None]:
        """What puts a message into the queue of a coroutine that notes it."""
        queue: asyncio.Queue[Sample] = asyncio.Queue()

        async def take() -> None:
            while True:
                note(await queue.get())

        self._tasks.append(asyncio.create_task(take()))
        return queue.put_nowait

    def _bus(self) -> ZenohBus:
        """The bus over the session, open as long as the receiver is: one that nobody holds closes."""
        bus = ZenohBus(self.session, "")

        async def hold() -> None:
            async with bus:
                await asyncio.Event().wait()

        self._tasks.append(asyncio.create_task(hold()))
        return bus


WAYS = ("callback", "reading", "hop", "handler", "coroutine", "messenger")


def _read(raw: zenoh.Sample) -> Sample:
    return Sample(str(raw.key_expr), raw.payload.to_bytes())


def _activity(task: str) -> str:
    """Where a robot listens for whoever is on a task."""
    return KEYS.build(Kind.ACTIVITY, task=task)


def _settings(endpoint: str, *, direct: bool, listens: bool) -> dict[str, Any]:
    """A client of the router at an endpoint; or a peer that listens there, or connects to the one that does."""
    settings = client_settings(endpoint, 5.0)
    if direct:
        settings["mode"] = "peer"
        settings["listen"] = {"endpoints": [endpoint] if listens else []}
        if listens:
            settings["connect"]["endpoints"] = []
    return settings


async def receive(endpoint: str, way: str, *, direct: bool) -> None:
    """Receive until standard input ends."""
    receiver = Receiver(await open_session(_settings(endpoint, direct=direct, listens=True)))
    await getattr(receiver, way)()
    _tell("ready")
    await asyncio.to_thread(sys.stdin.read)
    found = {"count": receiver.tally.count, "rate": receiver.tally.rate(), "lags": receiver.lags.seconds}
    await receiver.close()
    _tell(json.dumps(found))


def publish(endpoint: str, *, direct: bool) -> None:
    """Do what standard input asks for, line by line, `paced`, `flood` or `numbered` and seconds; answer how many were sent."""
    config = zenoh.Config.from_json5(json.dumps(_settings(endpoint, direct=direct, listens=False)))
    with zenoh.open(config) as session:
        declare = functools.partial(
            session.declare_publisher,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            reliability=zenoh.Reliability.BEST_EFFORT,
        )
        to = {task: declare(KEYS.build(Kind.ACTIVITY, task=task, robot=SENDER)) for task in (PACED, FLOOD)}
        while not all(publisher.matching_status.matching for publisher in to.values()):
            time.sleep(0.002)
        time.sleep(0.05)  # the first message is not to overtake the last of the declarations
        _tell("ready")
        for line in sys.stdin:
            what, seconds = line.split()
            if what == "paced":
                sent = _paced(to[PACED], float(seconds))
            else:
                sent = _flood(to[FLOOD], float(seconds), numbered=what == "numbered")
            _tell(str(sent))
        # A session that closes with much to send tears one of the last messages, which then does not decode.
        time.sleep(SETTLED)


def _paced(publisher: zenoh.Publisher, seconds: float) -> int:
    """Send at a pace."""
    envelope, count = Envelope(PACED), round(PACE * seconds)
    began = time.monotonic()
    for number in range(count):
        if (early := began + number / PACE - time.monotonic()) > 0:
            time.sleep(early)
        publisher.put(envelope.next())
    return count


def _flood(publisher: zenoh.Publisher, seconds: float, *, numbered: bool) -> int:
    """Send as fast as can be; one message again and again, as to number each takes longer than to send it, or numbered ones."""
    envelope, sent = Envelope(FLOOD), 0
    same = itertools.repeat(envelope.next())
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        messages = (envelope.next() for _ in range(STRIDE)) if numbered else itertools.islice(same, STRIDE)
        for message in messages:
            publisher.put(message)
        sent += STRIDE
    return sent


async def route(endpoint: str) -> None:
    """Route until standard input ends."""
    async with await open_router(endpoint):
        _tell("ready")
        await asyncio.to_thread(sys.stdin.read)


def _tell(line: str) -> None:
    Console(soft_wrap=True, highlight=False, markup=False).print(line)
    sys.stdout.flush()


def main() -> None:
    """Run from the command line."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("role", choices=["route", "receive", "publish"])
    arguments.add_argument("--endpoint", required=True)
    arguments.add_argument("--way", choices=WAYS, default=WAYS[0])
    arguments.add_argument("--direct", action="store_true", help="without a router")
    chosen = arguments.parse_args()
    if chosen.role == "route":
        asyncio.run(route(chosen.endpoint))
    elif chosen.role == "receive":
        asyncio.run(receive(chosen.endpoint, chosen.way, direct=chosen.direct))
    else:
        publish(chosen.endpoint, direct=chosen.direct)


if __name__ == "__main__":
    main()
