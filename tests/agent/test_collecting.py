"""When what comes is told the mind: as heard when it came, in its order, at the next control step."""

import asyncio

import pytest
from support.robot_stage import Stage
from support.virtual_time import hold_up

from lalliance_agents import BehaviorSet
from lalliance_agents.bus.inbox import BATCH
from lalliance_agents.model.events import BodyFailed, TrialStarted
from lalliance_agents.wire.keys import Kind
from lalliance_agents.wire.messages import Blindness

pytestmark = pytest.mark.virtual_time


async def test_a_teammate_counts_as_heard_when_its_message_came_not_when_it_was_collected() -> None:
    async with Stage() as stage:
        await stage.begin()
        mate, presences = stage.voice("right"), stage.robot.mind.hearing.presences
        loop = asyncio.get_running_loop()
        for wait in (0.5, 0.13, 0.02, 0.31):
            await asyncio.sleep(wait)
            came = loop.time()
            mate.send(Kind.HEARTBEAT, trial=1)
            await asyncio.sleep(2 * stage.mission.control_period)
            assert presences["right"].last == pytest.approx(came)


async def test_a_robot_that_was_held_up_does_not_take_its_teammates_for_silent() -> None:
    """It meets only a part of what waited before its next step, and the rest after it."""
    async with Stage() as stage:
        await stage.begin()
        mates = [stage.voice("right"), stage.voice("stranger")]
        mates[1].send(Kind.HELLO, tasks=["a"])
        await asyncio.sleep(0.5)
        tau = stage.mission.parameters.silence_timeout
        for _ in range(BATCH):
            mates[0].send(Kind.HEARTBEAT, trial=1)
            mates[1].send(Kind.HEARTBEAT, trial=1)
        hold_up(2 * tau)
        mates[0].send(Kind.HEARTBEAT, trial=1)
        await asyncio.sleep(0)
        silences = []
        for _ in range(20):
            silences += stage.robot.mind.hearing.silences(asyncio.get_running_loop().time()).values()
            await asyncio.sleep(0.01)
        assert max(silences[4:]) < tau
        presences = stage.robot.mind.hearing.presences
        assert [presences[name].lapses for name in ("right", "stranger")] == [0, 0]


async def test_of_what_is_late_and_due_at_once_the_last_word_of_a_task_counts() -> None:
    async with Stage() as stage:
        await stage.begin()
        late = Blindness(fault="1-blind", robot="left", delay=0.5)
        stage.world.send(Kind.CHAOS_RULES, seed=1, rules=[], blind=[late])
        await asyncio.sleep(0.5)
        stage.sense("a")
        await asyncio.sleep(0.001)
        stage.sense("a", applicable=False, complete=True)
        await asyncio.sleep(0.4)
        hold_up(0.2)
        await asyncio.sleep(2.0)
        assert stage.decisions() == []


async def test_what_a_set_said_before_the_next_trial_began_is_not_told_of_that_trial() -> None:
    """The world's message of the next trial comes while the set is asked, at a control step."""

    class Asked(BehaviorSet):
        done = False

        def complete(self) -> bool:
            done, self.done = self.done, False
            if done:
                stage.sense("a", trial=2)
            return done

    asked = Asked("a")
    async with Stage(asked) as stage:
        await stage.begin()
        stage.sense("a")
        await asyncio.sleep(2.0)
        asked.done = True
        await asyncio.sleep(4.0)
        assert ("activate", "a", 2) in stage.decisions()


async def test_a_body_that_fails_as_the_next_trial_begins_fails_in_none() -> None:
    async with Stage() as stage:
        await stage.begin()
        stage.sense("a")
        await asyncio.sleep(2.0)
        assert stage.decisions() == [("activate", "a", 1)]
        told = []
        handle = stage.robot.mind.handle
        stage.robot.mind.handle = lambda event, now: told.append(type(event)) or handle(event, now)  # type: ignore[method-assign]
        stage.sense("a", trial=2)
        stage.robot._body_failed(stage.robot._repertoire["a"])
        assert TrialStarted in told
        assert BodyFailed not in told
