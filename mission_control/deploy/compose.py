"""A mission as a deployment for docker compose: a router, the world server, one service for each robot, and two tools.

Every service runs the same image without root, on a file system that it cannot write to, and sees only its own keys. All are on
one network without a way out. What outlives a container is on two named volumes: what robots learned, and the world's journal.
Where files of the host belong is written relative to the folder of the compose file.
"""

import os.path
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from lalliance_agents.bus.credentials import ROUTER, credentials_in
from lalliance_agents.config import Mission
from lalliance_agents.wire.keys import OPERATOR, WORLD

PORT = 7447
ENDPOINT = f"tls/router:{PORT}"
#: Where things are inside a container.
MISSION, KEYS, LEARNED, WORLD_STATE = "/mission.yaml", "/keys", "/var/lib/lalliance/learned", "/var/lib/lalliance/world"
SUMMARY = f"{WORLD_STATE}/summary.json"
#: How often a process that fails is started again: one that ends with a mission's failure comes back no more often either.
RESTARTS = "on-failure:5"

Service = dict[str, Any]


def compose(mission: Mission, path: Path, folder: Path, *, keys: Path, speed: float = 1.0) -> dict[str, Any]:
    """The compose file of a mission.

    Args:
        mission: what its file says.
        path: the mission file.
        folder: where the compose file is to be.
        keys: the folder of keys, wherever the environment does not name another one.
        speed: mission seconds per real second.
    """
    file = _bind(_relative(path, folder), MISSION)
    keys_of = _Keys(f"${{LALLIANCE_KEYS:-{_relative(keys, folder)}}}")
    pace = ["--speed", f"{speed:g}"]
    services = {"router": _router(keys_of.of(ROUTER)), "world": _world(file, keys_of.of(WORLD), pace)}
    for name, robot in mission.robots.items():
        later = {"profiles": ["later"]} if robot.joins > 0 else {}
        services[f"robot-{name}"] = {**_robot(name, file, keys_of.of(name), pace), **later}
    services |= {"summary": _summary(), "operator": _operator(file, keys_of.of(OPERATOR))}
    return {
        "name": f"lalliance-{mission.name.lower()}",
        "services": services,
        "networks": {"bus": {"internal": True}},
        "volumes": {"learned": {}, "world": {}},
    }


def as_text(document: dict[str, Any], words: Sequence[str]) -> str:
    """A compose file as text, with the command that made it."""
    return f"# Made by: {shlex.join(words)}\n{yaml.dump(document, Dumper=_Dumper, sort_keys=False, width=120)}"


class _Dumper(yaml.SafeDumper):
    """Writes what occurs twice twice: a person is to read it."""

    def ignore_aliases(self, data: Any) -> bool:
        """Make no anchors."""
        del data
        return True


def _relative(path: Path, folder: Path) -> str:
    """As compose takes it for a path: one that begins with a dot."""
    found = Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    return found if found.startswith("..") else f"./{found}"


def _bind(source: str, target: str) -> dict[str, Any]:
    """Something of the host's, which must be there already."""
    bind = {"create_host_path": False}
    return {"type": "bind", "source": source, "target": target, "read_only": True, "bind": bind}


def _volume(name: str, target: str, *, read_only: bool = False) -> dict[str, Any]:
    return {"type": "volume", "source": name, "target": target} | ({"read_only": True} if read_only else {})


class _Keys(NamedTuple):
    """Where the folder of keys is on the host."""

    folder: str

    def of(self, name: str) -> dict[str, Any]:
        """The keys of `name`, at their own place in a folder of keys."""
        place = credentials_in(Path(), name).folder.as_posix()
        return _bind(f"{self.folder}/{place}", f"{KEYS}/{place}")


def _service(command: list[str], volumes: list[dict[str, Any]], environment: dict[str, str]) -> Service:
    return {
        "image": "${LALLIANCE_IMAGE:-lalliance}",
        # Private keys are readable by their owner only: say who that is.
        "user": "${LALLIANCE_USER:-10001:10001}",
        "command": command,
        "environment": environment,
        "init": True,
        "read_only": True,
        "tmpfs": ["/tmp"],  # noqa: S108 - inside a container of its own
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges:true"],
        "networks": ["bus"],
        "volumes": volumes,
    }


def _member(command: list[str], volumes: list[dict[str, Any]], environment: dict[str, str]) -> Service:
    """A service that takes part in the mission."""
    return {
        **_service(command, volumes, {"LALLIANCE_KEYS": KEYS, "LALLIANCE_CONNECT": ENDPOINT, **environment}),
        "restart": RESTARTS,
        "depends_on": {"router": {"condition": "service_healthy"}},
    }


def _router(keys: dict[str, Any]) -> Service:
    command = ["router", "--listen", f"tls/0.0.0.0:{PORT}"]
    # It is asked under the name that its certificate holds, by itself.
    environment = {"LALLIANCE_KEYS": KEYS, "LALLIANCE_CONNECT": f"tls/localhost:{PORT}"}
    check = {"interval": "3s", "timeout": "5s", "retries": 5, "test": ["CMD", "lalliance", "health"]}
    return {
        **_service(command, [keys], environment),
        "restart": "unless-stopped",
        "healthcheck": check,
    }


def _world(file: dict[str, Any], keys: dict[str, Any], pace: list[str]) -> Service:
    command = ["world", MISSION, *pace, "--journal", f"{WORLD_STATE}/journal", "--summary", SUMMARY]
    return _member(command, [file, keys, _volume("world", WORLD_STATE)], {"LALLIANCE_MISSION": MISSION})


def _robot(name: str, file: dict[str, Any], keys: dict[str, Any], pace: list[str]) -> Service:
    command = ["robot", MISSION, "--name", name, *pace, "--learned", LEARNED]
    environment = {"LALLIANCE_MISSION": MISSION, "LALLIANCE_NAME": name}
    return _member(command, [file, keys, _volume("learned", LEARNED)], environment)


def _summary() -> Service:
    """Waits for the end of the mission, prints its summary and exits with its status."""
    command = ["summary", SUMMARY, "--wait"]
    service = _service(command, [_volume("world", WORLD_STATE, read_only=True)], {})
    return {**service, "profiles": ["tools"], "healthcheck": {"disable": True}}


def _operator(file: dict[str, Any], keys: dict[str, Any]) -> Service:
    """Runs commands of an operator's in the mission."""
    environment = {"LALLIANCE_KEYS": KEYS, "LALLIANCE_CONNECT": ENDPOINT}
    service = _service(["chaos", MISSION, "status"], [file, keys], environment)
    return {**service, "profiles": ["tools"], "healthcheck": {"disable": True}}
