"""The robot at run time: receive, feed, tick, perform.

A `Robot` puts a mind, a messenger and a body together in one event loop. Messages become events; once per control period
the mind ticks, or only beats where it has nothing to decide, and its commands go to the radio and the body. As the mind
decides in these steps only, what teammates say waits for the next of them, with the instant at which it came. Once a second
the robot refreshes what others keep of it. It decides nothing itself, and nothing that it receives can end it: it ends when
the world says that the mission is over, or when it is cancelled. It hears through the faults of links that the world has put
in force.
"""

import asyncio
import logging
from collections.abc import Iterable, Sequence
from typing import Any, Literal

from lalliance_agents.agent import translate
from lalliance_agents.agent.behavior import BehaviorSet, complete_repertoire
from lalliance_agents.agent.briefing import chance_of, new_mind, roster, tasks_of
from lalliance_agents.agent.catalog import Catalog, fresh_incarnation
from lalliance_agents.agent.performer import Performer
from lalliance_agents.agent.reports import Reports
from lalliance_agents.agent.senses import Senses
from lalliance_agents.agent.team import Team
from lalliance_agents.bus.base import Bus, Delivery, Publication, Registration, Sample
from lalliance_agents.bus.faulty import FaultyBus
from lalliance_agents.bus.messenger import Messenger, Receiver
from lalliance_agents.clock import MissionClock
from lalliance_agents.config import Mission
from lalliance_agents.errors import MissionError
from lalliance_agents.model.events import (
    Activate,
    Announce,
    BodyFailed,
    Command,
    Deactivate,
    Decision,
    Event,
    TrialStarted,
)
from lalliance_agents.model.parameters import Erratum
from lalliance_agents.suggestions import like_or_any
from lalliance_agents.wire.keys import Key, Keys, Kind
from lalliance_agents.wire.messages import Activity, BodyState, Decoder, Heartbeat, Hello, Message, TaskState, decode_at

_log = logging.getLogger(__name__)

#: How long the robot waits at its start for the answers of the world and of teammates, in real seconds.
GREETING_TIMEOUT = 1.0
#: Robots listened to at most, unless the mission itself has more: hostile names cannot fill the memory.
MOST_TEAMMATES = 1024
#: After so many control periods without one a robot was held up.
HELD_UP = 2.0
#: Time between two refreshes of the action and the report, and of the rarer greeting, in mission seconds.
REFRESH_PERIOD = 1.0
GREETING_PERIOD = 10.0
#: Greetings of a whole team in a second at most: everybody hears each of them, however large the team is.
MOST_GREETINGS = 10.0
#: Least time between two messages with all motivations, in mission seconds.
MOTIVATION_PERIOD = 0.2

Outcome = Literal["complete", "failed"]


