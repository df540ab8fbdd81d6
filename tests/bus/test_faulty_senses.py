"""What a blind robot senses through a bus with faults: nothing, or all of it late."""

import asyncio

import pytest
from support.faulty_stage import KEYS, Stage, blind

from lalliance_agents.bus.base import Sample
from lalliance_agents.wire.keys import Kind

pytestmark = pytest.mark.virtual_time


async def test_a_blind_robot_senses_nothing_of_its_tasks_but_all_of_itself() -> None:
    stage = Stage()
    await stage.obey(blind=blind())
    await stage.listen(*map(KEYS.build, (Kind.SENSE_TASK, Kind.SENSE_ROBOT, Kind.HEARTBEAT)))
    stage.sense("a")
    stage.sense("b")
    stage.world.send(Kind.SENSE_ROBOT, key_robot="right", mission="running", trial=1, learning="active")
    stage.beat()
    await stage.pause(0.0)
    assert stage.take_log() == [(0.0, "right 4"), (0.0, "left 1")]
    assert stage.effects() == {("2-blind", "@world"): 2}
    assert stage.bus.dropped == {"blind": 2}
    await stage.obey(blind=blind(robot="left"))
    stage.sense("a")
    await stage.pause(0.0)
    assert stage.take_log() == [(0.0, "a 6")]


async def test_sensing_can_come_late_instead() -> None:
    """What came late is old news once the fault is over; a messenger drops it as such."""
    stage = Stage(speed=4.0)
    await stage.obey(blind=blind(delay=3.0))
    await stage.listen(KEYS.build(Kind.SENSE_TASK, task="a"))
    stage.sense()
    await stage.pause(1.0)
    stage.sense()
    await stage.pause(1.0)
    await stage.obey()
    stage.sense()
    await stage.pause(5.0)
    assert stage.take_log() == [(2.0, "a 5"), (3.0, "a 2"), (4.0, "a 3")]
    assert (stage.effects(), dict(stage.bus.dropped)) == ({("2-blind", "@world"): 2}, {})


@pytest.mark.parametrize(
    ("delay", "after", "answers", "dropped"),
    [(None, 0.0, ["x"], 2), (2.0, 2.0, ["a", "b", "x"], 0), (30.0, 10.0, ["x"], 2)],
    ids=["held back", "late", "later than one waits"],
)
async def test_answers_about_tasks_come_to_a_blind_robot_as_what_is_published_does(
    delay: float | None, after: float, answers: list[str], dropped: int
) -> None:
    """The timeout is real time, the delay mission time: at twice the speed 10 mission seconds make 5 real ones."""
    stage = Stage(speed=2.0)
    for task in "abx":
        key = KEYS.build(Kind.SENSE_TASK, task=task) if task != "x" else KEYS.build(Kind.STATUS)
        await stage.world.offer(key, lambda _, key=key: [Sample(key, key[-1:].encode())])  # type: ignore[misc]
    await stage.obey(blind=blind(delay=delay))
    found = await stage.bus.query("lalliance/m/**", timeout=5.0)
    assert sorted(sample.key for sample in found) == sorted(
        KEYS.build(Kind.SENSE_TASK, task=task) if task != "x" else KEYS.build(Kind.STATUS) for task in answers
    )
    assert stage.clock.now() == pytest.approx(after)
    assert stage.effects() == {("2-blind", "@world"): 2}
    assert stage.bus.dropped == ({"blind": dropped} if dropped else {})
    assert len(await stage.bus.query(KEYS.build(Kind.STATUS), timeout=5.0)) == 1


async def test_who_waits_for_late_answers_is_told_when_the_bus_closes() -> None:
    stage = Stage()
    key = KEYS.build(Kind.SENSE_TASK, task="a")
    await stage.world.offer(key, lambda _: [Sample(key, b"")])
    await stage.obey(blind=blind(delay=3.0))
    asking = asyncio.ensure_future(stage.bus.query(key, timeout=10.0))
    await stage.pause(1.0)
    await stage.bus.close()
    assert await asking == []
    assert stage.clock.now() == pytest.approx(1.0)
