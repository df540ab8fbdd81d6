"""A mission in virtual time: the very minds, world, environments and link rules of a real run, one heap of events, one thread.

Any mission file runs, faults included. All delays of the real thing that matter are explicit (`Timing`), and all that is drawn
comes from the mission's seed, so the same seed gives the same run to the last byte. What is left out is what a real run adds by
accident: the scheduling of processes, the clocks of machines, the bus's own hiccups.
"""

import heapq
import math
from collections import Counter
from collections.abc import Callable
from typing import Any

from lalliance_agents.agent import translate
from lalliance_agents.bus.base import LEASE
from lalliance_agents.bus.link import LinkRules
from lalliance_agents.config import Mission
from lalliance_agents.faults import Fault
from lalliance_agents.model.equations import is_heard
from lalliance_agents.model.events import Decision
from lalliance_agents.model.parameters import Erratum
from lalliance_agents.wire.messages import Action, DecisionMade, LinkReport
from lalliance_study.air import AirLink
from lalliance_study.circumstances import Circumstances, Mishaps
from lalliance_study.logbook import Follower, Line, Timing, Watcher
from lalliance_study.member import Member, Process
from lalliance_study.senses import Senses
from world_server.failures import Deed, Order
from world_server.world import REFRESH_PERIOD, Happening, Stage, World


