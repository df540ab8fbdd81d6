"""The engine of real processes: the launcher of `lalliance run`, in a thread with an event loop of its own.

The test's thread only waits, so Ctrl-C and time limits reach it at once. Every process is a child of the launcher's thread, and
the kernel kills it when that thread is gone, whatever pytest dies of; and what should be left all the same when a mission is
closed is found by the endpoint of its bus, and killed.
"""

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.faults import Fault
from mission_control.chaos_client import ask
from mission_control.keeper import LaunchError
from mission_control.launch import Launcher, Plan
from mission_control.temporary import own_folder
from mission_control.watch.happened import Happened
from mission_control.watch.sighting import Sighting
from mission_control.watch.story import Story
from mission_control.watch.words import printable
from world_server.world import TRIAL_PAUSE

#: Real seconds that the start of all processes may take at most, and all that is not mission time at the mission's end.
OVERHEAD = 60.0
#: Real seconds that the launcher may take to end its processes, before they are killed.
ENDING = 10.0
#: Real seconds that the world may take to answer a command.
ANSWER = 15.0

T = TypeVar("T")


class Recorder:
    """A launcher's view that writes down what happens.

    Args:
        mission: the mission's name.
        note: called with each event.
    """

    def __init__(self, mission: str, note: Callable[[Happened], None]) -> None:
        self._note = note
        self._story = Story(mission)
        self._now = 0.0

    def take(self, sighting: Sighting) -> None:
        """Something of the mission was seen on the bus."""
        self._now = sighting.now
        happened = self._story.take(sighting)
        if happened is not None:
            self._note(happened)

    def locate(self, mission: str, endpoint: str) -> None:
        """Where the bus is, is known."""

    def say(self, text: str) -> None:
        """Something happened to a process, or it printed a line."""
        self._note(Happened(self._story.elapsed(self._now), "remark", printable(text)))


