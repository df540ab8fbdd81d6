"""The parts of a mission as services of docker compose.

What outlives a container is on two named volumes. Where files of the host belong is written relative to the folder of the
compose file.
"""

import os.path
from pathlib import Path
from typing import Any, NamedTuple

from lalliance_agents.bus.credentials import credentials_in
from lalliance_agents.config import Mission
from mission_control.deploy.documents import Document
from mission_control.deploy.parts import (
    HEALTH,
    IMAGE,
    KEYS,
    LEARNED,
    MISSION,
    RESTARTS,
    USER,
    WORLD_STATE,
    Part,
    parts_of,
    place,
)

Service = dict[str, Any]


def compose(mission: Mission, path: Path, folder: Path, *, keys: Path, speed: float = 1.0) -> Document:
    """The compose file of a mission.

    Args:
        mission: what its file says.
        path: the mission file.
        folder: where the compose file is to be.
        keys: the folder of keys, wherever the environment does not name another one.
        speed: mission seconds per real second.
    """
    host = _Host(_relative(path, folder), f"${{LALLIANCE_KEYS:-{_relative(keys, folder)}}}")
    parts = parts_of(mission, speed)
    services = {"router": _router(parts.router, host), "world": _member(parts.world, host)}
    for part in parts.robots.values():
        services[part.name] = {**_member(part, host), **({"profiles": ["later"]} if part.later else {})}
    services |= {tool.name: _tool(tool, host) for tool in (parts.summary, parts.operator)}
    services[parts.dashboard.name] = _page(parts.dashboard, host)
    return {
        "name": f"lalliance-{mission.name.lower()}",
        "services": services,
        "networks": {"bus": {"internal": True}, "page": {}},
        "volumes": {LEARNED: {}, WORLD_STATE: {}},
    }


def _relative(path: Path, folder: Path) -> str:
    """As compose takes it for a path: one that begins with a dot."""
    found = Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    return found if found.startswith("..") else f"./{found}"


def _bind(source: str, target: str) -> dict[str, Any]:
    """Something of the host's, which must be there already."""
    bind = {"create_host_path": False}
    return {"type": "bind", "source": source, "target": target, "read_only": True, "bind": bind}


class _Host(NamedTuple):
    """Where the mission file and the folder of keys are on the host."""

    mission: str
    keys: str

    def shown_to(self, part: Part) -> list[dict[str, Any]]:
        """What a part sees of the host, its own keys at their own place in a folder of keys, and its volume."""
        shown = [_bind(self.mission, MISSION)] if part.mission else []
        if part.keys is not None:
            own = credentials_in(Path(), part.keys).folder.as_posix()
            shown.append(_bind(f"{self.keys}/{own}", f"{KEYS}/{own}"))
        if part.volume is not None:
            volume = {"type": "volume", "source": part.volume, "target": place(part.volume)}
            shown.append(volume | ({"read_only": True} if part.only_reads else {}))
        return shown


def _service(part: Part, host: _Host) -> Service:
    return {
        "image": f"${{LALLIANCE_IMAGE:-{IMAGE}}}",
        # Private keys are readable by their owner only: say who that is.
        "user": f"${{LALLIANCE_USER:-{USER}:{USER}}}",
        "command": list(part.command),
        "environment": dict(part.environment),
        "init": True,
        "read_only": True,
        "tmpfs": ["/tmp"],  # noqa: S108 - inside a container of its own
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges:true"],
        "networks": ["bus"],
        "volumes": host.shown_to(part),
    }


def _router(part: Part, host: _Host) -> Service:
    check = {"interval": "3s", "timeout": "5s", "retries": 5, "test": ["CMD", *HEALTH]}
    return {**_service(part, host), "restart": "unless-stopped", "healthcheck": check}


def _member(part: Part, host: _Host) -> Service:
    """A service that takes part in the mission."""
    return {
        **_service(part, host),
        "restart": f"on-failure:{RESTARTS}",
        "depends_on": {"router": {"condition": "service_healthy"}},
    }


def _tool(part: Part, host: _Host) -> Service:
    return {**_service(part, host), "profiles": ["tools"], "healthcheck": {"disable": True}}


def _page(part: Part, host: _Host) -> Service:
    """A page for browsers of the host alone, which cannot be reached on a network without a way out."""
    shown = {"networks": ["bus", "page"], "ports": [f"127.0.0.1:${{LALLIANCE_PAGE:-{part.page}}}:{part.page}"]}
    return {**_service(part, host), **shown, "profiles": ["dashboard"]}
