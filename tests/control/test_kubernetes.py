"""A mission's manifests for Kubernetes: what the command writes, that it fits the API and itself, and confines every pod."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from kubernetes_validate import validate
from support.processes import MISSIONS, Processes
from support.secured import new_keys

from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import load_mission
from mission_control.deploy.compose import compose
from mission_control.deploy.kubernetes.folder import KUSTOMIZATION, contents, write

ROOT = MISSIONS.parent
DEMO = MISSIONS / "material_handling.yaml"
LATER = """\
name: Two_Rooms
tasks: {sweep: {}}
robots:
  R_1: {tasks: {sweep: 5}}
  r2: {tasks: {sweep: 6}, joins: 2}
deadline: 60
"""

Object = dict[str, Any]
DEPLOYMENTS = ("router", "operator", "dashboard")


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "rooms.yaml").write_text(LATER)
    (tmp_path / "missions").symlink_to(MISSIONS)
    with Processes(tmp_path) as tree:
        yield tree


@pytest.fixture(scope="module", params=["demo", "rooms"])
def objects(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[Object]:
    """What a cluster would get of a mission: made by kustomize, or read without it where there is none."""
    place = tmp_path_factory.mktemp(request.param)
    path, folder = DEMO, place / "made"
    if request.param == "rooms":
        (path := place / "rooms.yaml").write_text(LATER)
    mission = load_mission(path)
    write(contents(path, mission, ["deploy", "kubernetes", str(path)]), folder)
    new_keys(folder / "keys", *mission.robots)
    if shutil.which("kubectl"):
        done = subprocess.run(["kubectl", "kustomize", str(folder)], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        return list(yaml.safe_load_all(done.stdout))
    return list(read(folder))


def read(folder: Path) -> Iterator[Object]:
    """The objects that a kustomization names, and of those that it makes what others see of them: kind, name and files."""
    kustomization = yaml.safe_load((folder / KUSTOMIZATION).read_text())
    for name in kustomization["resources"]:
        yield from yaml.safe_load_all((folder / name).read_text())
    for kind in ("ConfigMap", "Secret"):
        for made in kustomization[f"{kind[0].lower()}{kind[1:]}Generator"]:
            data = {Path(name).name: (folder / name).read_text() for name in made["files"]}
            yield {"apiVersion": "v1", "kind": kind, "metadata": {"name": made["name"]}, "data": data}


def pods(objects: list[Object]) -> dict[str, Object]:
    """The pods' specifications, by the names of what makes them."""
    makers = [one for one in objects if one["kind"] in ("Deployment", "Job")]
    return {one["metadata"]["name"]: one["spec"]["template"]["spec"] for one in makers}


def of_kind(objects: list[Object], kind: str) -> dict[str, Object]:
    return {one["metadata"]["name"]: one for one in objects if one["kind"] == kind}


def test_the_manifests_that_are_shipped_are_those_that_are_written(processes: Processes) -> None:
    shipped = ROOT / "deploy/kubernetes"
    [words] = re.findall(r"^# Made by: lalliance (.*)$", (shipped / KUSTOMIZATION).read_text(), flags=re.MULTILINE)
    write(
        contents(DEMO, load_mission(DEMO), ["deploy", "kubernetes", "of before"]),
        processes.folder / "deploy/kubernetes",
    )
    done = processes.run(*words.split())
    assert done.stdout == "deploy/kubernetes: manifests of 4 robots, the world and the router\n"
    made = {file.name: file.read_text() for file in (processes.folder / "deploy/kubernetes").iterdir()}
    assert made == {file.name: file.read_text() for file in shipped.iterdir() if file.is_file()}


def test_a_cluster_of_any_version_in_use_takes_them(objects: list[Object]) -> None:
    """The API schemas of the oldest version whose fields are used, and of the newest there is."""
    for version in ("1.29", "1.37"):
        for one in objects:
            assert validate(one, version, strict=True) == version
    for name, pod in pods(objects).items():
        # What no schema says: a job's pods are not started again for ever, a deployment's are.
        assert pod.get("restartPolicy") == {**dict.fromkeys(DEPLOYMENTS), "summary": "Never"}.get(name, "OnFailure")


def test_all_that_a_pod_names_is_there(objects: list[Object]) -> None:
    names = {kind: set(of_kind(objects, kind)) for kind in ("ConfigMap", "Secret", "PersistentVolumeClaim")}
    used: dict[str, list[str]] = {kind: [] for kind in names}
    for pod in pods(objects).values():
        [container] = pod["containers"]
        assert [one["name"] for one in container["volumeMounts"]] == [one["name"] for one in pod["volumes"]]
        for volume in pod["volumes"]:
            if "configMap" in volume:
                used["ConfigMap"].append(volume["configMap"]["name"])
            if "secret" in volume:
                used["Secret"].append(volume["secret"]["secretName"])
            if "persistentVolumeClaim" in volume:
                used["PersistentVolumeClaim"].append(volume["persistentVolumeClaim"]["claimName"])
    assert {kind: set(found) for kind, found in used.items()} == names
    # Nobody sees the keys of another.
    assert len(used["Secret"]) == len(set(used["Secret"]))
    [router] = of_kind(objects, "Service").values()
    deployments = of_kind(objects, "Deployment")
    assert router["spec"]["selector"] == deployments["router"]["spec"]["template"]["metadata"]["labels"]
    assert router["metadata"]["name"] == "router"  # the name in its certificate, and in all endpoints
    for one in deployments.values():
        assert one["spec"]["selector"]["matchLabels"] == one["spec"]["template"]["metadata"]["labels"]


