"""The study's scenarios, and the random missions of each: as arrays for the kernel, and one by one for the exact simulator.

A scenario is what section 4 of the paper varies, and every choice that the paper leaves open. Mission k of a scenario is a
function of the study's seed, the scenario's number and k alone: neither how many missions are made nor what a robot makes of
them changes it, so that every strategy sees the same missions. All that is drawn of it comes from one word of the state of
the scenario's `SeedSequence`, by a counter: draw number c is the finalizer of splitmix64 at word + c x golden ratio, which is
quick for many missions at once.

How the choices are read: a task's base time, uniform on 100 to 300 control steps, is that of the fastest robot able to do
it. A dying robot dies after an amount of work that is uniform up to the team's mean load. A trap lets each attempt get stuck
after a share of the robot's own time that is uniform on 0 to 1, half of the traps for ever and the others for 0 to 2 own
times. Of the robots able to do a task one survives, and its own trap, if it is in one, is not for ever.
"""

import math
import random
from collections.abc import Iterator
from itertools import chain
from itertools import count as counting
from typing import Literal, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lalliance_agents.config import EnvironmentChoice, Mission, Phase, RobotSpec, TaskSpec
from lalliance_agents.model.monitor import Record as Learned
from lalliance_agents.model.parameters import Learning, NotNegative, Parameters, Positive, Record
from lalliance_study.circumstances import Circumstances, Trap
from world_server.environments.task_pool import HandOver

Floats = NDArray[np.float64]
Spread: TypeAlias = Literal["unrelated", "related", "log_uniform"]

#: One control step, in seconds: the study's unit of time.
CONTROL_PERIOD = 0.1
#: Shortest and longest base time, in control steps.
BASE_STEPS = (100.0, 300.0)


class Scenario(Record):
    """One point of the study; 200 missions each."""

    robots: int = Field(ge=2, le=100)
    """n."""
    tasks: int = Field(ge=1, le=1000)
    """m."""
    coverage: int = Field(ge=1)
    """How many robots can do each task, at most all."""
    heterogeneity: NotNegative = 0.0
    """How much longer the slowest able robot takes than the fastest, in percent."""
    spread: Spread = "unrelated"
    """Times between fastest and slowest: uniform per task, one speed per robot, or log-uniform per task."""
    hand_over: HandOver = "shared_max"
    """What a second robot finds."""
    failures: float = Field(default=0.0, ge=0, le=1)
    """Probability that a robot dies."""
    traps: float = Field(default=0.0, ge=0, le=1)
    """Probability that a robot gets stuck at a task it can do (the paper's PWW is false)."""
    noise: float = Field(default=0.0, ge=0, lt=0.5)
    """Coefficient of variation of the samples that a robot is given, drawn uniformly; what it measures itself is exact."""
    samples: int = Field(default=10, ge=0, le=10)
    """Samples that a robot has, mu; 0: it knows nothing."""
    training: int = Field(default=0, ge=0, le=1000)
    """Trials of active learning before the mission, in which nobody dies or gets stuck."""
    cap: Positive = 4.0
    """A mission is given up after this many times the time in which one slow robot would do all the tasks."""

    @model_validator(mode="after")
    def _check_coverage(self) -> Self:
        if self.coverage > self.robots:
            raise ValueError(f"coverage {self.coverage} is more than the team has, which is {self.robots} robots")
        return self

    @property
    def deadline(self) -> float:
        """When a mission is given up, in seconds."""
        return self.cap * self.tasks * BASE_STEPS[1] * CONTROL_PERIOD * (1 + self.heterogeneity / 100)


class Missions(NamedTuple):
    """Missions of one size, `count` of them. Robots that can do nothing take no part. Times in seconds."""

    able: NDArray[np.int64]
    """Of each task the robots able to do it, in ascending order, -1 where there are no more: [count, tasks, width]."""
    own: Floats
    """The own time of each of them: [count, tasks, width]."""
    phase: Floats
    """When each robot makes its first control step, as a share of a step: [count, robots]."""
    draw: Floats
    """A number in [0, 1), the place of the task in the robot's random order: [count, tasks, width]."""
    life: Floats
    """How long each robot can work before it dies; infinite if it does not: [count, robots]."""
    trap_at: Floats
    """The share of its own time after which an attempt gets stuck; infinite if it does not: [count, tasks, width]."""
    trap_lasts: Floats
    """For how long; infinite: for ever: [count, tasks, width]."""
    known: Floats
    """Samples that each of those able has of each: [count, tasks, hearer, speaker, samples]."""
    chance: NDArray[np.uint64]
    """The word from which all comes that a robot draws after the first trial has begun: [count, robots]."""


