"""Recordings of real missions: nothing is missing in them, and all of it arrives when they are replayed."""

import asyncio
import json
import signal
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap.reader import make_reader
from support.documents import carried_out_by
from support.processes import MISSIONS, Processes, read_until, until

from lalliance_agents.bus.base import Delivery
from lalliance_agents.bus.router import free_endpoint, open_router
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import PRESENCE, Keys, Kind
from lalliance_agents.wire.messages import LinkReport
from mission_control.recording.pace import Pace
from mission_control.recording.player import Player
from mission_control.recording.reader import Recording, information, sightings
from mission_control.watch.explain import tell
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import PRESENCES, Sighting, read
from mission_control.watch.story import Story

DEMO = "material_handling"
KEYS = Keys(DEMO)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, dict[str, Any]]]:
    """The folder in which the documents' commands were carried out, and the summary of the mission.

    Whatever uses it is marked `alone`, so that it is made but once.
    """
    folder = tmp_path_factory.mktemp("demo")
    (folder / "missions").symlink_to(MISSIONS)
    [block] = carried_out_by("system/test_recording.py::test_nothing_that_the_robots_sent_is_missing")
    run, *others = block.commands
    with Processes(folder) as processes:
        summary = processes.run_json(*run)
        for command in others:
            done = processes.run(*command)
            assert done.returncode == 0, done.stderr
            assert done.stderr == ""
        yield folder, summary


def is_presence(sighting: Sighting) -> bool:
    return KEYS.parse(sighting.key).kind in PRESENCES


@pytest.mark.alone
def test_nothing_that_the_robots_sent_is_missing(demo: tuple[Path, dict[str, Any]]) -> None:
    folder, summary = demo
    counts: Counter[str] = Counter()
    numbers: dict[str, list[int]] = defaultdict(list)
    reports: dict[str, LinkReport] = {}
    told: dict[str, list[int]] = defaultdict(lambda: [0])
    for sighting in sightings(folder / "demo.mcap"):
        key, message = read(sighting, KEYS)
        if message is None:
            continue
        counts[message.sender] += key.kind is not Kind.MOTIVATION  # which is not counted as sent
        if key.kind in PRESENCE:
            numbers[message.sender].append(message.seq)
        if isinstance(message, LinkReport):
            reports[message.sender] = message
            told[message.sender].append(message.sent)
    # Who was killed could not report at its end; all announcements are numbered.
    assert {robot: report.sent + 1 for robot, report in reports.items() if report.final} == {
        robot: counts[robot] for robot in ("carrier", "forklift", "pusher")
    }
    assert numbers == {robot: [*range(1, len(found) + 1)] for robot, found in numbers.items()}
    assert set(numbers) == {"carrier", "forklift", "lifter", "pusher"}
    # A last report, of who is killed or when all is over, may reach the recorder and not the world's count.
    latest, before = (sum(sent[number] for sent in told.values()) for number in (-1, -2))
    assert before <= summary["messages"]["sent"] <= latest
    assert information(folder / "demo.mcap").ending == ("the mission is over", 0)


@pytest.mark.alone
async def test_all_of_it_arrives_in_order_when_it_is_replayed_and_says_the_same(
    demo: tuple[Path, dict[str, Any]],
) -> None:
    folder, _ = demo
    path = folder / "demo.mcap"
    recorded = list(sightings(path))
    endpoint = free_endpoint()
    arrived: list[Sighting] = []
    async with (
        await open_router(endpoint),
        await open_bus(endpoint) as bus,
        await open_bus(endpoint) as witness,
        await open_bus(endpoint) as other,
    ):
        async with Onlooker(other, DEMO, MissionClock(), motivations=True) as onlooker:
            played = await Player(Recording(path), bus, witness, Pace(20.0)).play()
            async with asyncio.timeout(10):
                while len(arrived) < len(recorded):
                    arrived.append(await anext(onlooker))
        assert onlooker.dropped == 0
    assert played.all == played.presences + played.published == len(recorded)
    assert (played.arrived, played.lost) == (played.published, 0)
    for wanted in (True, False):
        there, here = ([one for one in all_of_it if is_presence(one) is wanted] for all_of_it in (recorded, arrived))
        assert [(one.key, one.payload, one.gone) for one in here] == [(one.key, one.payload, one.gone) for one in there]
    stories = [Story(DEMO), Story(DEMO)]
    for story, all_of_it in zip(stories, (recorded, arrived), strict=True):
        for one in all_of_it:
            story.take(one)
    before, after = ([tell(one) for one in story.happened if one.made is not None] for story in stories)
    assert before == after
    assert any("carrier took crate-2" in sentence and "lifter silent" in sentence for sentence in before)


