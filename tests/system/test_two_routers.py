"""A team on two machines, each with a router of its own: network namespaces, joined by one cable that can be pulled.

Robots on either side take one another for lost while the cable is out, and are one team again when it is back.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.processes import Processes, read_until
from support.secured import new_keys

pytestmark = [
    pytest.mark.alone,
    pytest.mark.timeout(300),
    pytest.mark.skipif(
        os.geteuid() != 0 or shutil.which("ip") is None, reason="needs root and iproute2 for network namespaces"
    ),
]

TEAM = """\
name: team
tasks: {north: {}, south: {}}
robots:
  ada: {tasks: {north: 50, south: 55}}
  bob: {tasks: {north: 55, south: 50}}
  eve: {tasks: {north: 60, south: 60}}
knowledge: given
parameters: {broadcast_rate: 5, silence_timeout: 3.0, min_delay: 0.2, max_delay: 1.0}
deadline: 600
"""


class Machine:
    """A network namespace with one end of the cable."""

    def __init__(self, name: str, address: str) -> None:
        self.name = name
        self.address = address
        self.within = ["ip", "netns", "exec", name]

    def ip(self, *words: str) -> None:
        subprocess.run(["ip", "-n", self.name, *words], check=True)

    def pull(self) -> None:
        self.ip("link", "set", "cable", "down")

    def plug_in(self) -> None:
        self.ip("link", "set", "cable", "up")

    def lose_address(self) -> None:
        self.ip("address", "del", f"{self.address}/30", "dev", "cable")

    def find_address(self) -> None:
        self.ip("address", "add", f"{self.address}/30", "dev", "cable")


@pytest.fixture
def machines() -> Iterator[tuple[Machine, Machine]]:
    left, right = (
        Machine(f"lalliance-{os.getpid()}-{side}", f"10.203.0.{number}")
        for number, side in enumerate(("left", "right"), start=1)
    )
    try:
        for machine in (left, right):
            subprocess.run(["ip", "netns", "add", machine.name], check=True)
        left.ip("link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", right.name)
        for machine in (left, right):
            machine.ip("link", "set", "lo", "up")
            machine.find_address()
            machine.plug_in()
        yield left, right
    finally:
        for machine in (left, right):
            subprocess.run(["ip", "netns", "delete", machine.name], check=False)


def test_a_team_on_two_machines_goes_on_whatever_happens_between_them(
    machines: tuple[Machine, Machine], processes: Processes, tmp_path: Path
) -> None:
    left, right = machines
    (tmp_path / "team.yaml").write_text(TEAM)
    keys = new_keys(tmp_path / "keys", "ada", "bob", "eve", hosts=[left.address, right.address])
    local = ["--connect", "tls/127.0.0.1:7447", "--keys", str(keys)]
    listening = ["router", "--listen", "tls/0.0.0.0:7447", "--keys", str(keys)]
    # The one that connects may be there first.
    routers = [
        processes.start(*listening, "--connect", f"tls/{right.address}:7447", within=left.within),
        processes.start(*listening, within=right.within),
    ]
    for router in routers:
        read_until(router, "listens")
    # On the right side there is somebody who sees what that side sees.
    told = {"LALLIANCE_CONNECT": "tls/127.0.0.1:7447", "LALLIANCE_KEYS": str(keys)}
    seen = processes.start_module(
        "support.onlooker", "team", within=[*right.within, "env", *(f"{name}={value}" for name, value in told.items())]
    )
    read_until(seen, "looking on")
    robots = [
        processes.start("robot", "team.yaml", "--name", name, *local, "--speed", "2", within=machine.within)
        for name, machine in (("ada", left), ("bob", left), ("eve", right))
    ]
    world = processes.start("world", "team.yaml", *local, "--speed", "2", within=right.within)
    read_until_all(seen, ["starts north", "starts south"])

    left.pull()
    read_until_all(seen, ["eve takes", "(silence)", "ada is gone", "bob is gone"])
    left.plug_in()
    read_until_all(seen, ["ada is there", "bob is there"])

    for machine in (left, right):
        machine.lose_address()
        read_until_all(seen, ["ada is gone", "bob is gone"])
        machine.find_address()
        read_until_all(seen, ["ada is there", "bob is there"])

    out, _ = world.communicate(timeout=200)
    assert "Mission team complete" in out
    assert world.returncode == 0
    assert [robot.wait(timeout=20) for robot in robots] == [0, 0, 0]


def read_until_all(seen: "subprocess.Popen[str]", texts: list[str]) -> None:
    """Read on until each of the texts has come, in whatever order."""
    left = set(texts)
    while left:
        line = read_until(seen, "")[-1]
        left -= {text for text in left if text in line}
