"""Keys: made once, for their owners only; those that cannot be used get one sentence that names the file and the remedy."""

import importlib
import os
import shutil
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.processes import Processes, read_until, until
from support.secured import new_keys

from lalliance_agents.bus.certificates import checked_credentials
from lalliance_agents.bus.credentials import ROUTER, KeysError, credentials_in
from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.extras import MissingExtraError, extra
from lalliance_agents.wire.keys import OPERATOR, WORLD

PAIR = """\
name: pair
tasks: {a: {}, b: {after: [a]}}
robots:
  r1: {tasks: {a: 5, b: 5}}
  r2: {tasks: {a: 6}}
knowledge: given
parameters: {min_delay: 0.05, max_delay: 0.2}
deadline: 60
"""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    (tmp_path / "pair.yaml").write_text(PAIR)
    with Processes(tmp_path) as tree:
        yield tree


@pytest.fixture
def keys(tmp_path: Path) -> Path:
    return new_keys(tmp_path / "keys", "r1", "r2")


def test_everybody_gets_what_only_they_can_read(processes: Processes) -> None:
    done = processes.run("keys", "init", "pair.yaml", "--days", "7")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (
        "keys: keys of 2 robots, the world, the operator and the router, valid for 7 days\n"
        "whoever has keys/ca/key.pem can make further keys: put it away, or delete it\n"
    )
    made = sorted(str(path.relative_to(processes.folder)) for path in (processes.folder / "keys").rglob("*.*"))
    owners = ["operator", "robots/r1", "robots/r2", "router", "world"]
    files = {f"keys/{owner}/{name}.pem" for owner in owners for name in ("ca", "certificate", "key")}
    assert set(made) == files | {"keys/ca/certificate.pem", "keys/ca/key.pem", "keys/router/access.json"}
    for path in (processes.folder / "keys").rglob("key.pem"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    for name in (ROUTER, WORLD, OPERATOR, "r1", "r2"):
        checked_credentials(processes.folder / "keys", name)


def test_keys_are_not_replaced(processes: Processes, keys: Path) -> None:
    before = {path: path.read_bytes() for path in keys.rglob("*.*")}
    done = processes.run("keys", "init", "pair.yaml")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "lalliance: keys: exists already, and keys in use are not replaced; expected a new folder\n"
    assert {path: path.read_bytes() for path in keys.rglob("*.*")} == before


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["no.yaml"], "no.yaml: no such file; expected a mission file"),
        (["pair.yaml", "--host", "ü"], "'ü' is not a host; expected a host name in ASCII, or an IP address"),
        (
            ["pair.yaml", "--keys", "pair.yaml/keys"],
            "pair.yaml/keys: cannot be made (File exists); expected a place",
        ),
    ],
)
def test_what_keys_cannot_be_made_of_leaves_nothing(processes: Processes, arguments: list[str], sentence: str) -> None:
    done = processes.run("keys", "init", *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"lalliance: {sentence}")
    assert done.stderr.count("\n") == 1
    assert [path.name for path in processes.folder.iterdir()] == ["pair.yaml"]


def foreign(keys: Path) -> Path:
    return credentials_in(new_keys(keys.with_name("foreign"), "r1"), "r1").folder


def cut_to(text: bytes) -> Callable[[Path], None]:
    return lambda keys: (keys / "robots/r1/certificate.pem").write_bytes(text) and None


def swap(name: str) -> Callable[[Path], None]:
    def take_from_foreign(keys: Path) -> None:
        shutil.copy(foreign(keys) / name, keys / "robots/r1" / name)

    return take_from_foreign


BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "no keys at all": (
        shutil.rmtree,
        "{r1}: no such folder; expected the keys of robot r1, made by `lalliance keys init`",
    ),
    "no private key": (
        lambda keys: (keys / "robots/r1/key.pem").unlink(),
        "{r1}/key.pem: no such file; expected keys made by `lalliance keys init`, and copied whole",
    ),
    "a private key for everybody": (
        lambda keys: (keys / "robots/r1/key.pem").chmod(0o644),
        "{r1}/key.pem: others can use this private key (mode 0644); expected chmod 600 {r1}/key.pem",
    ),
    "a private key for the group": (
        lambda keys: (keys / "robots/r1/key.pem").chmod(0o640),
        "{r1}/key.pem: others can use this private key (mode 0640); expected chmod 600 {r1}/key.pem",
    ),
    "a private key that is none": (
        lambda keys: (keys / "robots/r1/key.pem").write_text("secret"),
        "{r1}/key.pem: not a private key in PEM form without a password; expected keys made by",
    ),
    "a foreign private key": (
        swap("key.pem"),
        "{r1}/key.pem: does not belong to {r1}/certificate.pem; expected keys made by `lalliance keys init` at one time",
    ),
    "a foreign certificate": (
        swap("certificate.pem"),
        "{r1}/certificate.pem: was not issued by the authority in {r1}/ca.pem; expected both from one `lalliance keys init`",
    ),
    "a foreign authority": (swap("ca.pem"), "{r1}/certificate.pem: was not issued by the authority in {r1}/ca.pem"),
    "an empty certificate": (cut_to(b""), "{r1}/certificate.pem: not a certificate in PEM form; expected keys made by"),
    "a certificate of bytes": (cut_to(b"\xff\0"), "{r1}/certificate.pem: not a certificate in PEM form"),
    "a certificate that is a folder": (
        lambda keys: ((keys / "robots/r1/ca.pem").unlink(), (keys / "robots/r1/ca.pem").mkdir()),
        "{r1}/ca.pem: cannot be read (Is a directory); expected a file that this user may read",
    ),
    "another robot's keys": (
        lambda keys: (shutil.rmtree(keys / "robots/r1"), shutil.copytree(keys / "robots/r2", keys / "robots/r1")),
        "{r1}/certificate.pem: is the certificate of r2; expected that of r1",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_keys_that_cannot_be_used_are_named_with_the_remedy(keys: Path, case: str) -> None:
    breaking, sentence = BROKEN[case]
    breaking(keys)
    with pytest.raises(KeysError) as caught:
        checked_credentials(keys, "r1")
    assert str(caught.value).startswith(sentence.format(r1=keys / "robots/r1"))


def test_a_folder_of_keys_with_a_name_that_is_too_long_is_not_there() -> None:
    with pytest.raises(KeysError, match="no such folder; expected the keys of robot r1"):
        checked_credentials(Path("x" * 300), "r1")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file to root")
@pytest.mark.parametrize(("mode", "usable"), [(0o440, True), (0o640, True), (0o460, False), (0o444, False)])
def test_root_may_let_a_group_read_a_private_key(
    keys: Path, monkeypatch: pytest.MonkeyPatch, mode: int, usable: bool
) -> None:
    """As Kubernetes does for a process without root, which could read it in no other way; the group may do no more."""
    monkeypatch.setattr(os, "geteuid", lambda: 10001)
    (keys / "robots/r1/key.pem").chmod(mode)
    if usable:
        assert checked_credentials(keys, "r1") == credentials_in(keys, "r1")
        return
    with pytest.raises(KeysError, match=f"others can use this private key \\(mode {mode:04o}\\)"):
        checked_credentials(keys, "r1")


def test_keys_that_have_expired_or_are_not_yet_valid_are_refused(tmp_path: Path) -> None:
    old = new_keys(tmp_path / "old", "r1", since=-3 * 86400, until=-86400)
    with pytest.raises(KeysError, match=r"old/robots/r1/ca\.pem: expired on \d{4}-\d\d-\d\d; expected new keys"):
        checked_credentials(old, "r1")
    early = new_keys(tmp_path / "early", "r1", since=86400, until=2 * 86400)
    with pytest.raises(KeysError, match=r"valid only from .* UTC; expected this machine's calendar to be right"):
        checked_credentials(early, "r1")


@pytest.mark.parametrize(
    ("rules", "sentence"),
    [
        ("{", "not readable as JSON"),
        ("[]", "these rules do not deny what they do not allow"),
        ('{"enabled": true, "default_permission": "allow"}', "these rules do not deny what they do not allow"),
        ('{"enabled": false, "default_permission": "deny"}', "these rules do not deny what they do not allow"),
    ],
)
def test_a_router_whose_rules_let_everything_through_does_not_start(
    processes: Processes, keys: Path, rules: str, sentence: str
) -> None:
    credentials_in(keys, ROUTER).access.write_text(rules)
    done = processes.run("router", "--listen", free_endpoint("tls"), "--keys", "keys")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"lalliance: keys/router/access.json: {sentence}")
    assert done.stderr.count("\n") == 1