class Simulator:
    """Runs one mission.

    Args:
        mission: a mission that passed `environments.check_options`.
        timing: the delays of a real run.
        every_step: make every control step and take in every message, as a real run does, instead of only those in which
            something may happen. The result is the same, and comes later.
        watcher: told what robots sense and decide, as they do.
        circumstances: what the mission is told beyond its file.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        timing: Timing | None = None,
        every_step: bool = False,
        watcher: Watcher | None = None,
        circumstances: Circumstances | None = None,
    ) -> None:
        self.mission = mission
        self.now = 0.0
        self.log: list[Line] = []
        self._timing = timing or Timing()
        self._watcher = watcher
        self._heap: list[tuple[float, int, int, Callable[..., None], tuple[Any, ...]]] = []
        self._serial = 0
        self.world = World(mission, 0.0, self._tell)
        circumstances = circumstances or Circumstances()
        self._mishaps = Mishaps(circumstances, self.world, self._at, self._kill)
        self.members = {
            name: Member(
                mission,
                name,
                circumstances=circumstances,
                message_delay=self._timing.message_delay,
                every_step=every_step,
                decided=self._decided,
                rescheduled=self._reschedule,
                sensed=None if watcher is None else watcher.sensed,
            )
            for name in mission.robots
        }
        self._links = self._connect(every_step)
        self._rules: LinkRules | None = None
        self._look_at = math.inf
        self._looked = -1
        self._senses = Senses(self.world, self.members, self._timing.message_delay, self._at)
        #: Whether a fault may have done something to what robots hear or sense.
        self._disturbed = False
        self._served: set[int] = set()
        self._actions: dict[str, Action] = {}
        self._reported: dict[str, int] = {}
        self._seq = 0
        self._followers: list[Follower] = []
        self._prepare()

    def __repr__(self) -> str:
        return f"<Simulator of {self.mission.name}: {self.world.stage}, {self.now:.3f} s>"

    def _connect(self, every_step: bool) -> list[AirLink]:
        links = []
        for name, member in self.members.items():
            for mate in self.mission.teammates(name):
                hearer = self.members[mate]
                link = AirLink(member.voice, hearer, self._announce_news, every_step=every_step)
                links.append(link)
                hearer.hears.append(link)
                member.voice.idle.append(link)
                elsewhere = not self.mission.parameters_of(mate).is_literal(Erratum.HEARD_ELSEWHERE)
                for task in member.tasks:
                    if is_heard(False, task in hearer.tasks, elsewhere):
                        member.voice.on[task].append(link)
        return links

    def _announce_news(self, link: AirLink, at: float) -> None:
        self._at(at, 0, self._bring_news, link)

    def _bring_news(self, link: AirLink) -> None:
        self.members[link.hearer.name].news(link, self.now)

    def _at(self, instant: float, priority: int, deed: Callable[..., None], *arguments: Any) -> None:
        if instant < self.now:
            raise ValueError(f"{deed.__name__} was asked for at {instant!r} s, and it is {self.now!r} s")
        self._serial += 1
        heapq.heappush(self._heap, (instant, priority, self._serial, deed, arguments))

    def call_at(self, instant: float, look: Callable[[], None]) -> None:
        """Have `look` called at an instant of the run, to see how the team stands; it is to change nothing."""
        self._at(instant, 2, look)

    def _soon(self, deed: Callable[..., None], *arguments: Any) -> None:
        """Have something done when a message sent now arrives."""
        self._at(self.now + self._timing.message_delay, 0, deed, *arguments)

    def _prepare(self) -> None:
        for name, spec in self.mission.robots.items():
            if spec.joins == 0.0:
                self._at(0.0, 0, self._start, name)
        self._soon(self._reach_launcher)
        self._at(REFRESH_PERIOD, 0, self._refresh)

    def run(self) -> dict[str, Any]:
        """Run the mission to its end; its summary, as a real run gives it."""
        while not self.world.over:
            self.step()
        return self.summary()

    def step(self) -> None:
        """Let the next thing happen, be it small; there is always one."""
        self.now, _, _, deed, arguments = heapq.heappop(self._heap)
        deed(*arguments)

    def summary(self) -> dict[str, Any]:
        """How the mission went, with the last counters of all robots."""
        self._report(final=True)
        return self.world.summary()

    def follow(self, told: Follower) -> None:
        """Have `told` called with what an operator of a real run hears: what happens in the world, and decisions."""
        self._followers.append(told)

    def inject(self, fault: Fault, lasts: float | None) -> str:
        """Put a fault in force now; see `World.inject`."""
        done = self.world.inject(fault, lasts, self.now)
        self._look()
        return done

    def heal(self, name: str) -> str:
        """End the fault `name` now, or all; see `World.heal`."""
        done = self.world.heal(name, self.now)
        self._look()
        return done

    def _tell(self, happening: Happening) -> None:
        # A robot tells nothing of faults, its own included.
        who = "world" if happening.robot is None or happening.kind == "fault" else happening.robot
        self.log.append(Line(self.now, who, happening.kind, happening.task, happening.text, None))
        for told in self._followers:
            told(happening)

    def _note(self, robot: str, why: str) -> None:
        """Log what became of a robot's process."""
        self.log.append(Line(self.now, robot, "process", None, why, None))

    def _reach_launcher(self) -> None:
        self.world.launcher(True, self.now)

    # The robots' processes

    def _start(self, name: str) -> None:
        member = self.members[name]
        if member.process is Process.GONE:
            member.start(self.now)
            self._actions.pop(name, None)  # what it said in an earlier life is no action of this one
            self._note(name, "started")
            self._soon(self._see, name, True)

    def _see(self, name: str, present: bool) -> None:
        """The world sees a process come or go."""
        self.world.presence(name, present, self.now)
        self._mishaps.look(name, self.now)
        if present and self.world.trial and not self.world.over:
            self._senses.tell_all(name, self.now)
        self._look()

    def _lapse(self, name: str, incarnation: int, since: float) -> None:
        """The bus gives up a process that has been stopped for longer than its lease."""
        member = self.members[name]
        if member.process is Process.STOPPED and (member.incarnation, member.stopped_at) == (incarnation, since):
            member.given_up = True
            self._see(name, False)

    def _carry_out(self, order: Order) -> None:
        """What the launcher does at a process."""
        if order.number in self._served:
            return
        member = self.members[order.robot]
        if order.deed in {Deed.KILL, Deed.HANG} and member.process is Process.GONE:
            return  # it is still starting; the order stands, and meets it as soon as it is there
        match order.deed:
            case Deed.KILL:
                self._kill(order.robot)
            case Deed.START:
                if member.process is not Process.GONE:
                    return
                self._at(self.now + self._timing.start_up, 0, self._start, order.robot)
            case Deed.HANG:
                if member.runs:
                    self._note(order.robot, "stopped")
                member.stop(self.now)
                self._at(self.now + LEASE, 0, self._lapse, order.robot, member.incarnation, self.now)
            case Deed.RESUME:
                if member.process is Process.STOPPED:
                    self._note(order.robot, "continued")
                if member.resume(self.now):
                    self._senses.missed(order.robot)
                    self._soon(self._see_again, order.robot)
        self._served.add(order.number)
        self._soon(self._confirm, order.number)

    def _kill(self, name: str) -> None:
        self._note(name, "killed")
        self.members[name].kill(self.now)
        self._soon(self._see, name, False)

    def _see_again(self, name: str) -> None:
        self.world.presence(name, True, self.now)
        self._look()

    def _confirm(self, number: int) -> None:
        self.world.done(number, self.now)
        self._look()

    # The robots' minds

    def _reschedule(self, member: Member) -> None:
        if member.due < math.inf:
            self._at(member.due, 1, self._step, member, member.due)

    def _step(self, member: Member, due: float) -> None:
        if member.due == due:
            member.step()

    def _decided(self, member: Member, decision: Decision) -> None:
        self.log.append(
            Line(self.now, member.name, decision.verb.value, decision.task, decision.cause.value, decision.other)
        )
        if self._watcher is not None:
            self._watcher.decided(member.name, decision)
        self._mishaps.decided(member.name, decision.verb, self.now)
        self._seq += 1
        made = DecisionMade.model_construct(
            sender=member.name,
            incarnation=member.incarnation,
            seq=self._seq,
            at=self.now,
            **translate.decision(decision, member.trial, decision.at - self.world.began),
        )
        self._soon(self._act, self._action(member))
        self._soon(self._hear_decision, made)

    def _action(self, member: Member) -> Action:
        self._seq += 1
        action = Action.model_construct(
            sender=member.name,
            incarnation=member.incarnation,
            seq=self._seq,
            at=self.now,
            task=member.task,
            trial=member.trial,
            fewest=member.mind.knowledge.fewest(member.abilities),
        )
        self._actions[member.name] = action
        return action

    def _act(self, action: Action) -> None:
        """An action reaches the world, also if its robot was killed meanwhile: the world sees that after it."""
        self.world.act(action, self.now)
        self._mishaps.look(action.sender, self.now)
        self._look()

    def _hear_decision(self, made: DecisionMade) -> None:
        for told in self._followers:
            told(made)
        self.world.decided(made, self.now)

    # The world

    def _refresh(self) -> None:
        """Once a second: bodies go on, counters are told, and who has missed something senses it."""
        for member in self.members.values():
            if member.runs:
                before = self._actions.get(member.name)
                if before is None or before.trial != member.trial or self.world.learning == "active":
                    before = self._action(member)
                self.world.act(before, self.now)
                self._mishaps.look(member.name, self.now)
        if self._disturbed:
            self._report(final=False)
        self._senses.refresh(self.now)
        self._at(self.now + REFRESH_PERIOD, 0, self._refresh)
        self._look()

    def _report(self, *, final: bool) -> None:
        """Tell the world what robots sent and received: all at the end, and meanwhile those to whom a fault did something."""
        if final:
            for member in self.members.values():
                member.take_stock(self.now)
        for member in self.members.values():
            effects = member.total_effects()
            touched = sum(effect.count for effect in effects)
            if final or touched > self._reported.get(member.name, 0):
                self._reported[member.name] = touched
                self._seq += 1
                self.world.reported(self._counters(member, effects, final=final), self.now)

    def _counters(self, member: Member, effects: list[Any], *, final: bool) -> LinkReport:
        dropped = Counter(
            {
                "stale": sum(link.stale for link in member.hears),
                "other trial": sum(link.strange for link in member.hears),
                "link fault": sum(link.lost for link in member.hears),
            }
        )
        return LinkReport.model_construct(
            sender=member.name,
            incarnation=1,
            seq=self._seq,
            at=self.now,
            sent=member.voice.sent,
            received=sum(link.received for link in member.hears),
            dropped={reason: count for reason, count in dropped.items() if count},
            teammates={},
            effects=effects,
            ticks=member.periods(self.now),
            missed=0,
            final=final,
        )

    def _look(self) -> None:
        """Have the world server look at its world at its next step, as something has happened."""
        self._look_by(self.now)

    def _look_by(self, instant: float) -> None:
        if instant == math.inf:
            return
        step = self._timing.world_step
        number = max(math.ceil(instant / step - 1e-9), self._looked + 1)
        if number * step < self._look_at:
            self._look_at = number * step
            self._at(self._look_at, 0, self._look_now, number)

    def _look_now(self, number: int) -> None:
        """One step of the world server: let time pass, and publish what has changed."""
        if number <= self._looked:
            return
        self._looked = number
        self._look_at = math.inf
        world = self.world
        if world.stage is Stage.WAITING and not world.missing():
            world.begin(self.now)
        world.advance(self.now)
        for order in world.orders():
            if order.number not in self._served:
                self._soon(self._carry_out, order)
        self._put_rules_in_force()
        self._senses.publish(self.now)
        self._look_by(max(world.next_change(), self.now + self._timing.world_step / 2))

    def _put_rules_in_force(self) -> None:
        rules = self.world.rules()
        if self._rules is None or self._rules.rules != tuple(rules):
            self._rules = LinkRules(self.mission.seed, rules)
            for member in self.members.values():
                member.voice.unsettle(self.now)
            for link in self._links:
                link.rule = self._rules.on(link.sender, link.hearer.name)
        blind = self.world.blind()
        self._senses.blind(blind)
        self._disturbed = self._disturbed or bool(rules or blind)
