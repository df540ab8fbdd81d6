"""The page as a program: the mission or the recording, the chronicle and the web server, put together."""

import asyncio
import socket
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from lalliance_agents.bus.zenoh_bus import ZenohBus, open_bus
from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.extras import extra
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.model.parameters import Erratum
from lalliance_agents.wire.keys import OPERATOR
from mission_control.dashboard.chronicle import Chronicle
from mission_control.dashboard.disturb import Absent, Disturber, Operator
from mission_control.dashboard.feed import LiveFeed, retell
from mission_control.dashboard.guard import Guard
from mission_control.dashboard.metrics import MissionMetrics
from mission_control.dashboard.serving import address_of, listen, served
from mission_control.dashboard.site import Site
from mission_control.reach import reach
from mission_control.shell import credentials_from, endpoint_of
from mission_control.watch.story import Story
from world_server.environments.box_pushing import BoxPushing

#: How long to look for a mission that does not run yet, if asked to, in seconds.
PATIENCE = 60.0
#: How long the world may take to be heard, in seconds.
FIRST_NEWS = 4.0

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Address:
    """Where the page is, and who may disturb the mission.

    Attributes:
        host: where it listens.
        port: its port; 0: a free one.
        token: what a viewer must know to disturb the mission.
        names: host names under which it may be called.
        own_token: whether the token was made for this start, so that nobody knows it yet.
    """

    host: str
    port: int
    token: str
    names: tuple[str, ...] = ()
    own_token: bool = True

    def guard(self) -> Guard:
        """Judges requests."""
        return Guard(self.token, self.names)

    def shown(self, address: str) -> str:
        """The address as people open it; the part after # is never sent anywhere."""
        return f"{address}#token={self.token}" if self.own_token else address


def hello(mission: str, plan: Mission | None, *, live: bool) -> dict[str, Any]:
    """What each viewer is told first.

    Args:
        mission: its name.
        plan: the mission file, if it is known.
        live: whether it runs.
    """
    told: dict[str, Any] = {"kind": "hello", "mission": mission, "live": live, "facts": []}
    if plan is None:
        return told | {"threshold": 1.0, "silence_timeout": None, "ends": None, "slack": 0.0}
    parameters = plan.parameters
    kind = plan.environment.kind
    slack = _slack(plan) if kind == "box_pushing" else None
    return told | {
        "facts": [
            kind.replace("_", " "),
            f"strategy {parameters.strategy.name}",
            f"τ {parameters.silence_timeout:g} s",
        ],
        "threshold": parameters.threshold,
        "silence_timeout": parameters.silence_timeout,
        "ends": None if slack is None else list(plan.tasks),
        "slack": slack or 0.0,
    }


def _slack(plan: Mission) -> float | None:
    """How far an end of the box may be ahead of the other; None if the file does not say it in a way that can be used."""
    try:
        return BoxPushing.Options.model_validate(plan.environment.options).slack
    except ValidationError:
        return None


def chronicle_of(mission: str, plan: Mission | None) -> Chronicle:
    """An empty chronicle, with the robots and tasks of the mission file if it is known."""
    if plan is None:
        return Chronicle(Story(mission))
    able = {name: tuple(spec.tasks) for name, spec in plan.robots.items()}
    literal = {name for name in able if plan.parameters_of(name).is_literal(Erratum.HEARD_ELSEWHERE)}
    return Chronicle(Story(mission), able, list(plan.tasks), literal)


async def show_mission(
    mission: Mission,
    connect: str | None,
    keys: Path | None,
    address: Address,
    say: Say,
    *,
    speed: float,
    wait: bool,
) -> None:
    """Show a running mission until cancelled.

    Args:
        mission: which.
        connect: the router of its bus; None: where it runs on this machine.
        keys: the folder of keys, if its bus asks for them.
        address: where to show it.
        say: called with the page's address.
        speed: mission seconds per real second.
        wait: whether to wait for a mission that does not run yet.

    Raises:
        UserError: it does not run, or the page cannot be shown there.
    """
    chronicle = chronicle_of(mission.name, mission)
    with listen(address.host, address.port) as listening:
        async with await _bus(mission.name, connect, keys, wait=wait) as bus:
            feed = LiveFeed(bus, mission.name, chronicle, speed=speed)
            async with feed.followed():
                if not wait:
                    await _first_news(chronicle, mission.name, bus.endpoint)
                told = hello(mission.name, mission, live=True)
                site = _site(chronicle, address, told, Operator(mission, bus), feed)
                async with served(site.app(), listening):
                    _locate(say, mission.name, address, listening)
                    await asyncio.Event().wait()


async def _bus(mission: str, connect: str | None, keys: Path | None, *, wait: bool) -> ZenohBus:
    if not wait:
        return await reach(mission, connect, keys)
    return await open_bus(endpoint_of(connect, keys), timeout=PATIENCE, credentials=credentials_from(keys, OPERATOR))


def _locate(say: Say, mission: str, address: Address, listening: socket.socket) -> None:
    say(f"the page of mission {mission}: {address.shown(address_of(listening))}")
    sys.stdout.flush()


async def _first_news(chronicle: Chronicle, mission: str, endpoint: str) -> None:
    """Wait until the world is heard.

    Raises:
        UserError: it is not.
    """
    try:
        async with asyncio.timeout(FIRST_NEWS):
            while chronicle.story.status is None:  # noqa: ASYNC110 - the chronicle is pure and tells nobody
                await asyncio.sleep(0.05)
    except TimeoutError:
        raise UserError(
            f"no world server of mission {mission} is heard at {endpoint}; expected the mission to run there just now, "
            "or --wait"
        ) from None


def _site(
    chronicle: Chronicle, address: Address, told: dict[str, Any], disturber: Disturber, feed: LiveFeed | None
) -> Site:
    def clock() -> float:
        return (chronicle.heard_at or 0.0) if feed is None else feed.now

    def missed() -> int:
        return 0 if feed is None else feed.missed

    def trouble() -> str:
        return "" if feed is None else feed.trouble()

    def viewers() -> int:
        return site.viewers

    metrics = MissionMetrics(chronicle, clock, viewers, missed)
    site = Site(chronicle, address.guard(), told, disturber, metrics.page, trouble)
    return site


async def show_recording(path: Path, mission: Mission | None, address: Address, say: Say) -> None:
    """Show a recording until cancelled.

    Args:
        path: the file.
        mission: the mission file; None: the one that the recording holds.
        address: where to show it.
        say: called with the page's address, and with what is missing in the file, if anything is.

    Raises:
        UserError: it is no recording, or the page cannot be shown there.
    """
    with extra("record"):
        from mission_control.recording.reader import Recording  # noqa: PLC0415 - needs an extra
    recording = Recording(path)
    plan = _recorded_plan(recording.about.text) if mission is None else mission
    name = recording.about.mission
    if plan is not None and plan.name != name:
        raise UserError(f"{path}: this is a recording of mission {name}; expected one of {plan.name}")
    chronicle = chronicle_of(name, plan)
    absent = Absent("this is a recording; expected a running mission to disturb")
    site = _site(chronicle, address, hello(name, plan, live=False), absent, None)
    with listen(address.host, address.port) as listening:
        async with served(site.app(), listening):
            _locate(say, name, replace(address, own_token=False), listening)
            await retell(recording, chronicle, recording.gaps)
            if recording.broken:
                say(recording.broken)
            await asyncio.Event().wait()


def _recorded_plan(text: str) -> Mission | None:
    """The mission file in a recording; None if this version cannot read it."""
    try:
        return parse_mission(text, "the recorded mission")
    except UserError:
        return None
