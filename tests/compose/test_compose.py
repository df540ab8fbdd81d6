"""The deployment as it is shipped: the real image, the compose file, and containers that die, hang and lose the network."""

import json
import os
from datetime import datetime
from pathlib import Path

import pytest
import yaml
from deployment import ROOT, Deployment, docker, until

pytestmark = pytest.mark.timeout(600)

DEMO = ROOT / "missions/material_handling.yaml"
TWO_TASKS = Path(__file__).with_name("mission.yaml")
#: What an operator says, so that the robots' bodies get on with their tasks.
HEAL = ("chaos", "/mission.yaml", "heal")


def test_the_image_is_small_and_has_no_root(image: str) -> None:
    [ours], [base] = (json.loads(docker("image", "inspect", name)) for name in (image, os.environ["BASE_IMAGE"]))
    added = (ours["Size"] - base["Size"]) / 1e6
    assert added < 250, f"{added:.0f} MB over its base"
    assert ours["Config"]["User"] == "10001:10001"
    assert ours["Config"]["Healthcheck"]["Test"] == ["CMD", "lalliance", "health"]


def test_every_service_is_confined(deployed) -> None:
    """As compose understands the file, whatever its text says."""
    shown = yaml.safe_load(deployed(DEMO, ROOT / "deploy/compose.yaml").run("--profile", "*", "config"))
    assert {name: network.get("internal", False) for name, network in shown["networks"].items()} == {
        "bus": True,
        "page": False,
    }
    assert len(shown["services"]) == 9
    page = shown["services"]["dashboard"]
    assert [(one["host_ip"], one["target"]) for one in page.pop("ports")] == [("127.0.0.1", 8080)]
    assert page["networks"].keys() == {"bus", "page"}
    for name, service in shown["services"].items():
        assert name == "dashboard" or service["networks"].keys() == {"bus"}
        assert service["read_only"]
        assert service["init"]
        assert service["cap_drop"] == ["ALL"]
        assert service["user"] == "10001:10001"
        assert "ports" not in service
        assert len([one for one in service["volumes"] if one["target"].startswith("/keys")]) <= 1


def test_the_demo_mission_is_completed_although_a_container_is_killed(deployed) -> None:
    demo: Deployment = deployed(DEMO, ROOT / "deploy/compose.yaml")
    demo.up("material_handling")
    demo.run("up", "--detach", "--pull", "never", "dashboard")
    until(lambda: "the page of mission material_handling" in demo.run("logs", "dashboard"), "the page is shown")
    task = demo.wait_for(r"lifter starts (crate-[\w]+)")[1]
    demo.run("kill", "robot-lifter")
    demo.wait_for(rf"takes {task} from lifter \(silence\)")
    assert "Mission material_handling complete: makespan" in demo.run("run", "--rm", "--no-TTY", "summary")
    words = ["summary", "/var/lib/lalliance/world/summary.json", "--json"]
    summary = json.loads(demo.run("run", "--rm", "--no-TTY", "summary", *words))
    assert summary["complete"]
    assert (task, "lifter", "silence") in {(one["task"], one["from"], one["cause"]) for one in summary["takeovers"]}
    # The world and the robots that live have ended by themselves, and nobody starts them again.
    for service in ("world", "robot-carrier", "robot-pusher", "robot-forklift"):
        until(lambda service=service: demo.facts(service)["State"]["Status"] == "exited", f"{service} ends")
        assert demo.facts(service)["State"]["ExitCode"] == 0


def test_whatever_fails_the_mission_goes_on(deployed) -> None:
    """In turn: a robot killed, one paused, one off the network, one behind a bad line, the router, the world."""
    team: Deployment = deployed(TWO_TASKS)
    team.up("two_tasks")

    def busy() -> dict[str, str]:
        """Which robot is on which task, when all are there and each task has a robot."""
        until(lambda: all(map(team.is_there, ("ada", "bob", "dan", "eve"))), "all are there")
        return until(lambda: on if {"north", "south"} <= set((on := team.workers()).values()) else None, "both are on")

    def alone() -> tuple[str, str, int]:
        """A robot that is alone on a task, as is another on the other, so that two are to spare; which task; events so far."""
        taken: dict[str, str] = {}
        for robot, task in busy().items():
            if task in taken.values():
                # In this phase of learning nobody yields to who began at the same moment, or was away meanwhile.
                team.run("restart", "--timeout", "1", f"robot-{robot}")
                until(lambda robot=robot: robot not in team.workers(), f"{robot} is off {task}")
            else:
                taken[robot] = task
        before = team.so_far()
        return *next(iter(busy().items())), before

    robot, task, before = alone()
    team.run("kill", f"robot-{robot}")
    team.wait_for(rf"takes {task} from {robot} \(silence\)", since=before)
    seconds = heard_again(team, robot)
    print(f"\na robot was heard {seconds:.2f} s after its start, with a load of {os.getloadavg()[0]:.1f}")
    assert 0 < seconds / slowness() < 3.0

    robot, task, before = alone()
    team.run("pause", f"robot-{robot}")
    team.wait_for(rf"takes {task} from {robot} \(silence\)", since=before)
    team.run("unpause", f"robot-{robot}")
    # It would go on with its task, without a word if its presence had ended meanwhile: which robot is where is to be known.
    team.run("restart", "--timeout", "1", f"robot-{robot}")
    until(lambda robot=robot: robot not in team.workers(), f"{robot} is off {task}")

    robot, task, before = alone()
    with team.disconnected(f"robot-{robot}"):
        team.wait_for(rf"takes {task} from {robot} \(silence\)", since=before)

    # Not the one that was taken off the network, whose device has another name now.
    robot = next(one for one in busy() if one != robot)
    with team.slowed(f"robot-{robot}", delay=100, jitter=20, loss=15) as line:
        answers = [team.run("run", "--rm", "--no-TTY", "operator") for _ in range(2)]
    assert all(answer.startswith("Mission two_tasks: running") for answer in answers)
    assert line["packets"] > 20
    assert line["lost"] > 0

    restarts = team.facts("router")["RestartCount"]
    team.strike("router")
    until(lambda: team.restarted("router", restarts), "the router is started again")
    team.run("up", "--detach", "--pull", "never", "--force-recreate", "--no-deps", "router")

    restarts = team.facts("world")["RestartCount"]
    team.strike("world")
    until(lambda: team.restarted("world", restarts), "the world is started again")

    until(lambda: team.attempt("run", "--rm", "--no-TTY", "operator", *HEAL).returncode == 0, "all bodies are healed")
    assert "Mission two_tasks complete" in team.run("run", "--rm", "--no-TTY", "summary")


def heard_again(team: Deployment, robot: str) -> float:
    """Start a robot that was killed; how long it took from then until it was heard, in seconds."""
    first = rf"heard {robot} first at ([\d.]+)"
    before = team.wait_for(first)[1]
    team.run("start", f"robot-{robot}")
    until(lambda: team.wait_for(first)[1] != before, f"{robot} is heard in its next life")
    started = datetime.fromisoformat(team.facts(f"robot-{robot}")["State"]["StartedAt"][:26] + "+00:00").timestamp()
    return float(team.wait_for(first)[1]) - started


def slowness() -> float:
    """How many times more there is to run on this machine just now than it has processors."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
