"""Who runs what in the deployment of a mission, whatever runs the containers: router, world server, robots, and three tools.

Every part runs the same image without root, on a file system that it cannot write to, and sees only its own keys. All are on
one network without a way out; the page alone is shown on another one. What outlives a container is on volumes: what robots
learned, and the world's journal.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from lalliance_agents.bus.credentials import ROUTER
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import OPERATOR, WORLD

PORT, PAGE = 7447, 8080
ENDPOINT = f"tls/router:{PORT}"
#: What the image is called unless somebody says otherwise, and the user and group as whom it runs.
IMAGE, USER = "lalliance", 10001
#: Where things are inside a container.
MISSION, KEYS = "/mission.yaml", "/keys"
#: Names of volumes: what robots learned, and what the world keeps.
LEARNED, WORLD_STATE = "learned", "world"
SUMMARY = f"/var/lib/lalliance/{WORLD_STATE}/summary.json"
#: How often a process that fails is started again: one that ends with a mission's failure comes back no more often either.
RESTARTS = 5
#: Tells whether the part that runs in a container is well.
HEALTH = ("lalliance", "health")


@dataclass(frozen=True, slots=True)
class Part:
    """What one container runs, and what it sees.

    Attributes:
        name: of the part.
        command: what to run, after `lalliance`.
        environment: variables that it is given.
        keys: whose keys it sees; None: no keys at all.
        mission: whether it sees the mission file.
        volume: which volume it sees; None: none.
        only_reads: whether it may not write to that volume.
        later: whether it joins a mission that is under way, and is to be started then.
        page: the port on which it shows a page; None: it shows none.
    """

    name: str
    command: tuple[str, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    keys: str | None = None
    mission: bool = True
    volume: str | None = None
    only_reads: bool = False
    later: bool = False
    page: int | None = None


@dataclass(frozen=True, slots=True)
class Parts:
    """All parts of a mission's deployment.

    Attributes:
        robots: by the robots' names.
        summary: waits for the end of the mission, prints its summary and exits with its status.
        operator: runs commands of an operator's in the mission.
        dashboard: shows the mission as a web page.
    """

    router: Part
    world: Part
    robots: Mapping[str, Part]
    summary: Part
    operator: Part
    dashboard: Part


def parts_of(mission: Mission, speed: float) -> Parts:
    """Who runs what.

    Args:
        mission: what its file says.
        speed: mission seconds per real second.
    """
    pace = ("--speed", f"{speed:g}")
    return Parts(
        router=_router(),
        world=_world(pace),
        robots={name: _robot(name, pace, later=robot.joins > 0) for name, robot in mission.robots.items()},
        summary=Part("summary", ("summary", SUMMARY, "--wait"), mission=False, volume=WORLD_STATE, only_reads=True),
        operator=Part("operator", ("chaos", MISSION, "status"), _on_the_bus(), keys=OPERATOR),
        dashboard=_dashboard(pace),
    )


def place(volume: str) -> str:
    """Where a volume is inside a container."""
    return f"/var/lib/lalliance/{volume}"


def _on_the_bus(**more: str) -> dict[str, str]:
    return {"LALLIANCE_KEYS": KEYS, "LALLIANCE_CONNECT": ENDPOINT, **more}


def _router() -> Part:
    # It is asked under the name that its certificate holds, by itself.
    environment = {"LALLIANCE_KEYS": KEYS, "LALLIANCE_CONNECT": f"tls/localhost:{PORT}"}
    return Part("router", ("router", "--listen", f"tls/0.0.0.0:{PORT}"), environment, keys=ROUTER, mission=False)


def _world(pace: tuple[str, ...]) -> Part:
    command = ("world", MISSION, *pace, "--journal", f"{place(WORLD_STATE)}/journal", "--summary", SUMMARY)
    return Part("world", command, _on_the_bus(LALLIANCE_MISSION=MISSION), keys=WORLD, volume=WORLD_STATE)


def _robot(name: str, pace: tuple[str, ...], *, later: bool) -> Part:
    command = ("robot", MISSION, "--name", name, *pace, "--learned", place(LEARNED))
    environment = _on_the_bus(LALLIANCE_MISSION=MISSION, LALLIANCE_NAME=name)
    return Part(f"robot-{name}", command, environment, keys=name, volume=LEARNED, later=later)


def _dashboard(pace: tuple[str, ...]) -> Part:
    everywhere = "0.0.0.0"  # noqa: S104 - inside a container of its own
    command = ("dashboard", MISSION, *pace, "--host", everywhere, "--port", f"{PAGE}", "--wait")
    return Part("dashboard", command, _on_the_bus(), keys=OPERATOR, page=PAGE)
