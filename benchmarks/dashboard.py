"""How much the web page costs: a team of 100 robots with 200 tasks, each robot heard 5 times a second, and several viewers.

    python benchmarks/dashboard.py [--quick] [--json FILE]     the server and viewers without a browser
    python benchmarks/dashboard.py --browser                   also a page in Chromium, and how long its frames take
    python benchmarks/dashboard.py --serve                     the page alone, to be looked at, until Ctrl-C

The mission is made up: robots take tasks one after the other, hold them for a while, fail, are taken over. What they say is
encoded as on a bus and handed to the chronicle as it would come from there, in real time.
"""

import argparse
import asyncio
import itertools
import json
import random
import sys
import time
from collections.abc import Iterator
from statistics import mean, quantiles
from typing import Any

import websockets
from form import Columns, options, publish
from playwright.sync_api import sync_playwright
from rich.console import Console
from suite import CHROMIUM

from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, Message, encode
from mission_control.dashboard.chronicle import Chronicle
from mission_control.dashboard.disturb import Absent
from mission_control.dashboard.guard import Guard
from mission_control.dashboard.metrics import MissionMetrics
from mission_control.dashboard.serving import address_of, listen, served
from mission_control.dashboard.site import Site
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story

MISSION = "synthetic"
PERIOD = 0.2
TASKS_OF_ONE = 12
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
]  # fmt: skip


class Team:
    """A made-up mission.

    Args:
        robots: how many.
        tasks: how many.
    """

    def __init__(self, robots: int, tasks: int) -> None:
        self._random = random.Random(1)
        self.tasks = [f"task-{number:03}" for number in range(1, tasks + 1)]
        self.robots = {
            f"robot-{number:03}": tuple(self._random.sample(self.tasks, TASKS_OF_ONE))
            for number in range(1, robots + 1)
        }
        self._keys = Keys(MISSION)
        self._numbers = itertools.count(1)
        self._on: dict[str, tuple[str, float, float]] = {}
        self._progress = dict.fromkeys(self.tasks, 0.0)
        self._said: dict[str, int] = dict.fromkeys(self.robots, 0)

    def step(self, now: float) -> Iterator[Sighting]:
        """All that is heard in one period that ends at `now`, in seconds."""
        for number, (robot, able) in enumerate(self.robots.items()):
            yield from self._act(robot, able, now)
            yield from self._speak(robot, able, now, reports=number % 5 == round(now / PERIOD) % 5)
        yield self._status(now)

    def _act(self, robot: str, able: tuple[str, ...], now: float) -> Iterator[Sighting]:
        task, since, until = self._on.get(robot, ("", 0.0, 0.0))
        if task and now < until:
            self._progress[task] = min((now - since) / (until - since), 0.99)
            return
        if task:
            self._progress[task] = 1.0
            yield self._decision(robot, task, "complete", "sensed", now)
            done = {"kind": "complete", "robot": robot, "task": task, "text": f"{task} completed by {robot}"}
            yield self._event(now, **done)
            del self._on[robot]
        left = [one for one in able if self._progress[one] == 0.0]
        if not left and self._random.random() < 0.02:
            left = [self._random.choice(able)]  # so that it goes on for ever
        if left:
            taken = self._random.choice(left)
            self._progress[taken] = 0.01
            self._on[robot] = (taken, now, now + self._random.uniform(5, 25))
            yield self._decision(robot, taken, "activate", "free", now)

    def _speak(self, robot: str, able: tuple[str, ...], now: float, *, reports: bool) -> Iterator[Sighting]:
        task, since, _ = self._on.get(robot, ("", 0.0, 0.0))
        self._said[robot] += 1
        if task:
            on = {"task": task, "trial": 1, "active_for": now - since, "expected": 20.0}
            yield self._message(Kind.ACTIVITY, now, robot, key_task=task, **on)
        else:
            yield self._message(Kind.HEARTBEAT, now, robot, trial=1)
        sets = {one: self._factors(one == task) for one in able}
        yield self._message(Kind.MOTIVATION, now, robot, active=[task] if task else [], sets=sets)
        if reports:
            mates = {
                mate: {"received": round(0.9 * said), "silence": self._random.uniform(0, 0.6), "lost_for": None}
                for mate, said in self._said.items()
                if mate != robot
            }
            counts = {"sent": self._said[robot], "received": 9 * self._said[robot], "dropped": {"loss": 3}}
            yield self._message(Kind.LINK, now, robot, **counts, teammates=mates, ticks=round(now * 10), missed=0)

    def _factors(self, active: bool) -> dict[str, Any]:
        ones = (
            "sensory_feedback",
            "activity_suppression",
            "impatience_reset",
            "acquiescence",
            "learned_robot_influence",
        )
        times = {
            "rate": 0.4,
            "delay": 2.5,
            "own_time": 12.0,
            "best_time": 9.0,
            "boredom": 0.2,
            "psi": 20.0,
            "lambda": 30.0,
        }
        motivation = 1.0 if active else self._random.random()
        return {"motivation": motivation, "pace": "fast", "category": 1, **times, **dict.fromkeys(ones, 1)}

    def _status(self, now: float) -> Sighting:
        tasks = {
            task: {"complete": share == 1.0, "applicable": share < 1.0, "progress": share}
            for task, share in self._progress.items()
        }
        robots = {robot: {"present": True, "task": self._on.get(robot, (None,))[0]} for robot in self.robots}
        stage = {"mission": "running", "trial": 1, "trials": 1, "learning": "adaptive", "elapsed": now}
        return self._message(Kind.STATUS, now, WORLD, **stage, tasks=tasks, robots=robots)

    def _decision(self, robot: str, task: str, verb: str, cause: str, now: float) -> Sighting:
        made = {"verb": verb, "task": task, "cause": cause, "other": None, "active_for": 0.0, "trial": 1}
        return self._message(Kind.DECISION, now, robot, **made, factors=self._factors(True), teammates=[])

    def _event(self, now: float, **fields: Any) -> Sighting:
        return self._message(Kind.EVENT, now, WORLD, elapsed=now, trial=1, **fields)

    def _message(self, form: Kind, now: float, sender: str, key_task: str = "", **fields: Any) -> Sighting:
        header = {"sender": sender, "incarnation": 1, "seq": next(self._numbers), "at": now}
        message: Message = BODY_OF[form].model_validate({**header, **fields})
        return Sighting(time.time_ns(), now, self._keys.build(form, robot=sender, task=key_task), encode(message))


