"""The world server: the asyncio shell around the world's core.

It hears the robots' actions, decisions and counters and sees their presence, lets the world advance a few times a second, and
publishes what changed: task states as sensory feedback, each body's state, events, and how the mission stands. What robots
need to know is refreshed once a second and answered on query, so that a late or reconnected robot is not at a loss.

With a journal, a server that was killed at any instant is followed by one that goes on where it ended: mission time stood
still meanwhile. Nothing is told, to robots or to operators, before the journal holds what it follows from.
"""

import asyncio
import contextlib
import logging
from collections import deque
from typing import Any

from lalliance_agents.bus.base import Bus, Registration, Sample
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.patterns import matches
from lalliance_agents.clock import MissionClock
from lalliance_agents.config import Mission
from lalliance_agents.errors import MessageError, UserError
from lalliance_agents.wire.keys import LAUNCHER, WORLD, Key, Keys, Kind
from lalliance_agents.wire.messages import LONGEST_LINE, Action, DecisionMade, DeedDone, LinkReport, Message
from world_server.chaos import ChaosDesk
from world_server.environments.base import TaskView
from world_server.failures import Order
from world_server.history import MOST_PAST, History
from world_server.journal import Journal
from world_server.paces import Paces
from world_server.world import REFRESH_PERIOD, STEP, Happening

_log = logging.getLogger(__name__)

#: Least time between two steps, in real seconds.
LEAST_STEP = 0.01
#: How long to listen at the start for another world server of the mission, in real seconds.
RIVAL_TIMEOUT = 0.5
STATUS_PERIOD = 0.25
#: How long a server that goes on where another ended waits for the robots that were there then, in real seconds.
RETURN_TIMEOUT = 2.0
#: How long the world stays at the end for the robots' last reports, in real seconds.
LINGER = 2.0


