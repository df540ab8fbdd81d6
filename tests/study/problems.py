"""Tables of times for tests: drawn by hypothesis, drawn by a seed, and solved by trying everything."""

import math
from itertools import product

import numpy as np
from hypothesis import strategies as st

from lalliance_agents.config import Mission
from lalliance_study.assignments import Floats


@st.composite
def tables(draw: st.DrawFn, robots: int = 3, tasks: int = 6) -> Floats:
    """Times of up to so many robots and tasks, `[robots, tasks]`; few different ones, so that equals occur, or many."""
    count, width = draw(st.integers(1, robots)), draw(st.integers(1, tasks))
    short = st.sampled_from([1.0, 2.0, 3.0, 5.0])
    time = draw(st.sampled_from([short, st.floats(0.5, 50.0), st.just(7.0)]))
    found = np.full((count, width), math.inf)
    for task in range(width):
        for robot in draw(st.sets(st.integers(0, count - 1), min_size=1)):
            found[robot, task] = draw(time)
    return found


def drawn(seed: int, robots: int, tasks: int, coverage: int, heterogeneity: float) -> Floats:
    """A table after the study's rules; heterogeneity 1 is 100 %: the slowest takes twice as long as the fastest."""
    chance = np.random.default_rng(seed)
    found = np.full((robots, tasks), math.inf)
    for task in range(tasks):
        able = chance.choice(robots, coverage, replace=False)
        factors = np.concatenate([[1.0, 1 + heterogeneity], chance.uniform(1, 1 + heterogeneity, coverage)])[:coverage]
        found[able, task] = chance.uniform(100, 300) * factors
    return found


def best_of_all(times: Floats, ready: Floats | None = None) -> float:
    """The optimum of HRASP by trying all assignments, in seconds."""
    able = [np.flatnonzero(np.isfinite(column)) for column in times.T]
    ways = np.array(list(product(*able)))
    loads = np.zeros((len(ways), len(times))) + (0.0 if ready is None else ready)
    for task in range(times.shape[1]):
        loads[np.arange(len(ways)), ways[:, task]] += times[ways[:, task], task]
    return float(loads.max(axis=1).min())


def mission_of(times: Floats, **environment: object) -> Mission:
    """A mission with these times: robots r0, r1, ..., and tasks t0, t1, ...; a robot that can do nothing is left out."""
    robots = {
        f"r{number}": {"tasks": {f"t{task}": float(time) for task, time in enumerate(row) if np.isfinite(time)}}
        for number, row in enumerate(times)
        if np.isfinite(row).any()
    }
    return Mission.model_validate(
        {
            "name": "test",
            "deadline": 1e9,
            "environment": {"kind": "task_pool", **environment},
            "tasks": {f"t{task}": {} for task in range(times.shape[1])},
            "robots": robots,
        }
    )