class Server:
    """The page of a made-up mission, in this process."""

    def __init__(self, robots: int, tasks: int) -> None:
        self.team = Team(robots, tasks)
        self.chronicle = Chronicle(Story(MISSION), self.team.robots, self.team.tasks)
        metrics = MissionMetrics(self.chronicle, lambda: self.chronicle.now, lambda: self.site.viewers, lambda: 0)
        told = {"kind": "hello", "mission": MISSION, "live": True, "facts": [f"{robots} robots", f"{tasks} tasks"]}
        told |= {"threshold": 1.0, "silence_timeout": 1.0, "ends": None, "slack": 0.0}
        self.site = Site(self.chronicle, Guard("no-token-for-this"), told, Absent("made up"), metrics.page, lambda: "")
        self.taking: list[float] = []
        self.settling: list[float] = []
        self.late: list[float] = []
        self.messages = 0

    async def live(self) -> None:
        """Let the mission happen, in real time."""
        due, now = time.monotonic(), 0.0
        while True:
            due, now = due + PERIOD, now + PERIOD
            await asyncio.sleep(max(due - time.monotonic(), PERIOD / 4))
            self.late.append(time.monotonic() - due)
            if self.late[-1] > PERIOD:  # this machine is too slow for all of it: let time pass without
                due = time.monotonic()
            sightings = list(self.team.step(now))
            self.messages += len(sightings)
            start = time.process_time()
            for sighting in sightings:
                self.chronicle.take(sighting)
            taken = time.process_time()
            self.taking.append(taken - start)
            await asyncio.sleep(0)
            start = time.process_time()
            self.chronicle.settle()
            self.settling.append(time.process_time() - start)


class Watcher:
    """A viewer without a browser; a slow one needs `slowness` seconds to draw an update."""

    def __init__(self, slowness: float = 0.0) -> None:
        self._slowness = slowness
        self.sizes: list[int] = []
        self.lags: list[float] = []

    async def watch(self, server: Server, address: str) -> None:
        """Watch until cancelled."""
        async with websockets.connect(f"{address.replace('http', 'ws')}watch", max_size=None) as socket:
            await socket.send(json.dumps({"robot": "robot-001"}))
            async for text in socket:
                message = json.loads(text)
                if message["kind"] != "update":
                    continue
                self.sizes.append(len(text))
                self.lags.append(server.chronicle.now - message["now"])
                await asyncio.sleep(self._slowness)
                await socket.send(json.dumps({"drawn": message["number"]}))


def look(address: str, seconds: float) -> list[float]:
    """Have the page open in Chromium for a while; how long each frame took that it drew, in milliseconds."""
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        page = browser.new_page(viewport={"width": 1440, "height": 1000})
        page.goto(address)
        page.wait_for_timeout(seconds * 1000)
        frames = page.evaluate("performance.getEntriesByName('frame').map((one) => one.duration)")
        browser.close()
    return [float(one) for one in frames]