class WorldServer:
    """Serves one mission.

    Args:
        mission: a mission that passed `environments.check_options`.
        bus: an open bus; the server does not close it.
        incarnation: larger than that of any world server before it in this mission.
        speed: mission seconds per real second.
        patience: how long to wait for the whole team before beginning with a part of it, in real seconds.
        journal: where the mission is to be found again; None: nowhere. The server does not close it.
        returning: how long to wait for the robots that were there according to the journal, in real seconds.

    Raises:
        UserError: the journal is damaged.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        bus: Bus,
        incarnation: int,
        speed: float = 1.0,
        patience: float = 30.0,
        journal: Journal | None = None,
        returning: float = RETURN_TIMEOUT,
    ) -> None:
        self._mission = mission
        self._bus = bus
        self._speed = speed
        self._patience = patience
        self._returning = returning
        self._clock: MissionClock | None = None
        self._keys = Keys(mission.name)
        self._history = History(mission, journal, self._tell)
        self._world = self._history.world
        self._untold: list[tuple[int, Happening]] = []
        self._events: deque[Sample] = deque(maxlen=MOST_PAST)
        self._awaited = set(self._world.bodies.there())
        if self._world.has_launcher:
            self._awaited.add(LAUNCHER)
        self._all_back = asyncio.Event()
        if journal is not None:
            incarnation = journal.next_incarnation(incarnation)
        self._messenger = Messenger(bus, self._keys, WORLD, incarnation, self._now, mission.robots)
        self._world.ledger.dropped_here = self._messenger.dropped_of
        for trial, one in self._history.past:
            self._events.append(self._messenger.sample(Kind.EVENT, **_telling(one, trial)))
        self._desk = ChaosDesk(self._history, self._messenger, self._now, self._settle)
        self._told_rules: dict[str, Any] = {}
        self._published: dict[str, tuple[int, TaskView]] = {}
        self._told_stage: tuple[str, int] | None = None
        self._refresh_due = self._status_due = 0.0
        self._ordered: dict[int, float] = {}
        self._paces = Paces(speed)

    async def run(self) -> dict[str, Any]:
        """Serve until the mission is over; its summary.

        Raises:
            UserError: another world server serves this mission, or the journal cannot be written any more.
        """
        registrations: list[Registration] = []
        try:
            await self._open()
            alive, launcher, command = map(self._keys.build, (Kind.ALIVE, Kind.LAUNCHER, Kind.CHAOS_COMMAND))
            registrations.append(await self._bus.watch_presence(alive, self._see))
            registrations.append(await self._bus.watch_presence(launcher, self._see))
            await self._await_return()
            registrations.append(await self._bus.answer(command, self._desk.answer))
            clock = self._clock = MissionClock(self._speed, since=self._history.now)
            give_up_waiting = self._now() + self._patience * self._speed
            while not self._world.over:
                now = self._now()
                self._step(now, give_up_waiting)
                await clock.sleep_until(now + max(STEP, LEAST_STEP * self._speed))
            await self._say_farewell()
            return self._world.summary()
        finally:
            for registration in registrations:
                await registration.close()
            await self._messenger.close()

    async def _open(self) -> None:
        keys, messenger = self._keys, self._messenger
        if await self._bus.query(keys.build(Kind.SENSE_TASK), timeout=RIVAL_TIMEOUT):
            raise UserError(
                f"another world server serves mission {self._mission.name} on this bus already; expected to be the only one"
            )
        await messenger.offer(keys.build(Kind.SENSE_TASK), self._answer_tasks)
        await messenger.offer(keys.build(Kind.SENSE_ROBOT), self._answer_bodies)
        await messenger.offer(keys.build(Kind.CHAOS_RULES), self._answer_rules)
        await messenger.offer(keys.build(Kind.EVENT), lambda _: list(self._events))
        await messenger.offer(keys.build(Kind.DECISION), self._answer_decisions)
        for kind in (Kind.ACTION, Kind.DECISION, Kind.LINK, Kind.CHAOS_DEED):
            await messenger.listen(keys.build(kind), self._receive)

    def _now(self) -> float:
        """Mission time, in seconds; until all are back who were there when another server ended, it stands still."""
        return self._history.now if self._clock is None else self._clock.now()

    async def _await_return(self) -> None:
        """Wait for those who were there according to the journal; who does not come back in time is gone."""
        if self._awaited:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(self._returning):
                    await self._all_back.wait()
        for name in sorted(self._awaited):
            self._take_presence(name, False)

    def _step(self, now: float, give_up_waiting: float) -> None:
        if not self._world.missing() or (now >= give_up_waiting and self._world.some_there()):
            self._history.begin(now)
        # Between two changes the world need not be moved more often than somebody looks at its progress.
        if now >= min(self._history.next_change, self._refresh_due, self._status_due):
            self._history.advance(now)
        self._publish(now)

    async def _say_farewell(self) -> None:
        """Tell everybody that the mission is over until all have reported for the last time, or the limit has passed."""
        loop = asyncio.get_running_loop()
        until = loop.time() + LINGER
        while loop.time() < until and not self._all_reported():
            self._publish_all(self._now())
            await asyncio.sleep(0.1)
        self._publish_all(self._now())

    def _all_reported(self) -> bool:
        return all(self._world.ledger.has_final(robot) for robot in self._world.bodies.there())

    def _see(self, key: str, present: bool) -> None:
        try:
            parsed = self._keys.parse(key)
        except MessageError as error:
            self._messenger.drop(error.reason, "an unknown key", str(error))
            return
        if parsed.kind is Kind.LAUNCHER:
            self._take_presence(LAUNCHER, present)
        elif parsed.kind is Kind.ALIVE and parsed.robot is not None:
            self._take_presence(parsed.robot, present)

    def _take_presence(self, name: str, present: bool) -> None:
        if name == LAUNCHER:
            self._history.launcher(present, self._now())
        else:
            self._history.presence(name, present, self._now())
        self._awaited.discard(name)
        if not self._awaited:
            self._all_back.set()

    def _receive(self, _: Key, message: Message) -> None:
        if message.sender not in {LAUNCHER, *self._world.bodies}:
            self._messenger.drop("stranger", message.sender)
            return
        self._look_at_clock(message)
        match message:
            case DeedDone():
                self._history.done(message, self._now())
            case Action():
                self._history.act(message, self._now())
            case DecisionMade():
                self._history.decided(message, self._now())
            case LinkReport():
                self._history.reported(message, self._now())

    def _look_at_clock(self, message: Message) -> None:
        """Warn of a robot whose time does not pass as the world's does; while that stands still nothing can be seen."""
        if self._clock is None or message.sender == LAUNCHER:
            return
        pace = self._paces.different(message, self._now())
        if pace is not None:
            text = (
                f"the clock of {message.sender} runs {pace:.3g} times as fast as the world's; "
                f"expected all processes to be started with the same --speed, {self._speed:g}"
            )
            self._tell(Happening("warning", text, self._world.elapsed, message.sender))

    def _tell(self, happening: Happening) -> None:
        self._untold.append((self._world.trial, happening))

    def _settle(self) -> None:
        """Commit what went into the world, then tell what came of it."""
        self._history.commit()
        untold, self._untold = self._untold, []
        for trial, one in untold:
            _log.info("%7.1f s  %s", one.elapsed, one.text)
            self._events.append(self._messenger.send(Kind.EVENT, **_telling(one, trial)))
        if self._rules() != self._told_rules:
            self._publish_rules()

    def _order(self, order: Order, now: float) -> None:
        """Ask whoever holds the processes; again each second, until it is seen to be done."""
        if now - self._ordered.get(order.number, -REFRESH_PERIOD) >= REFRESH_PERIOD:
            self._ordered[order.number] = now
            text = f"{order.deed} {order.robot}: {order.because}"
            deed = {"deed": order.deed.value, "number": order.number}
            one = Happening("order", text, self._world.elapsed, order.robot, details=deed)
            self._messenger.send(Kind.EVENT, **_telling(one, self._world.trial))

    def _publish(self, now: float) -> None:
        self._settle()
        for order in self._world.orders():
            self._order(order, now)
        stage = (self._world.stage.value, self._world.trial)
        if now >= self._refresh_due or stage != self._told_stage:
            self._told_stage = stage
            self._refresh_due = now + REFRESH_PERIOD
            self._publish_all(now)
            return
        for task, view in self._world.tasks().items():
            before = self._published.get(task)
            if before is None or (before[1].complete, before[1].applicable) != (view.complete, view.applicable):
                self._publish_task(task, view)
        if now >= self._status_due:
            self._publish_status(now)

    def _publish_all(self, now: float) -> None:
        self._settle()
        self._publish_rules()
        for robot in self._world.bodies:
            self._messenger.send(Kind.SENSE_ROBOT, key_robot=robot, **self._body_fields())
        for task, view in self._world.tasks().items():
            self._publish_task(task, view)
        self._publish_status(now)

    def _publish_rules(self) -> None:
        self._told_rules = self._rules()
        self._messenger.send(Kind.CHAOS_RULES, **self._told_rules)

    def _rules(self) -> dict[str, Any]:
        return {"seed": self._mission.seed, "rules": self._world.rules(), "blind": self._world.blind()}

    def _publish_task(self, task: str, view: TaskView) -> None:
        self._published[task] = (self._world.trial, view)
        self._messenger.send(Kind.SENSE_TASK, key_task=task, **self._task_fields(view))

    def _publish_status(self, now: float) -> None:
        self._status_due = now + STATUS_PERIOD
        world = self._world
        tasks = world.tasks()
        self._messenger.send(
            Kind.STATUS,
            mission=world.stage.value,
            trial=world.trial,
            trials=world.trials_planned,
            learning=world.learning,
            elapsed=max(world.elapsed, 0.0),
            tasks={
                task: {"complete": view.complete, "applicable": view.applicable, "progress": _share(view.progress)}
                for task, view in tasks.items()
            },
            robots={robot: {"present": body.present, "task": body.task} for robot, body in world.bodies.items()},
        )

    def _task_fields(self, view: TaskView) -> dict[str, Any]:
        return {
            "trial": self._world.trial,
            "learning": self._world.learning,
            "applicable": view.applicable,
            "complete": view.complete,
            "progress": _share(view.progress),
        }

    def _body_fields(self) -> dict[str, Any]:
        world = self._world
        elapsed = max(self._now() - world.began, 0.0) if world.trial else 0.0
        return {"mission": world.stage.value, "trial": world.trial, "learning": world.learning, "elapsed": elapsed}

    def _answer_rules(self, _: str) -> list[Sample]:
        self._settle()
        key = self._keys.build(Kind.CHAOS_RULES)
        return [Sample(key, self._messenger.compose(Kind.CHAOS_RULES, **self._rules()))]

    def _answer_tasks(self, query: str) -> list[Sample]:
        now = self._now()
        if now >= self._history.moved + STEP:
            self._history.advance(now)
        self._settle()
        keys = {self._keys.build(Kind.SENSE_TASK, task=task): view for task, view in self._world.tasks().items()}
        return [
            Sample(key, self._messenger.compose(Kind.SENSE_TASK, **self._task_fields(view)))
            for key, view in keys.items()
            if matches(query, key)
        ]

    def _answer_bodies(self, query: str) -> list[Sample]:
        self._settle()
        keys = [self._keys.build(Kind.SENSE_ROBOT, robot=robot) for robot in self._world.bodies]
        return [
            Sample(key, self._messenger.compose(Kind.SENSE_ROBOT, **self._body_fields()))
            for key in keys
            if matches(query, key)
        ]

    def _answer_decisions(self, query: str) -> list[Sample]:
        """What robots decided, in their own messages: also of those that cannot answer any more."""
        return [
            Sample(key, made)
            for robot, past in self._history.decisions.items()
            if matches(query, key := self._keys.build(Kind.DECISION, robot=robot))
            for made in past
        ]


def _telling(one: Happening, trial: int) -> dict[str, Any]:
    """The fields of the message that tells what happened."""
    return {
        "kind": one.kind,
        "text": one.text[:LONGEST_LINE],
        "elapsed": max(one.elapsed, 0.0),
        "trial": trial,
        "robot": one.robot,
        "task": one.task,
        "details": dict(one.details),
    }


def _share(progress: float) -> float:
    """A share as the wire takes it, whatever an environment of a user's own makes of it."""
    return min(max(0.0, progress), 1.0)  # in this order also for NaN
