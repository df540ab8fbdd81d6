"""What fills the terminal: that it fits, whatever its size and whatever is on the bus."""

import asyncio
import io
import os
import signal

import pytest
from rich.console import Console

from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.clock import MissionClock
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.keys import WORLD, Keys, Kind
from lalliance_agents.wire.messages import Event, Status, encode
from mission_control.live import LiveView, can_redraw
from mission_control.reach import Reached
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story
from mission_control.watch.top import View
from mission_control.watch.why import further

KEYS = Keys("m")


def status(mission: str, robots: int, seq: int = 1) -> Sighting:
    on = {f"robot-{number:02}": {"present": number % 7 != 0, "task": None} for number in range(robots)}
    message = Status(
        sender=WORLD, incarnation=1, seq=seq, at=0.0, mission=mission, trial=1, trials=1, learning="adaptive",  # type: ignore[arg-type]
        elapsed=12.5, tasks={"a": {"complete": True}, "b": {}}, robots=on,  # type: ignore[arg-type]
    )  # fmt: skip
    return Sighting(0, 0.0, KEYS.build(Kind.STATUS), encode(message))


def event(text: str, seq: int) -> Sighting:
    message = Event(sender=WORLD, incarnation=1, seq=seq, at=0.0, kind="warning", elapsed=3.0, trial=1, text=text)
    return Sighting(0, 0.0, KEYS.build(Kind.EVENT), encode(message))


@pytest.mark.virtual_time
@pytest.mark.parametrize(("width", "height", "robots"), [(80, 24, 4), (80, 24, 100), (200, 50, 4), (40, 8, 100)])
async def test_the_view_fits_the_terminal_and_ends_with_its_keys(width: int, height: int, robots: int) -> None:
    story = Story("m")
    for number in range(60):
        story.take(event(f"\x1b[2J\u202e{number}" + "x" * 300, number + 1))
    story.take(status("running", robots))
    console = Console(file=io.StringIO(), width=width, height=height, force_terminal=True, color_system=None)
    async with MemoryBus(MemoryHub()) as bus, Onlooker(bus, "m", MissionClock(), motivations=True) as onlooker:
        view = View(Reached("m", "tcp/127.0.0.1:7447", bus), story, onlooker, console)
        lines = ["".join(segment.text for segment in line) for line in console.render_lines(view.screen(), pad=False)]
    assert len(lines) <= height
    assert all(len(line) <= width and line.isprintable() for line in lines)
    assert lines[0].startswith("m: running, 12.5 s")
    assert lines[1].startswith(
        f"robots {robots - len(range(0, robots, 7))} of {robots} there   tasks 1 of 2"[: width - 1]
    )
    assert lines[2].split()[0] == "robot"
    assert lines[3].startswith(("robot-00", "robot…"))
    assert lines[-1].startswith("by name")
    assert any("3.0 s: ?[2J?59x" in line for line in lines) == (robots == 4)


@pytest.mark.virtual_time
async def test_the_head_of_the_view_says_that_the_bus_is_down() -> None:
    hub, console = MemoryHub(), Console(file=io.StringIO(), width=100, height=24)
    async with MemoryBus(hub) as bus, Onlooker(bus, "m", MissionClock(), motivations=True) as onlooker:
        view = View(Reached("m", "tcp/there:1", bus), Story("m"), onlooker, console)
        hub.go_down()
        await asyncio.sleep(5)
        away = ["".join(segment.text for segment in line) for line in console.render_lines(view.screen())]
        hub.come_back()
        await asyncio.sleep(1)
        back = ["".join(segment.text for segment in line) for line in console.render_lines(view.screen())]
    assert away[0].rstrip() == "m: the bus has not been reached for 5 s at tcp/there:1"
    assert back[0].rstrip() == "m: no world server is heard   tcp/there:1"


@pytest.mark.virtual_time
async def test_who_follows_hears_what_happens_until_the_mission_is_over() -> None:
    hub = MemoryHub()
    async with (
        MemoryBus(hub) as bus,
        MemoryBus(hub) as world,
        Onlooker(bus, "m", MissionClock(), motivations=False) as onlooker,
    ):
        for number, said in enumerate(
            [event("one", 1), status("running", 1), event("two", 2), status("complete", 1, 2)]
        ):
            world.put(said.key, said.payload, ["state", "telemetry"][number % 2])  # type: ignore[arg-type]
        told = [one.text async for one in further(onlooker, Story("m"))]
    assert told == ["one", "two"]


async def test_who_stops_a_run_has_the_terminal_until_it_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    console = Console(file=io.StringIO(), width=80, height=24, force_terminal=True)
    mission = parse_mission("name: m\ntasks: {a: {}}\nrobots: {one: {tasks: {a: 3}}}", "m.yaml")
    over, before = asyncio.Event(), signal.getsignal(signal.SIGTSTP)
    told: list[str] = []

    def shown() -> str:
        text = console.file.getvalue()  # type: ignore[attr-defined]
        console.file = io.StringIO()
        return text

    def kill(process: int, number: int) -> None:
        assert (process, number) == (os.getpid(), signal.SIGTSTP)
        told.append(shown())
        over.set()

    monkeypatch.setattr(os, "kill", kill)
    with LiveView(mission, console):
        shown()
        signal.raise_signal(signal.SIGTSTP)
        async with asyncio.timeout(10):
            await over.wait()
        given_back, taken = told[0], shown()
    assert given_back.endswith("\x1b[?25h\x1b[?1049l")
    assert "\x1b[?1049h" in taken
    assert "\x1b[?25l" in taken
    assert signal.getsignal(signal.SIGTSTP) is before


@pytest.mark.parametrize(("term", "can"), [("xterm", True), ("dumb", False), ("unknown", False)])
def test_a_terminal_that_only_prints_gets_no_view_that_goes_on(
    monkeypatch: pytest.MonkeyPatch, term: str, can: bool
) -> None:
    monkeypatch.setenv("TERM", term)
    assert can_redraw(Console(file=io.StringIO(), force_terminal=True)) == can
    assert not can_redraw(Console(file=io.StringIO()))
