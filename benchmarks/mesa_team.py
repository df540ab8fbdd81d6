"""A team in Mesa, as a user of that framework would write it: agents that step, and a model that has them step.

There is one L-ALLIANCE: an agent holds the `Mind` that a robot on the bus holds, and the tasks are the environment that a
world server has. What is Mesa's is who lets time pass. A step of the model is a step of the world, in which it looks at its
tasks; then those robots step whose control step falls before the next look, in the order of their instants. What is said,
sensed or done takes as long to arrive as in the simulator, so that both find the same decisions at the same instants.

Missions without faults, of one adaptive trial, in which all robots and tasks are there from the beginning.
"""

import math
from collections import deque
from itertools import zip_longest
from typing import NamedTuple

import mesa

from lalliance_agents.agent import translate
from lalliance_agents.agent.briefing import new_mind, roster
from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.model.events import Announce, Cause, Decision, Event, Heard, TrialStarted, Verb
from lalliance_agents.model.parameters import Erratum, Learning
from lalliance_study.circumstances import Circumstances
from lalliance_study.logbook import Timing
from lalliance_study.simulator import Simulator
from world_server import environments
from world_server.environments.base import Work

#: Two makespans that differ by less are the same, in seconds.
SAME = 1e-9
#: The number of the only trial; before it, robots are in trial 0.
TRIAL = 1


class Message(NamedTuple):
    """What reaches a robot: of a teammate, or of the world."""

    arrives: float
    trial: int
    event: Event


class Robot(mesa.Agent):
    """One robot.

    Args:
        team: its model.
        name: which robot of the mission.
        circumstances: what it has learned before, and where its chance comes from.
    """

    def __init__(self, team: "Team", name: str, circumstances: Circumstances) -> None:
        super().__init__(team)
        mission = team.mission
        chance = circumstances.chance_of(mission, name, 1)
        self.name = name
        self.mind = new_mind(mission, name, chance, now=0.0, learned=circumstances.learned.get(name))
        self.mind.handle(roster(mission, name), 0.0)
        self.mates: list[Robot] = []
        self.inbox: deque[Message] = deque()
        self.trial = 0
        #: When its first control step is, in seconds.
        self.first = chance.random() * mission.control_period
        self.control_steps = 0

    def step(self) -> None:
        """Take in what has come, let the mind decide, and do it."""
        now = self.first + self.control_steps * self.model.mission.control_period
        self.control_steps += 1
        self.listen(now)
        for command in self.mind.tick(now):
            if isinstance(command, Announce):
                self.say(command, now)
            else:
                self.model.act(self.name, command.decision, now)

    def listen(self, now: float) -> None:
        """Take in what has come until `now`."""
        while self.inbox and self.inbox[0].arrives <= now:
            arrived, trial, event = self.inbox.popleft()
            if isinstance(event, TrialStarted):
                self.trial = trial
            if trial == self.trial:
                self.mind.handle(event, arrived)

    def say(self, said: Announce, now: float) -> None:
        """Tell all teammates."""
        heard = Heard(self.name, said.task, said.active_for, said.expected)
        message = Message(now + self.model.timing.message_delay, self.trial, heard)
        for mate in self.mates:
            mate.inbox.append(message)


