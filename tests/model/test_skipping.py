"""A driver that skips every step at which nothing changes gets the same decisions and messages, to the last bit."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from model.skipping import Driver, Scene, Skipper, World

from lalliance_agents.model.monitor import Record
from lalliance_agents.model.parameters import (
    Architecture,
    Erratum,
    HandSet,
    Learning,
    Ordering,
    Parameters,
    Reading,
    Strategy,
)

HORIZON = 9.0

tenths = st.integers(0, 90).map(lambda number: number / 10)
instants = st.one_of(tenths, st.floats(0.0, HORIZON))
#: Readings that allow to skip steps; the others make every step count.
QUIET = sorted(set(Erratum) - {Erratum.STRATEGY_ONE, Erratum.WINDOW_ENDS, Erratum.ONE_ACTIVE})
READINGS = st.one_of(
    st.just({}),
    st.dictionaries(st.sampled_from(QUIET), st.sampled_from(Reading), max_size=3),
    st.dictionaries(
        st.sampled_from(sorted({*QUIET, Erratum.WINDOW_ENDS, Erratum.ONE_ACTIVE})), st.just(Reading.LITERAL)
    ),
)
PARAMETERS = st.builds(
    Parameters,
    architecture=st.sampled_from(Architecture),
    strategy=st.sampled_from(Strategy),
    ordering=st.sampled_from(Ordering),
    min_delay=st.sampled_from([0.05, 0.2, 1.0]),
    broadcast_rate=st.sampled_from([3.0, 5.0, 10.0, 30.0]),
    threshold=st.sampled_from([0.5, 1.0, 3.0]),
    trials=st.integers(1, 3),
    initial_task_time=st.sampled_from([1.0, 5.0]),
    give_up_factor=st.sampled_from([0.5, 2.0]),
    collision_window=st.sampled_from([None, 0.0, 0.2]),
    by_hand=st.builds(
        HandSet,
        patience=st.sampled_from([1.0, 2.0]),
        slow_rate=st.just(0.3),
        yield_time=st.sampled_from([1.5, 5.0]),
        give_up_time=st.sampled_from([4.0, 9.0]),
    ),
    readings=READINGS,
)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    robots = [f"r{number}" for number in range(draw(st.integers(2, 5)))]
    tasks = [f"t{number}" for number in range(draw(st.integers(1, 5)))]
    times = st.one_of(st.integers(2, 50).map(lambda number: number / 10), st.floats(0.2, 5.0))
    abilities = {
        robot: {task: draw(times) for task in draw(st.lists(st.sampled_from(tasks), min_size=1, unique=True))}
        for robot in robots
    }
    pairs = [(robot, task) for robot in robots for task in abilities[robot]]
    period = draw(st.sampled_from([0.05, 0.1, 0.07, 0.13]))
    some_robots = st.lists(st.sampled_from(robots), unique=True, max_size=2)
    known = {
        task: {k: Record((draw(times),)) for k in robots if task in abilities[k] and draw(st.booleans())}
        for task in draw(st.lists(st.sampled_from(tasks), unique=True))
    }
    later = draw(st.lists(st.tuples(instants, st.sampled_from(Learning)), max_size=2))
    return Scene(
        abilities=abilities,
        parameters=draw(PARAMETERS),
        period=period,
        phases={robot: draw(st.sampled_from([0.0, 0.0, 0.01, period / 3])) for robot in robots},
        known=known,
        trials=((draw(st.sampled_from([0.0, 0.3])), draw(st.sampled_from(Learning))), *later),
        applicable=tuple(draw(st.lists(st.tuples(instants, st.sampled_from(tasks), st.booleans()), max_size=3))),
        failures=tuple(draw(st.lists(st.tuples(instants, st.sampled_from(robots)), max_size=3))),
        stuck=frozenset(draw(st.lists(st.sampled_from(pairs), max_size=3))),
        silent={robot: tuple(sorted((draw(instants), draw(instants)))) for robot in draw(some_robots)},
        dead_after={robot: draw(instants) for robot in draw(some_robots)} if draw(st.booleans()) else {},
        loss=draw(st.sampled_from([0.0, 0.0, 0.2, 0.7])),
        delay=draw(st.sampled_from([0.0, 0.02, 0.3, 2.5])),
        seed=draw(st.integers(0, 999)),
    )


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_a_driver_that_skips_steps_gets_the_same_decisions_and_messages(scene: Scene) -> None:
    every, few = World(scene, Driver).run(HORIZON), World(scene, Skipper).run(HORIZON)
    assert few.told() == every.told()
    assert few.ticks <= every.ticks


STEADY = Scene(
    {f"r{robot}": {f"t{task}": 6.0 + (robot * task) % 7 for task in range(6)} for robot in range(4)},
    Parameters(),
    period=0.05,
)


@pytest.mark.parametrize(("changes", "share"), [({}, 0.15), ({"loss": 0.02}, 0.15)])
def test_most_steps_are_skipped(changes: dict[str, float], share: float) -> None:
    """In a mission of 40 s with work to do, that is, in which robots decide, and are heard, all the time."""
    scene = Scene(**{**vars(STEADY), **changes})
    every, few = World(scene, Driver).run(40.0), World(scene, Skipper).run(40.0)
    assert few.told() == every.told()
    assert sum("Activate" in line for line in every.told().splitlines()) > 4
    assert few.ticks < share * every.ticks
