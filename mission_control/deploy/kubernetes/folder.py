"""The folder that `kubectl apply -k` takes: the manifests, the mission, and the kustomization that makes secrets of keys.

A kustomization reads no file outside its folder. So the mission is copied, and the keys are expected there, in `keys/`.
"""

from collections.abc import Sequence
from pathlib import Path

from lalliance_agents.bus.credentials import ROUTER, Credentials, credentials_in
from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.whole_file import written_whole
from mission_control.deploy.documents import MADE_BY, Document, as_text
from mission_control.deploy.kubernetes.objects import Objects
from mission_control.deploy.parts import MISSION

KUSTOMIZATION = "kustomization.yaml"
#: Where the folder of keys is to be.
KEYS = Path("keys")


def contents(path: Path, mission: Mission, words: Sequence[str], speed: float = 1.0) -> dict[str, str]:
    """What is in the folder, by the files' names.

    Args:
        path: the mission file.
        mission: what it says.
        words: what `lalliance` was told, for the first line of each file.
        speed: mission seconds per real second.

    Raises:
        UserError: a name in the mission cannot be made one of Kubernetes, or the file cannot be read.
    """
    objects = Objects(path, mission, speed)
    files, copy = objects.files(), Path(MISSION).name
    texts = {name: as_text(words, *documents) for name, documents in files.items()}
    texts[KUSTOMIZATION] = as_text(words, _kustomization(objects, list(files), copy))
    try:
        texts[copy] = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror or error}); expected a mission file") from None
    return texts


def write(texts: dict[str, str], folder: Path) -> None:
    """Write the files into a folder, which may hold what was made for a mission before.

    Raises:
        UserError: it holds something else, or cannot be written to.
    """
    there = [name for name in texts if (folder / name).exists()]
    if there and not _is_ours(folder / KUSTOMIZATION):
        raise UserError(
            f"{folder / there[0]}: exists already, and was not made by `lalliance deploy kubernetes`; expected another folder"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            with written_whole(folder / name) as file:
                file.write(text.encode())
    except OSError as error:
        raise UserError(
            f"{folder}: cannot be written to ({error.strerror or error}); expected a folder, or a place for one"
        ) from None


def _is_ours(kustomization: Path) -> bool:
    try:
        return kustomization.read_text(encoding="utf-8").startswith(f"{MADE_BY} deploy kubernetes ")
    except (OSError, UnicodeDecodeError):
        return False


def _kustomization(objects: Objects, files: list[str], mission: str) -> Document:
    return {
        "apiVersion": "kustomize.config.k8s.io/v1beta1",
        "kind": "Kustomization",
        "namespace": objects.namespace,
        "resources": files,
        "configMapGenerator": [{"name": "mission", "files": [mission]}],
        "secretGenerator": [
            {"name": secret, "files": _files_of(credentials_in(KEYS, whose), with_rules=whose == ROUTER)}
            for secret, whose in objects.secrets().items()
        ],
    }


def _files_of(credentials: Credentials, *, with_rules: bool) -> list[str]:
    files = [credentials.ca, credentials.certificate, credentials.key]
    return [file.as_posix() for file in (*files, *([credentials.access] if with_rules else []))]