async def looking(address: str, seconds: float) -> Any:
    """The same in a process of its own."""
    command = (sys.executable, __file__, "--look", address, "--seconds", str(seconds))
    process = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
    out, _ = await process.communicate()
    return json.loads(out)


def spread(what: str, unit: str, values: list[float]) -> dict[str, Any]:
    """A row: mean, 95th percentile and largest."""
    if len(values) < 2:
        values = [*values, *values] or [0.0, 0.0]
    most = max(values)
    return {
        "what": what,
        "unit": unit,
        "mean": mean(values),
        "p95": min(quantiles(values, n=20)[-1], most),
        "most": most,
    }


def single(what: str, unit: str, value: float) -> dict[str, Any]:
    """A row of one figure."""
    return {"what": what, "unit": unit, "mean": value, "p95": None, "most": None}


def milliseconds(what: str, seconds: list[float]) -> dict[str, Any]:
    """A row of times."""
    return spread(what, "ms", [1000 * value for value in seconds])


async def measure(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Run everything for a while; a row for each thing that it cost."""
    server = Server(arguments.robots, arguments.tasks)
    listening = listen("127.0.0.1", arguments.port)
    quick, slow = [Watcher() for _ in range(arguments.viewers)], Watcher(slowness=2.0)
    address = address_of(listening)
    async with served(server.site.app(), listening):
        Console(stderr=True).print(address)
        work = [asyncio.create_task(server.live())]
        if arguments.serve:
            await work[0]
        work += [asyncio.create_task(one.watch(server, address)) for one in (*quick, slow)]
        used, began = time.process_time(), time.monotonic()
        shown = await looking(address, arguments.seconds) if arguments.browser else None
        if shown is None:
            await asyncio.sleep(arguments.seconds)
        used, lasted = time.process_time() - used, time.monotonic() - began
        for part in work:
            if part.done():
                part.result()
            part.cancel()
        await asyncio.gather(*work, return_exceptions=True)
    lags = [lag for one in quick for lag in one.lags]
    rows = [
        single("messages that come", "a second", server.messages / (len(server.taking) * PERIOD)),
        milliseconds("CPU time for a period's messages", server.taking),
        milliseconds("CPU time to settle a period", server.settling),
        milliseconds("how late a period begins", server.late),
        single("updates that a quick viewer gets", "a second", mean(len(one.sizes) for one in quick) / lasted),
        spread("an update", "kB", [size / 1000 for one in quick for size in one.sizes[1:]]),
        milliseconds("how far a quick viewer is behind", lags),
        single("updates that the slow viewer gets", "a second", len(slow.sizes) / lasted),
        milliseconds("how far the slow viewer is behind", slow.lags),
        single("processor time of the server and these viewers", "cores", used / lasted),
    ]
    if shown is not None:
        frames = [float(one) for one in shown]
        rows.append(single("frames that a page in Chromium draws", "a second", len(frames) / arguments.seconds))
        rows.append(spread("a frame", "ms", frames))
    return rows


COLUMNS: Columns = {
    "what": lambda one: one["what"],
    "mean": lambda one: f"{one['mean']:,.2f}",
    "95th percentile": lambda one: "" if one["p95"] is None else f"{one['p95']:,.2f}",
    "most": lambda one: "" if one["most"] is None else f"{one['most']:,.2f}",
    "unit": lambda one: one["unit"],
}


def main() -> None:
    """Run from the command line."""
    parser = options(__doc__)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--tasks", type=int, default=200)
    parser.add_argument("--viewers", type=int, default=4, help="quick ones; there is a slow one besides")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--browser", action="store_true")
    parser.add_argument("--serve", action="store_true")
    parser.add_argument("--look", metavar="ADDRESS", help="only have the page there open in Chromium")
    chosen = parser.parse_args()
    if chosen.quick:
        chosen.seconds = 2.0
    if chosen.look is not None:
        Console(soft_wrap=True, highlight=False).print_json(json.dumps(look(chosen.look, chosen.seconds)))
        return
    if chosen.browser and not CHROMIUM.exists():
        raise SystemExit(f"{CHROMIUM}: no such file; expected Chromium there, or no --browser")
    rows = asyncio.run(measure(chosen))
    seen = "and a page in Chromium" if chosen.browser else "without a browser"
    crowd = f"{chosen.robots} robots, {chosen.tasks} tasks, {chosen.viewers} quick viewers and a slow one, {seen}"
    publish(f"The web page: {crowd}", COLUMNS, rows, path=chosen.json, packages=["starlette", "websockets"])


if __name__ == "__main__":
    main()