class Real:
    """Runs one mission as processes.

    Args:
        path: its file.
        mission: what that says.
        speed: mission seconds per real second.
    """

    def __init__(self, path: Path, mission: Mission, speed: float) -> None:
        self.events: list[Happened] = []
        self.endpoint = free_endpoint()
        self._mission = mission
        self._speed = speed
        self._path = path
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=f"mission {mission.name}", daemon=True)
        self._ready = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._launcher: Launcher | None = None
        self._launching: asyncio.Task[dict[str, Any]] | None = None
        self._told_to_close: asyncio.Event | None = None
        self._summary: dict[str, Any] | None = None
        self._error: Exception | None = None
        self._over = False

    def __repr__(self) -> str:
        return f"<Real {self._mission.name} at {self.endpoint}: {self.ended or 'runs'}>"

    # In the launcher's thread

    def _run(self) -> None:
        try:
            asyncio.run(self._live())
        finally:
            self._ready.set()
            with self._news:
                self._over = True
                self._news.notify_all()

    async def _live(self) -> None:
        """Launch the mission; afterwards the loop goes on for the test, until it closes."""
        with own_folder() as folder:
            await self._launch(Plan.kept_in(folder, self._path, self._mission, speed=self._speed, listen=self.endpoint))

    async def _launch(self, plan: Plan) -> None:
        self._told_to_close = asyncio.Event()
        self._launcher = Launcher(plan, Recorder(self._mission.name, self._note))
        self._launching = asyncio.create_task(self._launcher.run())
        self._loop = asyncio.get_running_loop()
        self._ready.set()
        try:
            self._summary = await self._launching
        except asyncio.CancelledError:
            return
        except Exception as error:
            self._error = error
        with self._news:
            self._over = True
            self._news.notify_all()
        await self._told_to_close.wait()

    def _note(self, event: Happened) -> None:
        with self._news:
            self.events.append(event)
            self._news.notify_all()

    def _tell_to_close(self) -> None:
        if self._launching is not None and self._told_to_close is not None:
            self._launching.cancel()
            self._told_to_close.set()

    # In the test's thread

    def start(self) -> None:
        """Start all processes, until the first trial has begun."""
        self._thread.start()
        if not self._wait(lambda: any(event.kind == "trial" for event in self.events), OVERHEAD):
            raise self._error or LaunchError(f"mission {self._mission.name} did not begin within {OVERHEAD:g} s")

    @property
    def ended(self) -> str | None:
        """How the mission ended, in words; None while it goes on."""
        if not self._over:
            return None
        if self._error is not None:
            return str(self._error)
        return next((event.text for event in reversed(self.events) if event.kind == "end"), "ended")

    def wait(self, found: Callable[[], bool], within: float | None) -> bool:
        """Wait until `found`, or for as long as the whole mission may take."""
        return self._wait(found, self._longest if within is None else within / self._speed)

    def _wait(self, found: Callable[[], bool], seconds: float) -> bool:
        with self._news:
            self._news.wait_for(lambda: found() or self._over, timeout=seconds)
            return found()

    @property
    def _longest(self) -> float:
        """How long the mission may take, in real seconds."""
        trials = sum(phase.trials for phase in self._mission.phases)
        return trials * (self._mission.deadline + TRIAL_PAUSE) / self._speed + OVERHEAD

    def inject(self, fault: Fault, spelled: str, lasts: float | None) -> str:
        """Ask the world to put a fault in force."""
        del fault
        answer = self._do(ask(self._mission.name, self.endpoint, verb="inject", fault=spelled, lasts=lasts))
        return answer.text.partition(":")[0]

    def heal(self, name: str) -> None:
        """Ask the world to end a fault, or all."""
        self._do(ask(self._mission.name, self.endpoint, verb="heal", name=name))

    def faults(self) -> list[dict[str, Any]]:
        """Ask the world what became of each fault; of a mission that is over, its summary tells."""
        if self._summary is not None:
            return list(self._summary["faults"])
        return [dict(one) for one in self._do(ask(self._mission.name, self.endpoint, verb="status")).faults]

    def _do(self, work: Coroutine[Any, Any, T]) -> T:
        """Have `work` done in the launcher's loop."""
        if self._loop is None or self._over:
            work.close()
            raise UserError(f"mission {self._mission.name} does not run any more: {self.ended}")
        try:
            return asyncio.run_coroutine_threadsafe(work, self._loop).result(ANSWER)
        except TimeoutError:
            raise LaunchError(f"mission {self._mission.name} did not answer within {ANSWER:g} s") from None

    def kill(self, what: str) -> None:
        """Kill the router or the world server."""

        async def strike() -> bool:
            part = cast('Literal["router", "world"]', what)
            return self._launcher is not None and self._launcher.kill(part)

        if not self._do(strike()):
            raise UserError(f"the {what} of mission {self._mission.name} does not run just now")

    def conclude(self) -> dict[str, Any]:
        """Wait for the end; the summary."""
        self._wait(lambda: False, self._longest)
        if self._summary is None:
            raise self._error or LaunchError(
                f"mission {self._mission.name} did not end within {self._longest:.0f} s, which is more than its deadline"
            )
        return self._summary

    def violations(self) -> list[str]:
        """Nobody has seen all that happened in all processes, and so nobody can tell more than the summary does."""
        return []

    def close(self) -> None:
        """End all processes, and kill those that do not."""
        try:
            if self._thread.is_alive() and self._ready.wait(ENDING) and self._loop is not None:
                with suppress(RuntimeError):  # its loop has just ended
                    self._loop.call_soon_threadsafe(self._tell_to_close)
                self._thread.join(ENDING)
        finally:
            for pid in processes_of(self.endpoint):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)


def processes_of(endpoint: str) -> Iterator[int]:
    """The living processes of the mission whose bus is at `endpoint`: it is among the arguments of each."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit() and int(folder.name) != os.getpid():
            with suppress(OSError):
                words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
                if "mission_control" in words and endpoint in words:
                    yield int(folder.name)
