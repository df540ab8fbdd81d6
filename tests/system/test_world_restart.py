"""A world server that is killed with SIGKILL, again and again, as real processes: the mission ends as it does without."""

import asyncio
import json
import os
import random
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from support.processes import Processes, read_until, until

from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.wire.keys import Key, Keys, Kind
from lalliance_agents.wire.messages import Event, Message, Status, TaskState

KILLS = 50

LONG = """
name: long
tasks: {a: {}, b: {after: [a]}, c: {}, d: {arrives: 5}, e: {after: [d]}}
robots:
  one: {tasks: {a: 10, b: 25, c: 30}}
  two: {tasks: {a: 16, b: 20, d: 14, e: 14}}
  three: {tasks: {c: 25, d: 16, e: 16}}
knowledge: given
faults:
  - {at: 2, robot: one, kind: crash, restart: true, until: 4}
  - {at: 6, robot: three, kind: crash, restart: true, until: 8}
deadline: 600
"""

SMALL = """
name: small
tasks: {a: {}, b: {}, c: {}}
robots:
  left: {tasks: {a: 6, b: 9, c: 7}}
  right: {tasks: {a: 9, b: 6, c: 9}}
knowledge: given
"""


class Onlooker:
    """Hears all that the world servers of a mission say."""

    def __init__(self) -> None:
        self.heard: list[tuple[Key, Message]] = []
        self.lives: set[int] = set()
        self.known: set[int] = set()
        self._changed = asyncio.Event()

    def take(self, key: Key, message: Message) -> None:
        self.heard.append((key, message))
        if isinstance(message, Status):
            self.lives.add(message.incarnation)
            self._changed.set()

    async def new_life(self) -> None:
        """Wait until a world server that is not `known` says how the mission stands."""
        async with asyncio.timeout(20.0):
            while not self.lives - self.known:
                self._changed.clear()
                await self._changed.wait()

    def of(self, kind: type[Message]) -> list[Any]:
        return [message for _, message in self.heard if isinstance(message, kind)]


async def onlooker_at(endpoint: str, mission: str) -> tuple[Any, Onlooker]:
    bus = await open_bus(endpoint)
    onlooker, keys = Onlooker(), Keys(mission)
    messenger = Messenger(bus, keys, "onlooker", 1, time.monotonic)
    for kind in (Kind.SENSE_TASK, Kind.EVENT, Kind.STATUS):
        await messenger.listen(keys.build(kind), onlooker.take)
    return bus, onlooker


async def pid_of_new_world(processes: Processes, killed: set[int]) -> int:
    """The process of the world server that is none of `killed`, as soon as there is one."""
    while True:
        for pid in processes.alive("world"):
            if pid not in killed:
                return pid
        await asyncio.sleep(0.05)  # processes that begin give no sign that could be waited for


@pytest.mark.timeout(240)
async def test_a_world_server_killed_at_fifty_random_instants_of_one_mission_changes_nothing(
    processes: Processes,
) -> None:
    endpoint = free_endpoint()
    mission = processes.folder / "long.yaml"
    mission.write_text(LONG)
    run = processes.start("run", mission, "--speed", "4", "--plain", "--json", "--listen", endpoint)
    draw, killed = random.Random(7), set[int]()
    bus, onlooker = await onlooker_at(endpoint, "long")
    async with bus:
        for number in range(KILLS):
            begins = number % 5 == 4
            if not begins:
                await onlooker.new_life()
            world = await pid_of_new_world(processes, killed)
            # Not a wait for anything: this makes the instant a random one, of its life or of its beginning.
            await asyncio.sleep(draw.uniform(0.0, 0.6 if begins else 0.25))
            assert run.poll() is None
            os.kill(world, signal.SIGKILL)
            killed.add(world)
            onlooker.known = set(onlooker.lives)
        out, err = await asyncio.to_thread(run.communicate, timeout=60)
    assert run.returncode == 0, err
    assert err.count("the world server ended (killed by SIGKILL); starting it again") == KILLS
    assert processes.alive() == []
    check(json.loads(out), onlooker)