class _Draws:
    """What is drawn for many missions at once: a block of counters for each purpose."""

    def __init__(self, seed: int, scenario: int, count: int) -> None:
        sequence = np.random.SeedSequence(seed, spawn_key=(scenario,))
        self._words = sequence.generate_state(count, np.uint64).astype(np.uint64)
        self._block = 0

    def words(self, *shape: int) -> NDArray[np.uint64]:
        """Words of 64 bits: [count, *shape]."""
        counters = np.arange(math.prod(shape), dtype=np.uint64) + np.uint64(self._block << 32)
        self._block += 1
        return _mixed(self._words[:, None], counters).reshape(len(self._words), *shape)

    def uniform(self, *shape: int) -> Floats:
        """Numbers in [0, 1): [count, *shape]."""
        return _unit(self.words(*shape))


def _mixed(word: NDArray[np.uint64], counter: NDArray[np.uint64]) -> NDArray[np.uint64]:
    mixed = word + counter * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed ^= mixed >> np.uint64(shift)
        mixed *= np.uint64(factor)
    mixed ^= mixed >> np.uint64(31)
    return mixed


def _unit(words: NDArray[np.uint64]) -> Floats:
    found: Floats = (words >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return found


def draw_missions(scenario: Scenario, count: int, *, seed: int = 0, number: int = 0) -> Missions:
    """The first `count` missions of a scenario.

    Args:
        scenario: the scenario.
        count: how many.
        seed: the study's seed.
        number: the scenario's number within the study.
    """
    draws = _Draws(seed, number, count)
    n, m, width = scenario.robots, scenario.tasks, scenario.coverage
    able = np.sort(np.argsort(draws.uniform(m, n), axis=-1)[..., :width], axis=-1)
    low, high = (steps * CONTROL_PERIOD for steps in BASE_STEPS)
    base = low + (high - low) * draws.uniform(m)
    own = base[..., None] * _factors(scenario, draws, able)
    phase, draw = draws.uniform(n), draws.uniform(m, width)
    survivor = (draws.uniform(m) * width).astype(np.int64)
    life = _lives(scenario, draws, able, own, survivor)
    trap_at, trap_lasts = _traps(scenario, draws, own, survivor)
    known = np.repeat(own[:, :, None, :, None], width, axis=2).repeat(scenario.samples, axis=-1)
    if scenario.noise > 0.0:
        known *= 1 + scenario.noise * math.sqrt(3) * (2 * draws.uniform(*known.shape[1:]) - 1)
    return Missions(able, own, phase, draw, life, trap_at, trap_lasts, known, draws.words(n))


def _factors(scenario: Scenario, draws: _Draws, able: NDArray[np.int64]) -> Floats:
    """How much longer each robot takes than the fastest: [count, tasks, width]."""
    ratio = 1 + scenario.heterogeneity / 100
    if scenario.spread == "related":
        speeds = _between(draws.uniform(scenario.robots), draws.uniform(scenario.robots), ratio, logarithmic=False)
        return np.take_along_axis(speeds[:, None, :], able, axis=-1)
    shape = able.shape[1:]
    return _between(draws.uniform(*shape), draws.uniform(*shape), ratio, logarithmic=scenario.spread == "log_uniform")


def _between(order: Floats, share: Floats, ratio: float, *, logarithmic: bool) -> Floats:
    """Of each row one is 1, one is `ratio`, and the others lie between; a row of one is 1."""
    factors = ratio**share if logarithmic else 1 + (ratio - 1) * share
    np.put_along_axis(factors, order.argmax(-1)[..., None], ratio, axis=-1)
    np.put_along_axis(factors, order.argmin(-1)[..., None], 1.0, axis=-1)
    return factors


def _lives(
    scenario: Scenario, draws: _Draws, able: NDArray[np.int64], own: Floats, survivor: NDArray[np.int64]
) -> Floats:
    """Work before death, in seconds: [count, robots]. Of each task its survivor lives."""
    dies, share = draws.uniform(scenario.robots) < scenario.failures, draws.uniform(scenario.robots)
    load = own.mean(-1).sum(-1, keepdims=True) / scenario.robots
    life = np.where(dies, share * load, np.inf)
    if scenario.failures > 0.0:
        lives = np.take_along_axis(able, survivor[..., None], axis=-1)[..., 0]
        # A survivor is needed only where all others die; tasks are looked at one after the other.
        for task in range(scenario.tasks):
            doomed = (np.take_along_axis(life, able[:, task], axis=-1) < np.inf).all(-1)
            life[doomed, lives[doomed, task]] = np.inf
    return life


def _traps(scenario: Scenario, draws: _Draws, own: Floats, survivor: NDArray[np.int64]) -> tuple[Floats, Floats]:
    shape = own.shape[1:]
    trapped, share = draws.uniform(*shape) < scenario.traps, draws.uniform(*shape)
    lasts, for_ever = 2 * own * draws.uniform(*shape), draws.uniform(*shape) < 0.5
    np.put_along_axis(for_ever, survivor[..., None], values=False, axis=-1)
    return np.where(trapped, share, np.inf), np.where(for_ever, np.inf, lasts)


# --- for the exact simulator


def _stream(word: np.uint64) -> Iterator[float]:
    """The draws of a word, one after the other."""
    for block in counting():
        counters = np.arange(block << 10, (block + 1) << 10, dtype=np.uint64)
        yield from map(float, _unit(_mixed(np.array([word]), counters)))


class _Scripted(random.Random):
    """Draws what it is told to, and no more."""

    def __init__(self, numbers: Iterator[float]) -> None:
        super().__init__()
        self._numbers = numbers

    def random(self) -> float:
        """The next number."""
        return next(self._numbers)


def mission_of(
    scenario: Scenario, parameters: Parameters, missions: Missions, number: int
) -> tuple[Mission, Circumstances]:
    """Mission `number` of `missions` for the exact simulator, with robots that have `parameters`."""
    able, own = missions.able[number], missions.own[number]
    spelled = [f"r{robot:02}" for robot in range(scenario.robots)]
    pairs = [(task, place, spelled[robot]) for task, row in enumerate(able) for place, robot in enumerate(row)]
    tasks: dict[str, dict[str, float]] = {name: {} for name in spelled}
    for task, place, name in pairs:
        tasks[name][f"t{task:02}"] = float(own[task, place])
    mission = Mission(
        name="scenario",
        environment=EnvironmentChoice.model_validate({"kind": "task_pool", "hand_over": scenario.hand_over}),
        tasks={f"t{task:02}": TaskSpec() for task in range(scenario.tasks)},
        robots={name: RobotSpec(tasks=times) for name, times in tasks.items() if times},
        parameters=parameters,
        phases=_phases(scenario),
        control_period=CONTROL_PERIOD,
        deadline=scenario.deadline,
    )
    return mission, _circumstances(missions, number, spelled, pairs)


def _phases(scenario: Scenario) -> tuple[Phase, ...]:
    live = Phase(learning=Learning.ADAPTIVE)
    return (Phase(learning=Learning.ACTIVE, trials=scenario.training), live) if scenario.training else (live,)


def _circumstances(
    missions: Missions, number: int, spelled: list[str], pairs: list[tuple[int, int, str]]
) -> Circumstances:
    trap_at, lasts, own = missions.trap_at[number], missions.trap_lasts[number], missions.own[number]
    learned: dict[str, dict[str, dict[str, Learned]]] = {name: {} for name in spelled}
    for task, hearer, name in pairs:
        learned[name][f"t{task:02}"] = {
            spelled[missions.able[number, task, speaker]]: Learned(tuple(map(float, samples)))
            for speaker, samples in enumerate(missions.known[number, task, hearer])
        }

    def chance(_: Mission, name: str, __: int) -> random.Random:
        row = [float(missions.draw[number, task, place]) for task, place, robot in pairs if robot == name]
        first = float(missions.phase[number, spelled.index(name)])
        word = missions.chance[number, spelled.index(name)]
        return _Scripted(chain([*row, first, *row], _stream(word)))

    return Circumstances(
        learned=learned if missions.known.shape[-1] else {},
        lives={name: float(life) for name, life in zip(spelled, missions.life[number], strict=True) if life < math.inf},
        traps={
            (name, f"t{task:02}"): Trap(float(trap_at[task, place] * own[task, place]), float(lasts[task, place]))
            for task, place, name in pairs
            if trap_at[task, place] < math.inf
        },
        chance_of=chance,
    )
