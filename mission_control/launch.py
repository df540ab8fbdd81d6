"""Run a mission on this machine: a router, a world server and the robots, each in a process of its own or several in one.

The launcher starts the processes, has the world's orders carried out at them, starts its router and its world server again if
they die, shows what happens, and leaves no process behind. It takes no part in the mission: robots and world talk to one
another alone.
"""

import asyncio
import contextlib
import logging
import signal
from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from lalliance_agents.bus.base import Bus
from lalliance_agents.bus.credentials import Credentials, credentials_in
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.router import free_endpoint
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.clock import MissionClock
from lalliance_agents.config import Mission
from lalliance_agents.errors import BusError, MessageError, UserError
from lalliance_agents.wire.keys import LAUNCHER, OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import Event, Message, Status
from mission_control.hosting import shares
from mission_control.keeper import Keeper, LaunchError, View
from mission_control.orders import Orders
from mission_control.processes import GRACE, Child
from mission_control.running import announced
from mission_control.watch.onlooker import Onlooker
from world_server.history import recall
from world_server.world import Stage, World

if TYPE_CHECKING:
    from mission_control.dashboard.beside import Page
    from mission_control.recording.writer import RecordingWriter

_log = logging.getLogger(__name__)

#: What is shown of a mission.
SHOWN = (Kind.EVENT, Kind.STATUS, Kind.DECISION, Kind.MOTIVATION, Kind.CHAOS_RULES)
#: How long the router may take to listen, in seconds.
ROUTER_TIMEOUT = 8.0
#: How long the world server may take to end after the last robot did, in seconds.
LAST_CHANCE = 5.0
#: How long the router may take to end, when nobody needs it any more, in seconds.
ROUTER_GRACE = 0.3
#: How often a router that dies is started again.
ROUTER_RESTARTS = 20
#: How long the world server of a mission that goes on waits for the robots that are started with it, in real seconds.
RETURN_PATIENCE = 30.0


@dataclass(frozen=True, slots=True)
class Beginning:
    """Where a mission begins that may have come some way before.

    Attributes:
        first: the robots to start at once.
        lost: those that a fault has killed.
        may_return: those of them that may be started again: by the mission, or when an operator heals what they died of.
        lives: the latest incarnation of each robot that was there before.
        goes_on: whether the mission has begun already.
    """

    first: tuple[str, ...]
    lost: frozenset[str] = frozenset()
    may_return: frozenset[str] = frozenset()
    lives: dict[str, int] = field(default_factory=dict)
    goes_on: bool = False

    @classmethod
    def of(cls, world: World) -> "Beginning":
        """Where a mission is whose world stands as `world` does; one that is over needs no robot."""
        failures = world.failures
        killed, joining = failures.killed(), failures.joining()
        first = [] if world.over else [robot for robot in world.bodies if robot not in killed | joining]
        return cls(
            first=tuple(first),
            lost=frozenset(killed),
            may_return=frozenset(killed - failures.killed_for_good()),
            lives=world.ledger.lives(),
            goes_on=world.stage is not Stage.WAITING,
        )


@dataclass(frozen=True, slots=True)
class Plan:
    """What to launch, and how.

    Attributes:
        path: the mission file, handed to every process.
        mission: what it says.
        journal: the world server's journal.
        beginning: where the mission is.
        speed: mission seconds per real second.
        connect: the endpoint of a router that runs already; None: start one.
        listen: where a router of our own listens; None: a free port on this machine.
        learned: the folder of learned times; None: nothing is stored.
        keys: the folder of the team's keys, which have been checked; None: the bus asks for none.
        processes: how many processes the robots share; None: each has one of its own.
    """

    path: Path
    mission: Mission
    journal: Path
    beginning: Beginning
    speed: float = 1.0
    connect: str | None = None
    listen: str | None = None
    learned: Path | None = None
    keys: Path | None = None
    processes: int | None = None

    @classmethod
    def kept_in(cls, folder: Path, path: Path, mission: Mission, **options: Any) -> "Plan":
        """A plan whose world server's journal is new, in `folder`."""
        journal = folder / "journal"
        return cls(path.resolve(), mission, journal, Beginning.of(recall(journal, mission)), **options)

    def endpoint(self) -> str:
        """Where the mission's router is, or is to be."""
        asked = self.listen if self.connect is None else self.connect
        return free_endpoint("tcp" if self.keys is None else "tls") if asked is None else asked

    def shown(self) -> list[str]:
        """Arguments of every process, with which it shows who it is."""
        return [] if self.keys is None else ["--keys", str(self.keys)]

    def router(self, endpoint: str) -> list[str]:
        """Arguments of the router's process."""
        return ["router", "--listen", endpoint, *self.shown()]

    def common(self, endpoint: str) -> list[str]:
        """Arguments of every process of the mission but the router's."""
        return ["--connect", endpoint, "--speed", repr(self.speed), "--seed", str(self.mission.seed), *self.shown()]

    def robots(self, lives: Mapping[str, int], endpoint: str) -> list[str]:
        """Arguments of the process of a robot, or of several, each in one of its lives."""
        names = [word for name in lives for word in ("--name", name)]
        kept = [word for life in lives.values() for word in ("--incarnation", str(life))]
        if self.learned is not None:
            kept = ["--learned", str(self.learned)]
        return ["robot", str(self.path), *names, *self.common(endpoint), *kept]

    def world(self, endpoint: str) -> list[str]:
        """Arguments of the world server's process."""
        return ["world", str(self.path), "--json", "--journal", str(self.journal), *self.common(endpoint)]

    def first_world(self) -> list[str]:
        """Further arguments of the world server's first process."""
        return ["--returning", repr(RETURN_PATIENCE)] if self.beginning.goes_on else []