def test_a_replay_is_found_like_a_mission_and_tells_what_was_before_its_start(
    demo: tuple[Path, dict[str, Any]], processes: Processes
) -> None:
    folder, _ = demo
    playing = processes.start("replay", folder / "demo.mcap", "--rate", "0.1", "--start", "6")
    read_until(playing, "replaying mission material_handling")
    there, from_file = (processes.run("why", *words) for words in ([], ["--bag", folder / "demo.mcap", "--to", "17"]))
    assert (there.returncode, there.stderr) == (0, "")
    told = [line for line in from_file.stdout.splitlines() if line.startswith("carrier took crate-2")]
    assert len(told) == 1
    assert told[0] in there.stdout.splitlines()
    playing.send_signal(signal.SIGINT)
    playing.communicate(timeout=30)


@pytest.mark.alone
def test_what_was_converted_is_as_its_schemas_say(demo: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = demo
    found = information(folder / "demo.mcap")
    counts: Counter[str] = Counter()
    checks: dict[int, jsonschema.Draft202012Validator] = {}
    with (folder / "demo-json.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            if schema.id not in checks:
                checks[schema.id] = jsonschema.Draft202012Validator(json.loads(schema.data))
            checks[schema.id].validate(json.loads(message.data))
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            counts[channel.topic] += 1
    assert counts == found.counts


LONG = "name: long\ntasks: {a: {}}\nrobots: {r1: {tasks: {a: 100}}}\n"
HEARTBEAT = Keys("long").build(Kind.HEARTBEAT, robot="r1")


async def chatter(bus: Any) -> None:
    """Say a number every few milliseconds."""
    for number in range(10**6):
        bus.put(HEARTBEAT, b"%d" % number, Delivery.STATE)
        await asyncio.sleep(0.005)


def numbers(path: Path) -> list[int]:
    return [int(one.payload) for one in sightings(path) if one.payload]


@pytest.mark.alone
async def test_a_recorder_that_is_killed_leaves_a_file_that_lacks_less_than_a_second(processes: Processes) -> None:
    (processes.folder / "long.yaml").write_text(LONG)
    endpoint, path = free_endpoint(), processes.folder / "killed.mcap"
    async with await open_router(endpoint), await open_bus(endpoint) as bus:
        recorder = processes.start("record", "long.yaml", "--connect", endpoint, "--out", path)
        await asyncio.to_thread(read_until, recorder, "recording mission long")
        chatting = asyncio.create_task(chatter(bus))
        await asyncio.to_thread(until, lambda: path.stat().st_size > 3000 and len(numbers(path)) > 300)
        recorder.send_signal(signal.SIGKILL)
        killed_at = time.time_ns()
        recorder.wait()
        chatting.cancel()
    told: list[str] = []
    last = max(one.seen_at for one in sightings(path, told.append))
    assert killed_at - last < 1_000_000_000
    first = numbers(path)[0]
    assert numbers(path) == [*range(first, first + len(numbers(path)))]
    assert told == [
        f"{path}: it ends at byte {path.stat().st_size:,} without having been closed; all that stands before was read"
    ]
    shown = processes.run("bag", "info", path)
    assert (shown.returncode, "not whole" in shown.stdout) == (0, True)
    assert shown.stderr == f"lalliance: warning: {told[0]}\n"


async def test_ctrl_c_ends_a_recording_which_says_what_is_in_it(processes: Processes) -> None:
    (processes.folder / "long.yaml").write_text(LONG)
    endpoint, path = free_endpoint(), processes.folder / "ended.mcap"
    async with await open_router(endpoint), await open_bus(endpoint) as bus:
        recorder = processes.start("record", "long.yaml", "--connect", endpoint, "--out", path)
        await asyncio.to_thread(read_until, recorder, "recording mission long")
        # Also a single message is with the system before long.
        bus.put(HEARTBEAT, b"1", Delivery.STATE)
        await asyncio.to_thread(until, lambda: numbers(path) == [1])
        recorder.send_signal(signal.SIGINT)
        out, err = await asyncio.to_thread(recorder.communicate, timeout=30)
    assert (recorder.returncode, err) == (0, "")
    assert out == f"the recorder was told to end: 1 message on 1 key recorded in {path}; nothing was dropped\n"
    assert information(path).complete


def test_bad_input_is_a_sentence(processes: Processes, tmp_path: Path) -> None:
    (tmp_path / "long.yaml").write_text(LONG)
    (tmp_path / "a.mcap").write_text("precious")
    expected = "expected what `lalliance record` or `lalliance run --record` writes"
    taken = "there is something already; expected a new file, as nothing is overwritten"
    for command, sentence in (
        (["replay", "a.mcap"], f"a.mcap: not an MCAP file; {expected}"),
        (["run", "long.yaml", "--record", "a.mcap"], f"a.mcap: {taken}"),
    ):
        done = processes.run(*command)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", f"lalliance: {sentence}\n")
    assert (tmp_path / "a.mcap").read_text() == "precious"
    done = processes.run("record", "long.yaml", "--out", "b.mcap", "--connect", "tcp/127.0.0.1:9")
    assert (done.returncode, (tmp_path / "b.mcap").exists()) == (2, False)
    assert "mission long cannot be reached" in done.stderr