class Team(mesa.Model):
    """A mission.

    Args:
        mission: the mission.
        circumstances: what it is told beyond its file.
        timing: the delays of a real run.

    Raises:
        UserError: the mission is none of those that this model can run.
    """

    def __init__(
        self, mission: Mission, circumstances: Circumstances | None = None, timing: Timing | None = None
    ) -> None:
        super().__init__(seed=mission.seed)
        circumstances = circumstances or Circumstances()
        self.mission = mission
        self.timing = timing or Timing()
        _check(mission, circumstances, self.timing)
        self.makespan = math.inf
        #: Who decided what.
        self.decisions: list[tuple[str, Decision]] = []
        self.robots = {name: Robot(self, name, circumstances) for name in mission.robots}
        for name, robot in self.robots.items():
            robot.mates = [self.robots[mate] for mate in mission.teammates(name)]
        self._turns = turns(self.agents, mission.control_period, self.timing.world_step)
        self._environment = environments.create(mission, seed=mission.seed)
        self._began = self._now = 0.0
        self._work: dict[str, Work] = {}
        self._actions: deque[tuple[float, str, str | None]] = deque()
        self._known: dict[str, tuple[bool, bool]] = {}

    def step(self) -> None:
        """Let the world look at its tasks, and those robots step whose turn it is."""
        number = self.steps - 1
        self.look(number, number * self.timing.world_step)
        if self.running:
            self._turns[number % len(self._turns)].do("step")

    def act(self, robot: str, decision: Decision, now: float) -> None:
        """A robot has decided to work on a task, or to cease."""
        self.decisions.append((robot, decision))
        task = decision.task if decision.verb is Verb.ACTIVATE else None
        self._actions.append((now + self.timing.message_delay, robot, task))

    def look(self, number: int, now: float) -> None:
        """Look `number` of the world at its tasks: with the second, as it has heard of everybody, the trial begins."""
        if number == 0:
            return
        if number == 1:
            self._began = self._now = now
            for robot in self.robots.values():
                self._tell(robot, TrialStarted(Learning.ADAPTIVE), now)
        news = number == 1
        while self._actions and self._actions[0][0] <= now:
            at, name, task = self._actions.popleft()
            news |= self._advance(at)
            self._work.pop(name, None)
            if task is not None:
                self._work[name] = Work(task)
            self._environment.step(0.0, self._work)
        news |= self._advance(now)
        self.running = not self._environment.is_complete and now < self._began + self.mission.deadline
        if news and self.running:
            self._publish(now)

    def _advance(self, until: float) -> bool:
        """Let bodies work; whether a task was completed."""
        completions = self._environment.step(until - self._now, self._work)
        if completions and self._environment.is_complete:
            self.makespan = self._now + completions[-1].after - self._began
        self._now = until
        return bool(completions)

    def _publish(self, now: float) -> None:
        """Tell all who can do them of the tasks that have changed."""
        for task, view in self._environment.sense().items():
            stands = view.applicable, view.complete
            if self._known.get(task) != stands:
                self._known[task] = stands
                for name in self.mission.able(task):
                    self._tell(self.robots[name], translate.sensed(task, *stands), now)

    def _tell(self, robot: Robot, event: Event, now: float) -> None:
        robot.inbox.append(Message(now + self.timing.message_delay, TRIAL, event))


def compare(team: Team, simulator: Simulator) -> str | None:
    """Run a mission in both; what they find first that is not the same, None if it all is."""
    team.run_model()
    simulator.run()
    causes = {cause.value for cause in Cause}
    here = [f"{one.at:.9f} {name} {one.verb} {one.task}: {one.cause}" for name, one in team.decisions]
    there = [
        f"{line.at:.9f} {line.who} {line.what} {line.task}: {line.why}" for line in simulator.log if line.why in causes
    ]
    for mine, other in zip_longest(here, there, fillvalue="nothing more"):
        if mine != other:
            return f"Mesa: {mine}; simulator: {other}"
    needed = simulator.world.makespan
    same = math.isinf(team.makespan) if needed is None else abs(team.makespan - needed) <= SAME
    return None if same else f"Mesa: makespan {team.makespan} s; simulator: {needed} s"


def turns(robots: mesa.agent.AgentSet, control_period: float, step: float) -> list[mesa.agent.AgentSet]:
    """The robots, by the step of the model in which their first control step falls; in order of its instant."""
    return [
        robots.select(lambda robot, turn=turn: int(robot.first / step) == turn).sort("first", ascending=True)
        for turn in range(round(control_period / step))
    ]


def _check(mission: Mission, circumstances: Circumstances, timing: Timing) -> None:
    """Refuse what this model does not know."""
    steps = mission.control_period / timing.world_step
    for reason, holds in (
        ("something befalls robots or bodies", mission.faults or circumstances.lives or circumstances.traps),
        (
            "robots join, or tasks arrive",
            any(one.joins for one in mission.robots.values()) or any(task.arrives for task in mission.tasks.values()),
        ),
        (
            "it is not one adaptive trial",
            [phase.learning for phase in mission.phases] != [Learning.ADAPTIVE] or mission.phases[0].trials != 1,
        ),
        (
            "robots do not hear what teammates do elsewhere",
            any(mission.parameters_of(name).is_literal(Erratum.HEARD_ELSEWHERE) for name in mission.robots),
        ),
        ("a control step is no multiple of a step of the world", abs(steps - round(steps)) > 1e-9),
    ):
        if holds:
            raise UserError(f"the Mesa model cannot run mission {mission.name}: {reason}; expected the simulator")