def check(summary: dict[str, Any], onlooker: Onlooker) -> None:
    """Every task complete once, by who worked on it; every fault fired once; nothing that was told was taken back."""
    assert summary["complete"]
    for facts in summary["tasks"].values():
        instants = [attempt["at"] for attempt in facts["attempts"]]
        assert instants == sorted(instants)
        assert 0.0 < facts["completed_at"] <= summary["makespan"]
        assert all(instant <= facts["completed_at"] for instant in instants)
        assert facts["by"]
        assert {attempt["robot"] for attempt in facts["attempts"]} >= set(facts["by"])
    assert [(fault["fired"], fault["count"], fault["state"]) for fault in summary["faults"]] == [(True, 1, "over")] * 2
    assert len(onlooker.lives) >= KILLS * 4 // 5
    for task in summary["tasks"]:
        told = [m.complete for key, m in onlooker.heard if isinstance(m, TaskState) and key.task == task]
        assert told == sorted(told)
    done = [m.task for m in onlooker.of(Event) if m.kind == "complete" and m.task]
    assert len(set(done)) == len(done)
    elapsed = [m.elapsed for m in onlooker.of(Status)]
    assert elapsed == sorted(elapsed)
    assert len({m.details["number"] for m in onlooker.of(Event) if m.kind == "order"}) == 4


@pytest.fixture
def small(processes: Processes) -> Path:
    path = processes.folder / "small.yaml"
    path.write_text(SMALL)
    return path


def test_a_run_that_was_killed_whole_goes_on_from_its_journal(processes: Processes, small: Path) -> None:
    journal = processes.folder / "journal"
    first = processes.start("run", small, "--speed", "4", "--plain", "--journal", journal)
    read_until(first, "completed by")
    first.kill()
    first.wait()
    until(lambda: processes.alive() == [])
    second = processes.start("run", small, "--speed", "4", "--plain", "--journal", journal)
    out, err = second.communicate(timeout=60)
    assert second.returncode == 0, err
    assert "trial 1 begins" not in out
    assert out.count(" completed by ") <= 2
    assert "Mission small complete" in out
    third = processes.run("run", small, "--plain", "--journal", journal)
    assert third.returncode == 0, third.stderr
    assert third.stdout[third.stdout.index("Mission small complete") :] == out[out.index("Mission small complete") :]
    refused = processes.run("run", small, "--seed", "9", "--journal", journal)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert f"{journal}: this journal began with seed 0, not 9; expected --seed 0" in refused.stderr
    assert processes.alive() == []


def test_a_journal_in_use_is_refused_by_a_second_world_server(processes: Processes, small: Path) -> None:
    journal = processes.folder / "journal"
    run = processes.start("run", small, "--plain", "--journal", journal)
    read_until(run, "left starts")
    second = processes.run("world", small, "--journal", journal, "--connect", free_endpoint())
    assert second.returncode == 2
    assert (
        f"{journal}: another world server has this journal open; expected one world server at a time" in second.stderr
    )
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=10)
    assert processes.alive() == []


def test_the_journal_of_a_run_that_names_none_goes_with_it(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--plain")
    read_until(run, "left starts")
    [own] = processes.temporary.iterdir()
    assert own.stat().st_mode & 0o777 == 0o700
    assert (own / "journal").exists()
    run.send_signal(signal.SIGINT)
    run.communicate(timeout=10)
    assert list(processes.temporary.iterdir()) == []


def test_the_journal_of_a_run_that_was_killed_goes_with_the_next_run(processes: Processes, small: Path) -> None:
    run = processes.start("run", small, "--plain")
    read_until(run, "left starts")
    run.kill()
    run.communicate(timeout=10)
    [left] = processes.temporary.iterdir()
    processes.run("run", small, "--plain", "--connect", free_endpoint())
    assert not left.exists()
    assert list(processes.temporary.iterdir()) == []
