"""A driver that skips every step at which nothing changes gets the same decisions and messages, to the last bit."""

from math import inf

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from model.skipping import Driver, Scene, Skipper, World

from lalliance_agents.model.events import Activate, Heard, RosterKnown, Sensed
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.monitor import Record
from lalliance_agents.model.outlook import AT_ONCE
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
    silence_timeout=st.sampled_from([0.7, 1.0]),
    boredom_rate=st.sampled_from([None, 0.1]),
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


def test_a_skipped_step_does_not_hide_that_an_idle_teammate_has_died() -> None:
    """B, which is better at x, dies before it starts; a is not bored before 10 s, and expects to be best from then on."""
    scene = Scene(
        {"a": {"x": 4.0}, "b": {"x": 2.0}},
        Parameters(min_delay=1.0, boredom_rate=0.1),
        known={"x": {"a": Record((4.0,)), "b": Record((2.0,))}},
        dead_after={"b": 0.55},
    )
    every, few = World(scene, Driver).run(HORIZON), World(scene, Skipper).run(HORIZON)
    assert few.told() == every.told()
    started = next(at for at, robot, what in few.log if robot == "a" and isinstance(what, Activate))
    assert started == pytest.approx(2.5, abs=0.11)


# --- what a mind wants


def mind(*tasks: str, roster: frozenset[str] = frozenset(), **changes: object) -> Mind:
    """A mind at 0, told of its tasks and its roster, that is better at all of them than the teammate it knows."""
    made = Mind("me", tasks, Parameters(**changes), now=0.0, draw=lambda: 0.5)  # type: ignore[arg-type]
    made.knowledge.restore({task: {"me": Record((5.0,)), "a": Record((9.0,))} for task in tasks})
    made.handle(RosterKnown(roster), 0.0)
    for task in tasks:
        made.handle(Sensed(task, applicable=True, complete=False), 0.0)
    return made


def settled(made: Mind, *events: Heard) -> Mind:
    """The mind after `events` and two steps, at 0.1 and 0.2."""
    for event in events:
        made.handle(event, 0.0)
    made.tick(0.1)
    made.tick(0.2)
    return made


def test_a_mind_wakes_when_its_motivation_reaches_the_threshold() -> None:
    """After a delay of 1 s since its first step, less the slack of the comparison and a little to be early."""
    one = mind("x", ordering=Ordering.LONGEST_FIRST, min_delay=1.0)
    assert one.wake() == AT_ONCE, "before the first tick"
    one.tick(0.0)
    assert one.wake() == AT_ONCE, "in a step without length nothing has grown yet"
    one.tick(0.1)
    assert one.wake() == pytest.approx(1.0, abs=1e-5)
    assert 1.0 - 1e-5 < one.wake() < 1.0


def test_a_mind_that_is_best_at_nothing_wakes_when_it_is_bored() -> None:
    one = settled(mind("x", roster=frozenset({"a"})), Heard("a", None), Heard("b", "x", 0.0, 3.0))
    assert one.factors()["x"].category == 2
    assert one.wake() == pytest.approx(1.2, abs=1e-5)
    assert one.next_lapse() == pytest.approx(1.0, abs=1e-5)


def test_a_mind_that_waits_for_its_roster_wakes_after_tau() -> None:
    assert settled(mind("x", roster=frozenset({"a"}))).wake() == pytest.approx(1.0, abs=1e-5)


def test_a_mind_at_work_wakes_to_give_up_and_one_with_nothing_to_do_never() -> None:
    one = mind("x", ordering=Ordering.LONGEST_FIRST)
    started = next(step / 10 for step in range(20) if one.tick(step / 10) and one.active)
    assert one.wake() == pytest.approx(started + 10.0, abs=1e-5)
    one.handle(Sensed("x", applicable=False, complete=True), 2.0)
    assert one.wake() == AT_ONCE
    for step in range(30):
        one.tick(2.0 + step / 10)
    assert one.wake() == one.next_lapse() == inf


@pytest.mark.parametrize(
    ("event", "refreshes"),
    [
        (Heard("a", "x", 0.5, 9.0), True),
        (Heard("a", "x", 0.0, 9.0), True),
        (Heard("a", "x", 0.5, 8.0), False),  # expects another time
        (Heard("a", "x", -0.5, 9.0), False),  # nonsense
        (Heard("a", "y", 0.5, 9.0), False),
        (Heard("a", None), False),
        (Heard("b", None), True),
        (Heard("b", "z", 0.5, 9.0), True),  # on a task that this robot cannot do: as if idle
        (Heard("b", "x", 0.5, 9.0), False),
        (Heard("c", None), False),  # never heard before
        (Heard("me", "x"), False),  # its own echo, which says nothing
    ],
)
def test_a_refresh_only_goes_on_with_what_was_heard(event: Heard, refreshes: bool) -> None:
    one = settled(mind("x", "y"), Heard("a", "x", 0.0, 9.0), Heard("b", None))
    wanted = one.wake()
    assert wanted > 0.2
    assert one.is_refresh(event, 0.5) is refreshes
    one.handle(event, 0.5)
    if refreshes or event.robot == "me":
        assert one.wake() == wanted
    elif event == Heard("a", None):
        assert one.wake() == wanted, "this robot is to do x itself before it is judged what became of a there"
    else:
        assert one.wake() == AT_ONCE


def test_a_message_after_a_silence_or_of_a_second_attempt_is_no_refresh() -> None:
    one = settled(mind("x", "y"), Heard("a", "x", 0.0, 9.0), Heard("b", None))
    one.handle(Heard("a", "x", 0.5, 9.0), 0.5)
    assert not one.is_refresh(Heard("a", "x", 0.1, 9.0), 0.6)
    one.tick(1.3)
    assert not one.is_refresh(Heard("b", None), 1.4)
    assert one.is_refresh(Heard("a", "x", 1.4, 9.0), 1.4)
