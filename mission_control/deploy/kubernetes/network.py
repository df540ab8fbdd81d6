"""Who may speak to whom: members and operator to the router, and to the name server, which tells where the router is."""

from typing import Any

from mission_control.deploy.documents import Document
from mission_control.deploy.kubernetes.pods import COMPONENT, labels
from mission_control.deploy.parts import PORT

#: Who calls the router.
CALLERS = ("world", "robot", "operator", "dashboard")


def policies() -> list[Document]:
    """The network policies of a mission's namespace."""
    callers = {"matchExpressions": [{"key": COMPONENT, "operator": "In", "values": list(CALLERS)}]}
    router = {"matchLabels": labels("router")}
    bus = [{"protocol": "TCP", "port": PORT}]
    name_server = {
        "namespaceSelector": {"matchLabels": {"kubernetes.io/metadata.name": "kube-system"}},
        "podSelector": {"matchLabels": {"k8s-app": "kube-dns"}},
    }
    names = [{"protocol": "UDP", "port": 53}, {"protocol": "TCP", "port": 53}]
    return [
        _policy("nothing-else", {}, policyTypes=["Ingress", "Egress"]),
        _policy(
            "called", router, policyTypes=["Ingress"], ingress=[{"from": [{"podSelector": callers}], "ports": bus}]
        ),
        _policy(
            "calls",
            callers,
            policyTypes=["Egress"],
            egress=[{"to": [{"podSelector": router}], "ports": bus}, {"to": [name_server], "ports": names}],
        ),
    ]


def _policy(name: str, pods: dict[str, Any], **rules: Any) -> Document:
    return {
        "apiVersion": "networking.k8s.io/v1",
        "kind": "NetworkPolicy",
        "metadata": {"name": name},
        "spec": {"podSelector": pods, **rules},
    }
