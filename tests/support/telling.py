"""A made-up mission that is told to a chronicle, message by message, and its page served in a thread."""

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from typing import Any

from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, encode
from mission_control.dashboard.chronicle import Chronicle
from mission_control.dashboard.disturb import Disturber, Outcome
from mission_control.dashboard.guard import Guard
from mission_control.dashboard.metrics import MissionMetrics
from mission_control.dashboard.serving import address_of, listen, served
from mission_control.dashboard.site import Site
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story

TOKEN = "the-token-of-these-tests"
ABLE = {"left": ("a", "b"), "right": ("a", "b")}


class Telling:
    """Tells a chronicle what happens in mission `m`: robots `left` and `right`, tasks `a` and `b`."""

    def __init__(self) -> None:
        self.chronicle = Chronicle(Story("m"), ABLE, ["a", "b"])
        self._keys = Keys("m")
        self._seq = 0

    def say(self, form: Kind, now: float, /, *, by: str = WORLD, **fields: Any) -> None:
        """A message comes."""
        self._seq += 1
        message = BODY_OF[form](sender=by, incarnation=1, seq=self._seq, at=now, **fields)
        key = self._keys.build(form, robot=by, task=str(fields.get("task")))
        self.chronicle.take(Sighting(0, now, key, encode(message)))

    def status(self, now: float, *, trial: int = 1, elapsed: float | None = None, **progress: float) -> None:
        """The world says how the mission stands, and the chronicle is brought up to date."""
        tasks = {
            task: {"complete": progress.get(task, 0.0) == 1.0, "applicable": True, "progress": progress.get(task, 0.0)}
            for task in ("a", "b")
        }
        stage = {"mission": "running", "trial": trial, "trials": 2, "learning": "adaptive"}
        at = now if elapsed is None else elapsed
        self.say(Kind.STATUS, now, **stage, elapsed=at, tasks=tasks, robots={})
        self.chronicle.settle()

    def event(self, form: str, text: str, now: float, **fields: Any) -> None:
        """The world tells something."""
        self.say(Kind.EVENT, now, **({"trial": 1, "elapsed": now} | fields), kind=form, text=text)

    def decide(self, verb: str, cause: str, now: float, *, by: str, task: str, other: str | None = None) -> None:
        """A robot decides something."""
        fixed = {"active_for": 0.0, "trial": 1, "factors": {}, "teammates": []}
        self.say(Kind.DECISION, now, by=by, **fixed, verb=verb, task=task, cause=cause, other=other)

    def link(self, now: float, *, by: str, **teammates: dict[str, Any]) -> None:
        """A robot reports what it heard."""
        counts = {"sent": 1, "received": 1, "dropped": {}, "ticks": 30, "missed": 2}
        self.say(Kind.LINK, now, by=by, **counts, teammates=teammates)

    def motivations(self, now: float, *, by: str, **sets: float) -> None:
        """A robot tells its motivations."""
        told = {task: {"motivation": value, "pace": "fast"} for task, value in sets.items()}
        self.say(Kind.MOTIVATION, now, by=by, active=[], sets=told)

    def takeover(self) -> None:
        """`left` starts `a`, is killed at 4 s, and `right` takes `a` over at 5.2 s."""
        for robot in ABLE:
            self.say(Kind.HELLO, 0.0, by=robot, tasks=["a", "b"])
        self.event("trial", "trial 1 begins (adaptive learning)", 0.0, details={"begins": True})
        self.status(0.1)
        self.decide("activate", "free", 1.0, by="left", task="a")
        self.status(2.0, a=0.25)
        fault = {"robot": "left", "details": {"name": "1-crash", "begins": True}}
        self.event("fault", "fault: crash of left", 4.0, **fault)
        self.event("gone", "left is gone", 4.1, robot="left")
        self.status(4.5, a=0.5)
        self.decide("activate", "silence", 5.2, by="right", task="a", other="left")
        taken = {"from": "left", "cause": "silence"}
        self.event("takeover", "right takes a from left (silence)", 5.2, robot="right", task="a", details=taken)
        self.status(6.0, a=0.75)


class Noting:
    """Takes every request to disturb the mission for done, and notes it."""

    def __init__(self) -> None:
        self.requests: list[tuple[str, Any]] = []

    async def inject(self, request: Any) -> Outcome:
        self.requests.append(("inject", request))
        return Outcome(True, "done")

    async def heal(self, request: Any) -> Outcome:
        self.requests.append(("heal", request))
        return Outcome(True, "done")


@contextlib.contextmanager
def page_of(chronicle: Chronicle, disturber: Disturber) -> Iterator[tuple[str, Site]]:
    """The address of a page that shows `chronicle`, and its site, served by a thread of its own."""
    metrics = MissionMetrics(chronicle, lambda: chronicle.now, lambda: site.viewers, lambda: 0)
    told = {"kind": "hello", "mission": "m", "live": True, "facts": [], "threshold": 1.0}
    told |= {"silence_timeout": 1.0, "ends": None, "slack": 0.0}
    site = Site(chronicle, Guard(TOKEN), told, disturber, metrics.page, lambda: "")
    listening = listen("127.0.0.1", 0)
    address = address_of(listening)
    loop = asyncio.new_event_loop()
    over, ready = asyncio.Event(), threading.Event()

    async def serve() -> None:
        async with served(site.app(), listening):
            ready.set()
            await over.wait()

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()))
    thread.start()
    try:
        assert ready.wait(10)
        yield address, site
    finally:
        loop.call_soon_threadsafe(over.set)
        thread.join(10)
        loop.close()