COMMANDS = {
    "a robot": (["robot", "pair.yaml", "--name", "r1"], "keys/robots/r1/key.pem"),
    "the world": (["world", "pair.yaml"], "keys/world/key.pem"),
    "the router": (["router"], "keys/router/key.pem"),
    "an operator": (["chaos", "pair.yaml", "status"], "keys/operator/key.pem"),
    "all of them": (["run", "pair.yaml"], "keys/robots/r1/key.pem"),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_every_command_refuses_a_private_key_that_others_can_use(processes: Processes, keys: Path, case: str) -> None:
    arguments, path = COMMANDS[case]
    (processes.folder / path).chmod(0o604)
    done = processes.run(*arguments, "--keys", "keys")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"lalliance: {path}: others can use this private key (mode 0604); expected chmod 600 {path}\n"
    assert processes.alive() == []


@pytest.mark.parametrize("case", COMMANDS)
def test_every_command_refuses_to_show_keys_where_nobody_asks(processes: Processes, keys: Path, case: str) -> None:
    arguments, _ = COMMANDS[case]
    option, endpoint = "--listen" if case == "the router" else "--connect", free_endpoint()
    done = processes.run(*arguments, "--keys", "keys", option, endpoint)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"'{endpoint}' is not encrypted and asks for no keys; with --keys expected an endpoint tls/" in done.stderr
    assert done.stderr.count("\n") == 1
    assert processes.alive() == []


def test_a_mission_with_a_robot_that_has_no_keys_is_refused(processes: Processes, keys: Path) -> None:
    (processes.folder / "three.yaml").write_text(PAIR.replace("  r2:", "  r3: {tasks: {a: 9}}\n  r2:"))
    done = processes.run("run", "three.yaml", "--keys", "keys")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "lalliance: keys: these keys were made for another team, without r3 of three.yaml; "
        "expected new ones, once these are moved away: lalliance keys init three.yaml --keys keys\n"
    )
    done = processes.run("robot", "three.yaml", "--name", "r3", "--keys", "keys")
    assert done.returncode == 2
    assert done.stderr.startswith("lalliance: keys/robots/r3: no such folder; expected the keys of robot r3")
    done = processes.run("run", "three.yaml", "--keys", "none")
    assert done.returncode == 2
    assert done.stderr == (
        "lalliance: none: no such folder; expected the keys of this team: lalliance keys init three.yaml --keys none\n"
    )


def test_a_team_on_one_machine_each_with_its_own_keys_alone(processes: Processes, keys: Path) -> None:
    """As on machines of their own: whoever starts has a folder with nothing but its own keys in it."""
    endpoint = free_endpoint("tls")
    for owner in ("router", "world", "robots/r1", "robots/r2"):
        shutil.copytree(keys / owner, processes.folder / "of" / owner.replace("/", "-") / owner)

    def words(owner: str) -> tuple[str, ...]:
        return "--keys", f"of/{owner}"

    router = processes.start("router", "--listen", endpoint, *words("router"))
    read_until(router, "listens")
    robots = [
        processes.start("robot", "pair.yaml", "--name", name, "--connect", endpoint, *words(f"robots-{name}"))
        for name in ("r1", "r2")
    ]
    done = processes.run("world", "pair.yaml", "--connect", endpoint, *words("world"))
    assert done.returncode == 0, done.stderr
    assert [robot.wait(timeout=10) for robot in robots] == [0, 0]


def test_a_fault_is_injected_with_the_operators_keys_and_not_without(processes: Processes, keys: Path) -> None:
    running = processes.start("run", "pair.yaml", "--plain", "--keys", keys)
    read_until(running, "starts")
    refused = processes.run("chaos", "pair.yaml", "status")
    assert refused.returncode == 2
    assert "expected --keys" in refused.stderr
    told = processes.chaos("pair.yaml", "inject", "kind=hang", "robot=r2", "for=0.5", "--keys", keys)
    assert told.startswith("1-hang")
    assert running.wait(timeout=60) == 0
    until(lambda: processes.alive() == [])


def test_without_the_extra_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cryptography", None)
    monkeypatch.delitem(sys.modules, "lalliance_agents.bus.certificates")
    with pytest.raises(MissingExtraError) as caught, extra("deploy"):
        importlib.import_module("lalliance_agents.bus.certificates")
    assert str(caught.value) == (
        "this needs the package cryptography, which is not installed; "
        "expected the deploy extra: pip install 'lalliance[deploy]'"
    )