def test_every_pod_is_confined(objects: list[Object]) -> None:
    for pod in pods(objects).values():
        assert pod["securityContext"] == {
            "runAsNonRoot": True,
            "runAsUser": 10001,
            "runAsGroup": 10001,
            "fsGroup": 10001,
            "seccompProfile": {"type": "RuntimeDefault"},
        }
        assert pod["automountServiceAccountToken"] is False
        [container] = pod["containers"]
        assert container["securityContext"] == {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        }
        assert container["resources"]["limits"]["memory"]
    [namespace] = of_kind(objects, "Namespace").values()
    assert namespace["metadata"]["labels"] == {"pod-security.kubernetes.io/enforce": "restricted"}


def test_nothing_leaves_but_to_the_router_and_the_name_server(objects: list[Object]) -> None:
    policies = {name: one["spec"] for name, one in of_kind(objects, "NetworkPolicy").items()}
    assert policies.pop("nothing-else") == {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}
    [router] = [one["spec"]["selector"] for one in of_kind(objects, "Service").values()]
    assert policies["called"]["podSelector"] == {"matchLabels": router}
    bus, names = policies["calls"]["egress"]
    assert bus == {"to": [{"podSelector": {"matchLabels": router}}], "ports": [{"protocol": "TCP", "port": 7447}]}
    assert [one["podSelector"]["matchLabels"] for one in names["to"]] == [{"k8s-app": "kube-dns"}]
    assert {one["port"] for one in names["ports"]} == {53}
    assert "egress" not in policies["called"]
    [called] = policies["called"]["ingress"]
    assert called["from"] == [{"podSelector": policies["calls"]["podSelector"]}]


def test_the_parts_are_those_of_the_compose_file() -> None:
    """The same commands with the same environment, but for how long they wait for the router."""
    mission = load_mission(DEMO)
    services = compose(mission, DEMO, DEMO.parent, keys=Path("keys"))["services"]
    texts = contents(DEMO, mission, [])
    documents = [one for name, text in texts.items() if name != "mission.yaml" for one in yaml.safe_load_all(text)]
    found = pods(documents)
    assert set(found) == set(services)
    for name, pod in found.items():
        [container] = pod["containers"]
        variables = {one["name"]: one["value"] for one in container["env"]}
        variables.pop("LALLIANCE_CONNECT_TIMEOUT", None)
        assert variables == services[name]["environment"]
        assert name == "operator" or container["args"] == services[name]["command"]


def test_who_joins_later_is_not_started_yet(processes: Processes) -> None:
    done = processes.run("deploy", "kubernetes", "rooms.yaml", "--out", "made")
    assert done.returncode == 0
    assert done.stderr == (
        "lalliance: warning: rooms.yaml: who joins later is to be started by hand, with kubectl patch job JOB --patch "
        '\'{"spec": {"suspend": false}}\': robot-r2 at 2 s\n'
    )
    jobs = of_kind(list(yaml.safe_load_all((processes.folder / "made/robots.yaml").read_text())), "Job")
    assert {name: one["spec"].get("suspend", False) for name, one in jobs.items()} == {
        "robot-r-1": False,
        "robot-r2": True,
    }


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ("R_1", "R2"),
            "robots 'R2' and 'r2' would both be robot-r2 in Kubernetes; expected names that differ in more than capitals,",
        ),
        (
            ("R_1", "__"),
            "robot '__' would have no name in Kubernetes; expected letters or digits in it, and at most 57 ",
        ),
        (
            ("Two_Rooms", "r" * 54),
            f"mission '{'r' * 54}' would have no name in Kubernetes; expected letters or digits in it, and at most 53 ",
        ),
    ],
)
def test_names_that_kubernetes_does_not_take_are_refused(
    tmp_path: Path, change: tuple[str, str], sentence: str
) -> None:
    (path := tmp_path / "rooms.yaml").write_text(LATER.replace(*change))
    with pytest.raises(UserError) as caught:
        contents(path, load_mission(path), [])
    assert str(caught.value).startswith(f"{path}: {sentence}")


def test_what_is_not_ours_is_not_written_over(processes: Processes) -> None:
    """Nor is anything written for a mission that does not match the keys that are there."""
    made = processes.folder / "made"
    made.mkdir()
    (made / "network.yaml").write_text("mine: true\n")
    done = processes.run("deploy", "kubernetes", "rooms.yaml", "--out", "made")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lalliance: made/network.yaml: exists already, and was not made by `lalliance deploy kubernetes`; "
        "expected another folder\n"
    )
    (made / "network.yaml").unlink()
    new_keys(made / "keys", "r2")
    done = processes.run("deploy", "kubernetes", "rooms.yaml", "--out", "made")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lalliance: made/keys: these keys were made for another team, without R_1 of rooms.yaml; "
        "expected new ones, once these are moved away: lalliance keys init rooms.yaml --keys made/keys\n"
    )
    assert [file.name for file in made.iterdir()] == ["keys"]
