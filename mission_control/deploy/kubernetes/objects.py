"""The objects of a mission's deployment, and which file holds which."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lalliance_agents.config import Mission
from mission_control.deploy.documents import Document
from mission_control.deploy.kubernetes.names import name_of, names_of_robots
from mission_control.deploy.kubernetes.network import policies
from mission_control.deploy.kubernetes.pods import NAME, Named, container, labels, probe, template
from mission_control.deploy.parts import IMAGE, LEARNED, PORT, RESTARTS, WORLD_STATE, parts_of

#: Members wait so long for a router, in seconds: its machine may have to fetch the image first.
CONNECT_TIMEOUT = 300


class Objects:
    """All of a mission's deployment.

    Args:
        path: the mission file.
        mission: what it says.
        speed: mission seconds per real second.

    Attributes:
        namespace: where all of it is.

    Raises:
        UserError: a name in the mission cannot be made one of Kubernetes.
    """

    def __init__(self, path: Path, mission: Mission, speed: float) -> None:
        parts, names = parts_of(mission, speed), names_of_robots(path, mission.robots)
        self.namespace = name_of(path, "mission", mission.name)
        self._router, self._operator = (Named(part, part.name, part.name) for part in (parts.router, parts.operator))
        self._dashboard = Named(parts.dashboard, parts.dashboard.name, parts.dashboard.name)
        self._world = Named(parts.world, "world", "world", claim=WORLD_STATE)
        self._summary = Named(parts.summary, "summary", "summary", claim=WORLD_STATE)
        self._robots = [
            Named(part, names[robot], "robot", claim=f"{LEARNED}-{names[robot]}")
            for robot, part in parts.robots.items()
        ]

    def files(self) -> dict[str, list[Document]]:
        """The objects in each file, by the files' names."""
        return {
            "namespace.yaml": [_namespace(self.namespace)],
            "network.yaml": policies(),
            "router.yaml": [_router(self._router), _service(self._router)],
            "world.yaml": list(_member(self._world)),
            "robots.yaml": [one for robot in self._robots for one in _member(robot)],
            "summary.yaml": [_summary(self._summary, beside=self._world)],
            "operator.yaml": [_sleeping(self._operator)],
            "dashboard.yaml": [_page(self._dashboard)],
        }

    def secrets(self) -> dict[str, str]:
        """Whose keys each secret holds, by the secrets' names."""
        everybody = (self._router, self._world, self._operator, self._dashboard, *self._robots)
        return {one.secret: one.part.keys for one in everybody if one.part.keys is not None}


def _namespace(name: str) -> Document:
    # Kubernetes itself then refuses what would be less confined.
    enforced = {"pod-security.kubernetes.io/enforce": "restricted"}
    return {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": name, "labels": enforced}}


def _metadata(one: Named) -> dict[str, Any]:
    return {"name": one.name, "labels": labels(one.component)}


def _member(one: Named) -> Iterator[Document]:
    """What takes part in the mission until it is over, and its volume."""
    yield {
        "apiVersion": "v1",
        "kind": "PersistentVolumeClaim",
        "metadata": {"name": one.claim, "labels": {NAME: IMAGE}},
        "spec": {"accessModes": ["ReadWriteOnce"], "resources": {"requests": {"storage": "100Mi"}}},
    }
    runs = {**container(one, LALLIANCE_CONNECT_TIMEOUT=str(CONNECT_TIMEOUT)), "readinessProbe": probe(15)}
    yield {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": _metadata(one),
        "spec": {
            "backoffLimit": RESTARTS,
            # Nobody is replaced while it may still be alive.
            "podReplacementPolicy": "Failed",
            **({"suspend": True} if one.part.later else {}),
            "template": template(one, runs, restartPolicy="OnFailure"),
        },
    }


def _summary(one: Named, *, beside: Named) -> Document:
    # A volume is on one machine at a time: this goes where the world is.
    there = {"labelSelector": {"matchLabels": labels(beside.component)}, "topologyKey": "kubernetes.io/hostname"}
    affinity = {"podAffinity": {"requiredDuringSchedulingIgnoredDuringExecution": [there]}}
    return {
        "apiVersion": "batch/v1",
        "kind": "Job",
        "metadata": _metadata(one),
        "spec": {
            "backoffLimit": 0,
            "template": template(one, container(one), restartPolicy="Never", affinity=affinity),
        },
    }


def _router(one: Named) -> Document:
    listens = {"ports": [{"name": "bus", "containerPort": PORT}]}
    probes = {"readinessProbe": probe(3), "livenessProbe": {**probe(10), "initialDelaySeconds": 10}}
    return _deployment(one, {**container(one), **listens, **probes}, replicas=1)


def _service(one: Named) -> Document:
    return {
        "apiVersion": "v1",
        "kind": "Service",
        "metadata": _metadata(one),
        "spec": {"selector": labels(one.component), "ports": [{"name": "bus", "port": PORT, "targetPort": "bus"}]},
    }


def _sleeping(one: Named) -> Document:
    """A part that is there when somebody asks for it, and does what it is told from outside."""
    asleep = {name: value for name, value in container(one).items() if name != "args"}
    return _deployment(one, {**asleep, "command": ["sleep", "infinity"]}, replicas=0)


def _page(one: Named) -> Document:
    """A page that is shown when somebody asks for it, to whoever may forward its port."""
    listens = {"ports": [{"name": "page", "containerPort": one.part.page}]}
    return _deployment(one, {**container(one), **listens}, replicas=0)


def _deployment(one: Named, runs: dict[str, Any], *, replicas: int) -> Document:
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": _metadata(one),
        "spec": {
            "replicas": replicas,
            # Two routers that do not know of one another would be two teams.
            "strategy": {"type": "Recreate"},
            "selector": {"matchLabels": labels(one.component)},
            "template": template(one, runs),
        },
    }
