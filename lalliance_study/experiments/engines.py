"""What becomes of a contender in many missions.

A team of minds runs in the kernel where that can run it, else in the exact simulator; plans are carried out on the stage of
`queues`.
"""

import math
from typing import NamedTuple

import numpy as np

from lalliance_agents.errors import UserError
from lalliance_agents.model.events import Cause, Verb
from lalliance_agents.model.parameters import Parameters
from lalliance_study.assignments import Floats
from lalliance_study.baselines import BASELINES, repaired_optimum
from lalliance_study.experiments.yardsticks import Optima
from lalliance_study.kernel import RESULTS, run_missions
from lalliance_study.kernel_state import rules_of
from lalliance_study.queues import Outcome, carry_out
from lalliance_study.scenarios import Missions, Scenario, mission_of
from lalliance_study.simulator import Simulator


class Account(NamedTuple):
    """What came of some missions, one number for each; NaN where there is none."""

    makespan: Floats
    """In seconds; NaN: given up."""
    reallocations: Floats
    """Of minds: begun because a teammate was silent, too slow or gone; of plans: tasks given to another robot."""
    activations: Floats
    messages: Floats


def of_minds(scenario: Scenario, parameters: Parameters, missions: Missions) -> Account:
    """Of a team of minds with these parameters."""
    try:
        rules = rules_of(mission_of(scenario, parameters, missions, 0)[0])
    except UserError:  # what the kernel cannot run
        return by_the_simulator(scenario, parameters, missions)
    found = dict(zip(RESULTS, run_missions(rules, missions).T, strict=True))
    return Account(found["makespan"], found["takeovers"], found["activations"], found["sent"])


def by_the_simulator(scenario: Scenario, parameters: Parameters, missions: Missions) -> Account:
    """The same, far slower, for whatever there is. Its messages are counted otherwise, so that none are told."""
    rows = []
    for number in range(len(missions.able)):
        mission, circumstances = mission_of(scenario, parameters, missions, number)
        simulator = Simulator(mission, circumstances=circumstances)
        makespan = simulator.run()["makespan"]
        live = [line for line in simulator.log if line.at >= simulator.world.began]
        causes = [line.why for line in live if line.what == Verb.ACTIVATE.value]
        taken = sum(cause != Cause.FREE.value for cause in causes)
        rows.append((math.nan if makespan is None else makespan, taken, len(causes), math.nan))
    return Account(*np.array(rows, dtype=np.float64).T)


class Planners:
    """Carries out missions by the baselines' plans; what comes out the same is not done twice.

    Args:
        times: the own times, `[count, robots, tasks]` in seconds.
        optima: where the optimum's plans come from.
    """

    def __init__(self, times: Floats, optima: Optima) -> None:
        self._times = times
        self._planners = {**BASELINES, "optimum": repaired_optimum(optima)}
        self._known: dict[tuple[str, bytes, bool], Account] = {}

    def account(self, name: str, scenario: Scenario, missions: Missions) -> Account:
        """Of one of the baselines."""
        shares = scenario.hand_over != "restart" and bool(np.isfinite(missions.life).any())
        key = (name, missions.life.tobytes(), shares)
        if key not in self._known:
            self._known[key] = _account([self._outcome(name, scenario, missions, k) for k in range(len(self._times))])
        return self._known[key]

    def _outcome(self, name: str, scenario: Scenario, missions: Missions, number: int) -> Outcome:
        return carry_out(
            self._planners[name],
            self._times[number],
            lives=missions.life[number],
            hand_over=scenario.hand_over,
            seed=int(missions.chance[number, 0]),
        )


def _account(outcomes: list[Outcome]) -> Account:
    makespan = np.array([one.makespan for one in outcomes])
    none = np.full(len(outcomes), np.nan)
    reallocations = np.array([one.reallocations for one in outcomes], dtype=np.float64)
    return Account(np.where(np.isfinite(makespan), makespan, np.nan), reallocations, none, none)