class Launcher:
    """Runs one mission.

    Args:
        plan: what to launch.
        view: where to show what happens.
        writer: the recording of all that is said, if there is to be one.
        page: the web page that is to be opened, if any; whoever hands it in closes it.
    """

    def __init__(
        self, plan: Plan, view: View, writer: "RecordingWriter | None" = None, page: "Page | None" = None
    ) -> None:
        self._plan = plan
        self._view = view
        self._writer = writer
        self._page = page
        self._keys = Keys(plan.mission.name)
        self._clock = MissionClock(plan.speed)
        self._endpoint = plan.endpoint()
        self._router: Child | None = None
        self._robots: dict[str, Child] = {}
        self._lives = dict(plan.beginning.lives)
        self._world = Keeper(plan.world(self._endpoint), plan.first_world(), view, self._on_line)
        self._messenger: Messenger | None = None
        # What strikes a process that several share would strike all of them: nobody here makes that.
        reached = {} if plan.processes else self._robots
        self._orders = Orders(plan.mission, reached, self._restart, self._report)
        self._orders.may_return |= plan.beginning.may_return
        self._tasks: set[asyncio.Task[None]] = set()
        self._robot_ended = asyncio.Event()
        #: What a robot could not use of what it was given, if any could not.
        self._refusal: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    async def run(self) -> dict[str, Any]:
        """Run the mission to its end; its summary.

        Raises:
            BusError: no router could be started or reached.
            LaunchError: the mission could not be brought to its end.
            UserError: the world server or a robot was given something that it cannot use.
        """
        try:
            if self._plan.connect is None:
                await self._start_router()
            name = self._plan.mission.name
            keys = self._plan.keys
            shown = None if keys is None else credentials_in(keys, OPERATOR)
            async with self._recording(shown), await open_bus(self._endpoint, credentials=shown) as bus:
                with announced(name, self._endpoint):
                    self._view.locate(name, self._endpoint)
                    if self._page is not None:
                        await self._page.open(self._endpoint)
                    return await self._conduct(bus)
        finally:
            await self._end_all()

    def kill(self, what: Literal["router", "world"]) -> bool:
        """Kill the router or the world server as an accident would (SIGKILL); whether there was one."""
        child = self._router if what == "router" else self._world.child
        if child is None or not child.running:
            return False
        child.send_signal(signal.SIGKILL)
        return True

    @contextlib.asynccontextmanager
    async def _recording(self, shown: Credentials | None) -> AsyncIterator[None]:
        """Have everything recorded, from before anybody is there until after all have gone."""
        if self._writer is None:
            yield
            return
        from mission_control.recording.recorder import recording, told  # noqa: PLC0415 - needs an extra

        recorded = recording(
            self._writer,
            self._plan.mission,
            self._endpoint,
            credentials=shown,
            clock=self._clock,
            say=self._view.say,
        )
        try:
            async with recorded:
                yield
        finally:
            self._view.say(told(self._writer))

    async def _conduct(self, bus: Bus) -> dict[str, Any]:
        messenger = await self._watch(bus)
        async with self._shown(bus):
            await self._world.start()
            await asyncio.gather(*map(self._start_robots, shares(self._plan.beginning.first, self._plan.processes)))
            summary = await self._await_end()
            await self._await_robots()
        await messenger.close()
        return summary

    @contextlib.asynccontextmanager
    async def _shown(self, bus: Bus) -> AsyncIterator[None]:
        """Have the view show what happens, also what was not heard while the router was away, until it is up to date."""
        onlooker = Onlooker(bus, self._plan.mission.name, self._clock, kinds=SHOWN)
        async with contextlib.AsyncExitStack() as last, onlooker:
            last.push_async_callback(asyncio.gather, asyncio.create_task(self._show(onlooker)))
            yield

    async def _show(self, onlooker: Onlooker) -> None:
        async for sighting in onlooker:
            try:
                if self._keys.parse(sighting.key).robot in {None, *self._plan.mission.robots}:
                    self._view.take(sighting)
            except MessageError:  # a key that somebody made up
                pass
            except Exception:
                _log.exception("what was seen on %s could not be shown", sighting.key)

    async def _watch(self, bus: Bus) -> Messenger:
        keys = self._keys
        messenger = self._messenger = Messenger(bus, keys, LAUNCHER, 1, self._clock.now)
        for kind in (Kind.EVENT, Kind.STATUS):
            await messenger.listen(keys.build(kind), self._take)
        if not self._plan.processes:
            await bus.announce_presence(keys.build(Kind.LAUNCHER))
        return messenger

    def _take(self, _: Key, message: Message) -> None:
        if isinstance(message, Event) and message.kind == "order":
            self._orders.take(message)
        elif isinstance(message, Status):
            self._world.heard(message)

    def _restart(self, robot: str) -> None:
        self._spawn(self._start_robots([robot]))

    def _report(self, order: int) -> None:
        if self._messenger is not None:
            self._messenger.send(Kind.CHAOS_DEED, number=order)

    def _spawn(self, work: Any) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _start_robots(self, names: Sequence[str]) -> None:
        """Start robots, in a process that is theirs."""
        lives = {name: self._lives.get(name, 0) + 1 for name in names}
        self._lives |= lives
        called = names[0] if len(names) == 1 else f"{names[0]}..{names[-1]}"
        child = await Child.start(called, self._plan.robots(lives, self._endpoint), self._on_line)
        for name in names:
            self._robots[name] = child
            self._orders.returned(name)
        self._spawn(self._observe(child))

    async def _observe(self, child: Child) -> None:
        code = await child.wait()
        if code == 2 and not self._refusal.done():
            self._refusal.set_result(f"robot {child.name}: {child.last_line.removeprefix('lalliance: ')}")
        if code not in {0, 1}:
            self._view.say(f"robot {child.name} ended: {child.status}")
        self._robot_ended.set()

    def _on_line(self, name: str, line: str) -> None:
        self._view.say(f"[{name}] {line}")

    async def _start_router(self) -> None:
        arguments = self._plan.router(self._endpoint)
        child = await Child.start("router", arguments, lambda _name, _line: None, keeps_output=True)
        self._router = child
        try:
            async with asyncio.timeout(ROUTER_TIMEOUT):
                ready = await child.read_line()
        except TimeoutError:
            raise BusError(
                f"The router at {self._endpoint} did not begin to listen within {ROUTER_TIMEOUT:g} s."
            ) from None
        if not ready:
            await child.wait()
            raise BusError(child.last_line.removeprefix("lalliance: ") or f"The router ended with {child.status}.")
        self._spawn(self._keep_router(child))

    async def _keep_router(self, child: Child) -> None:
        """Start the router again when it dies; clients come back by themselves."""
        for _ in range(ROUTER_RESTARTS):
            await child.wait()
            self._view.say(f"the router ended ({child.status}); starting it again")
            arguments = self._plan.router(self._endpoint)
            child = self._router = await Child.start("router", arguments, self._on_line, keeps_output=True)
            await child.read_line()
        await child.wait()
        self._view.say(f"the router ended ({child.status}), too often to be started again")

    async def _await_end(self) -> dict[str, Any]:
        """The summary of the world server, or an error as soon as nobody is left to complete the mission, or one cannot."""
        ending = asyncio.create_task(self._world.summary())
        deserted = asyncio.create_task(self._await_desertion())
        try:
            while not ending.done():
                ends: set[asyncio.Future[Any]] = {ending, deserted, self._refusal}
                await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
                if self._refusal.done() and not ending.done():
                    raise UserError(self._refusal.result())
                if not ending.done():
                    await asyncio.wait({ending}, timeout=LAST_CHANCE)
                if not ending.done() and self._is_deserted():
                    told = ", ".join(f"{name}: {child.status}" for name, child in self._robots.items())
                    raise LaunchError(f"no robot is left to complete the mission ({told})")
                if deserted.done():  # and a robot has come back since
                    deserted = asyncio.create_task(self._await_desertion())
            return ending.result()
        finally:
            ending.cancel()
            deserted.cancel()

    async def _await_desertion(self) -> None:
        while not self._is_deserted():
            await self._robot_ended.wait()
            self._robot_ended.clear()

    def _is_deserted(self) -> bool:
        """Whether every robot has been there, has ended, and will not return; one that is stopped is still there."""
        all_came = self._robots.keys() | self._plan.beginning.lost == self._plan.mission.robots.keys()
        return all_came and not self._orders.may_return and not any(child.running for child in self._robots.values())

    async def _await_robots(self) -> None:
        """Robots end by themselves when the mission is over, but for those that are stopped."""
        going = [child.wait() for child in set(self._robots.values()) if not child.stopped]
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(2 * GRACE):
                await asyncio.gather(*going)

    async def _end_all(self) -> None:
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(self._world.end(), *(child.end() for child in set(self._robots.values())))
        if self._router is not None:
            await self._router.end(grace=ROUTER_GRACE)
