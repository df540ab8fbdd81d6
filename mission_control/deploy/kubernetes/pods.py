"""What is the same for every part: a pod with one container, confined, that sees what the part is to see.

Probes ask over the bus, and so fail for everybody while the router is away. Only the router is therefore started again for it;
a robot that hangs is shown as not ready, and its teammates take its tasks.
"""

from pathlib import Path
from typing import Any, NamedTuple

from lalliance_agents.bus.credentials import credentials_in
from mission_control.deploy.parts import HEALTH, IMAGE, KEYS, MISSION, USER, Part, place

NAME, COMPONENT = "app.kubernetes.io/name", "app.kubernetes.io/component"


class Named(NamedTuple):
    """A part, and what it has in Kubernetes.

    Attributes:
        part: who runs what.
        name: of the object.
        component: the kind of part.
        claim: the claim of the volume that it sees; None: none.
    """

    part: Part
    name: str
    component: str
    claim: str | None = None

    @property
    def secret(self) -> str:
        """What its keys are called."""
        return f"keys-{self.name}"


def labels(component: str) -> dict[str, str]:
    """By which a part is found."""
    return {NAME: IMAGE, COMPONENT: component}


def template(one: Named, container: dict[str, Any], **more: Any) -> dict[str, Any]:
    """The pod of a part.

    Args:
        one: the part.
        container: what `container` has made of it, perhaps with more.
        more: further fields of the pod.
    """
    spec = {
        **more,
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        "terminationGracePeriodSeconds": 5,
        "securityContext": {
            "runAsNonRoot": True,
            "runAsUser": USER,
            "runAsGroup": USER,
            "fsGroup": USER,
            "seccompProfile": {"type": "RuntimeDefault"},
        },
        "containers": [container],
        "volumes": _volumes(one),
    }
    return {"metadata": {"labels": labels(one.component)}, "spec": spec}


def container(one: Named, **variables: str) -> dict[str, Any]:
    """The container of a part, with further variables of the environment."""
    environment = {**one.part.environment, **variables}
    return {
        "name": one.component,
        "image": IMAGE,
        "imagePullPolicy": "IfNotPresent",
        "args": list(one.part.command),
        "env": [{"name": name, "value": value} for name, value in environment.items()],
        "securityContext": {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        },
        # No limit of processor time: a robot that is held back looks dead to its teammates.
        "resources": {"requests": {"cpu": "50m", "memory": "96Mi"}, "limits": {"memory": "256Mi"}},
        "volumeMounts": _mounts(one.part),
    }


def probe(period: int) -> dict[str, Any]:
    """Asks the part whether it is well, every so many seconds."""
    return {"exec": {"command": list(HEALTH)}, "periodSeconds": period, "timeoutSeconds": 10, "failureThreshold": 3}


def _volumes(one: Named) -> list[dict[str, Any]]:
    volumes: list[dict[str, Any]] = [{"name": "tmp", "emptyDir": {"medium": "Memory", "sizeLimit": "64Mi"}}]
    if one.part.mission:
        volumes.append({"name": "mission", "configMap": {"name": "mission"}})
    if one.part.keys is not None:
        # They belong to root, and to the pod's group to read.
        volumes.append({"name": "keys", "secret": {"secretName": one.secret, "defaultMode": 0o440}})
    if one.claim is not None:
        # Not read-only here: some drivers would attach it so to the machine, for everybody.
        volumes.append({"name": "kept", "persistentVolumeClaim": {"claimName": one.claim}})
    return volumes


def _mounts(part: Part) -> list[dict[str, Any]]:
    mounts: list[dict[str, Any]] = [{"name": "tmp", "mountPath": "/tmp"}]  # noqa: S108 - inside a container of its own
    if part.mission:
        mounts.append({"name": "mission", "mountPath": MISSION, "subPath": Path(MISSION).name, "readOnly": True})
    if part.keys is not None:
        own = credentials_in(Path(KEYS), part.keys).folder.as_posix()
        mounts.append({"name": "keys", "mountPath": own, "readOnly": True})
    if part.volume is not None:
        mount = {"name": "kept", "mountPath": place(part.volume)}
        mounts.append(mount | ({"readOnly": True} if part.only_reads else {}))
    return mounts