class Robot:
    """One robot of a team.

    Args:
        mission: the mission, with this robot in it.
        name: which robot of the mission.
        bus: an open bus; the robot does not close it.
        behaviors: behaviour sets of its own; tasks without one are done by the body in the world server.
        clock: mission time; default: real time from now on.
        catalog: learned times on disk; default: nothing is stored.
        incarnation: which life of this robot this is; default: what the catalog says, else a fresh one.
        world: whether there is a world server; without one the robot begins at once and never ends by itself.
        decode: how messages are decoded; robots of one process may share one that remembers.

    Raises:
        BehaviorError: the behaviour sets do not fit the mission.
        MissionError: the mission has no robot of this name.
    """

    def __init__(
        self,
        mission: Mission,
        name: str,
        *,
        bus: Bus,
        behaviors: Iterable[BehaviorSet] = (),
        clock: MissionClock | None = None,
        catalog: Catalog | None = None,
        incarnation: int | None = None,
        world: bool = True,
        decode: Decoder = decode_at,
    ) -> None:
        if name not in mission.robots:
            raise MissionError(f"mission {mission.name} has no robot {name!r}{like_or_any(name, mission.robots)}")
        self.name = name
        self._mission = mission
        self._world = world
        self._hears_elsewhere = not mission.parameters_of(name).is_literal(Erratum.HEARD_ELSEWHERE)
        self._clock = clock or MissionClock()
        self._catalog = catalog
        if incarnation is None:
            incarnation = catalog.incarnation if catalog else fresh_incarnation()
        tasks = tasks_of(mission, name)
        self._repertoire = complete_repertoire(name, tasks, behaviors)
        self._chance = chance_of(mission, name, incarnation)
        now = self._clock.now()
        self.mind = new_mind(mission, name, self._chance, now=now, learned=catalog.learned if catalog else None)
        self._keys = Keys(mission.name)
        self._bus = FaultyBus(bus, self._keys, name, self._clock, decode=decode)
        self._messenger = Messenger(
            self._bus, self._keys, name, incarnation, self._clock.now, mission.robots, decode=decode
        )
        self._reports = Reports(self._messenger, self._bus)
        self._team = Team(name, frozenset(tasks), MOST_TEAMMATES)
        for teammate in mission.teammates(name):
            self._team.meet(teammate, frozenset(mission.robots[teammate].tasks))
        self._performer = Performer(self._body_failed, self._body_returned)
        self._motivations: Publication | None = None
        self._trial = 0 if world else 1
        #: When the trial began, as far as the world has told; None: nobody tells.
        self._trial_began: float | None = None
        self._senses = Senses()
        self._store_failed = False
        self._saved_version = self.mind.knowledge.version
        self._saving: asyncio.Task[None] | None = None
        self._refresh_due = self._greeting_due = self._motivation_due = now
        #: The latest instant of which the mind has been told something.
        self._told_until = now
        self._over: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
        self._listening: set[asyncio.Task[None]] = set()

    def __repr__(self) -> str:
        return f"<Robot {self.name}: {self._performer.task or 'idle'}, trial {self._trial}>"

    async def run(self) -> Outcome:
        """Be part of the team until the mission is over; how it ended."""
        presence: Registration | None = None
        ticking: asyncio.Task[None] | None = None
        try:
            await self._join()
            presence = await self._bus.announce_presence(self._keys.build(Kind.ALIVE, robot=self.name))
            ticking = asyncio.create_task(self._tick_forever(), name=f"ticks of {self.name}")
            ends: set[asyncio.Future[Any]] = {ticking, self._over}
            await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
            if ticking.done():
                ticking.result()
            return self._over.result()
        finally:
            try:
                await self._leave(ticking)
            finally:
                if presence is not None:
                    await presence.close()

    async def _join(self) -> None:
        keys, listen = self._keys, self._messenger.listen
        self._tell(roster(self._mission, self.name))
        if self._world:  # before the first message comes to which a rule applies
            await self._bus.obey(timeout=GREETING_TIMEOUT)
        if not self._hears_elsewhere:
            for task in self._repertoire:
                await self._messenger.listen_lazily(keys.build(Kind.ACTIVITY, task=task), self._receive_presence)
        for teammate in self._team.abilities:
            await self._listen_to(teammate)
        await self._messenger.listen_lazily(
            keys.build(Kind.HELLO), lambda key, message, _: self._receive_hello(key, message)
        )
        await self._messenger.offer(keys.build(Kind.HELLO, robot=self.name), self._own_hello)
        self._motivations = await self._bus.publication(
            keys.build(Kind.MOTIVATION, robot=self.name), Delivery.TELEMETRY
        )
        questions: dict[str, Receiver] = {keys.build(Kind.HELLO): self._receive_hello}
        if self._world:
            body = keys.build(Kind.SENSE_ROBOT, robot=self.name)
            for task in self._repertoire:
                await listen(keys.build(Kind.SENSE_TASK, task=task), self._receive_sense)
            await listen(body, self._receive_body)
            questions |= {keys.build(Kind.SENSE_TASK): self._receive_sense, body: self._receive_body}
        self._greet()
        await asyncio.gather(
            *(
                self._messenger.ask(pattern, receiver, timeout=GREETING_TIMEOUT)
                for pattern, receiver in questions.items()
            )
        )

    async def _leave(self, ticking: asyncio.Task[None] | None) -> None:
        self._bus.collect()
        ending = set(self._listening)
        if ticking is not None:
            ending.add(ticking)
        for task in ending:
            task.cancel()
        self._performer.stop_all()
        # The last report goes out first: who waits for it need not wait for a body that cleans up slowly.
        self._reports.send(self.mind, self._clock.now(), final=True)
        await self._messenger.close()
        await self._bus.forget()
        if ending:
            await asyncio.wait(ending)
        await self._performer.close()
        if self._motivations is not None:
            await self._motivations.close()
        if self._saving is not None:
            await asyncio.wait({self._saving})
        await self._save()

    def _tell(self, event: Event, at: float | None = None) -> None:
        """Tell the mind of something that was perceived at the instant `at`, or now.

        Nothing may be collected between the perception and this: it would be told the older one last.
        """
        if at is None:
            at = self._clock.now()
        # A thread may note that a message has come, and hand it over only after something later was told.
        self._told_until = max(self._told_until, at)
        self.mind.handle(event, self._told_until)

    def _receive_presence(self, _: Key, message: Message, came: float) -> None:
        if not isinstance(message, Activity | Heartbeat):
            return
        if not self._team.knows(message.sender):
            self._messenger.drop("stranger", message.sender)
        elif message.trial != self._trial:
            self._messenger.drop("other trial", message.sender)
        else:
            self._reports.heard(message.sender)
            self._tell(translate.heard(message), self._heard_at(self._clock.at(came)))

    def _heard_at(self, came: float) -> float:
        """When a message that came at `came` counts as heard: then, or now if this robot was held up.

        Who was held up meets a part of what came meanwhile, the oldest first, before its next step; it must not find
        teammates silent whose later messages it has not looked at.
        """
        now = self._clock.now()
        return came if now - came < HELD_UP * self._mission.control_period else now

    def _receive_sense(self, key: Key, message: Message) -> None:
        if isinstance(message, TaskState) and key.task in self._repertoire and message.trial >= self._trial:
            self._enter_trial(message.trial, message.learning)
            self._repertoire[key.task].sensed = translate.sense(message)
            self._feel(self._repertoire[key.task])

    def _receive_body(self, _: Key, message: Message) -> None:
        if not isinstance(message, BodyState) or message.trial < self._trial:
            return
        if message.mission in {"complete", "failed"} and not self._over.done():
            self._over.set_result("complete" if message.mission == "complete" else "failed")
        elif message.mission == "running":
            self._enter_trial(message.trial, message.learning)
            if message.elapsed is not None and message.trial == self._trial:
                self._trial_began = self._clock.now() - message.elapsed

    def _receive_hello(self, _: Key, message: Message) -> None:
        if not isinstance(message, Hello):
            return
        tasks = frozenset(message.tasks)
        if self._team.knows(message.sender):
            self._team.meet(message.sender, tasks)
        elif tasks & self._repertoire.keys() and not self._team.full:
            self._team.meet(message.sender, tasks)
            listening = asyncio.create_task(self._listen_to(message.sender))
            self._listening.add(listening)
            listening.add_done_callback(self._listening.discard)

    async def _listen_to(self, teammate: str) -> None:
        listen = self._messenger.listen_lazily
        await listen(self._keys.build(Kind.HEARTBEAT, robot=teammate), self._receive_presence)
        if self._hears_elsewhere:
            await listen(self._keys.build(Kind.ACTIVITY, robot=teammate), self._receive_presence)

    def _enter_trial(self, trial: int, learning: str) -> None:
        if trial <= self._trial:
            return
        if self._trial == 0:
            self._reports.begin()
        self._trial = trial
        self._trial_began = self._clock.now()
        self._performer.stop_all()
        self._senses.forget(self._repertoire.values())
        self._tell(TrialStarted(translate.learning(learning)))

    def _feel(self, one: BehaviorSet) -> None:
        """Tell the mind how a task stands, if that has changed; not before the first trial."""
        if self._trial > 0 and (changed := self._senses.feel(one)) is not None:
            self._tell(changed)

    def _body_failed(self, one: BehaviorSet) -> None:
        trial = self._trial
        self._bus.collect()
        if trial == self._trial:
            self._tell(BodyFailed(one.task))

    def _body_returned(self, one: BehaviorSet) -> None:
        self._bus.collect()
        self._feel(one)

    async def _tick_forever(self) -> None:
        period = self._mission.control_period
        due = self._clock.now() + self._chance.random() * period
        while True:
            await self._clock.sleep_until(due)
            self._bus.collect()
            now = self._told_until = max(self._clock.now(), self._told_until)
            missed = max(int((now - due) / period), 0)
            self._reports.ticked(missed)
            self._tick(now)
            due += (missed + 1) * period

    def _tick(self, now: float) -> None:
        for one in self._repertoire.values():
            self._feel(one)
        shown = self._shows_motivations(now)
        for command in self._think(now, whole=shown):
            self._perform(command)
        if now >= self._refresh_due:
            self._refresh_due = now + REFRESH_PERIOD
            self._refresh(now)
        if shown and self._motivations is not None:
            self._motivations.put(self._reports.motivations(self.mind))

    def _think(self, now: float, *, whole: bool) -> Sequence[Command]:
        """A control step; unless it is to be a whole one, only what is due is announced where nothing else can follow."""
        if whole or now >= self.mind.wake() or now >= self.mind.next_lapse():
            return self.mind.tick(now)
        return self.mind.beat(now)

    def _shows_motivations(self, now: float) -> bool:
        """Whether all motivations are to be published after this step: it is time to look, and somebody listens."""
        if now < self._motivation_due or self._motivations is None:
            return False
        self._motivation_due = now + MOTIVATION_PERIOD
        return self._motivations.has_listeners

    def _perform(self, command: Command) -> None:
        match command:
            case Announce():
                kind, fields = translate.announcement(command, self._trial)
                self._messenger.send(kind, key_task=command.task or "", **fields)
            case Activate():
                self._performer.start(self._repertoire[command.decision.task])
                self._tell_of(command.decision)
            case Deactivate():
                self._performer.stop(command.decision.task)
                self._tell_of(command.decision)

    def _tell_of(self, decision: Decision) -> None:
        """What follows from a decision for the body, and the decision itself."""
        self._act()
        elapsed = None if self._trial_began is None else decision.at - self._trial_began
        self._messenger.send(Kind.DECISION, **translate.decision(decision, self._trial, elapsed))

    def _act(self) -> None:
        """Tell the world what the body works on."""
        fewest = self.mind.knowledge.fewest(self._team.abilities)
        self._messenger.send(Kind.ACTION, task=self._performer.task, trial=self._trial, fewest=fewest)

    def _refresh(self, now: float) -> None:
        self._act()
        self._reports.send(self.mind, now, final=False)
        if now >= self._greeting_due:
            self._greeting_due = now + max(GREETING_PERIOD, len(self._mission.robots) / MOST_GREETINGS)
            self._greet()
        if self._catalog is not None and self.mind.knowledge.version != self._saved_version and self._saving is None:
            self._saving = asyncio.create_task(self._save())
            self._saving.add_done_callback(lambda _: setattr(self, "_saving", None))

    def _greet(self) -> None:
        self._messenger.send(Kind.HELLO, tasks=list(self._repertoire))

    def _own_hello(self, _: str) -> list[Sample]:
        key = self._keys.build(Kind.HELLO, robot=self.name)
        return [Sample(key, self._messenger.compose(Kind.HELLO, tasks=list(self._repertoire)))]

    async def _save(self) -> None:
        if self._catalog is None or self.mind.knowledge.version == self._saved_version:
            return
        version, learned = self.mind.knowledge.version, self.mind.knowledge.records()
        try:
            await asyncio.to_thread(self._catalog.save, learned)
            self._saved_version = version
            self._store_failed = False
        except OSError as error:
            if not self._store_failed:
                _log.warning("learned times not stored: %s; will be tried again", error)
            self._store_failed = True
