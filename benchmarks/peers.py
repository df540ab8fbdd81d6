"""The same missions in Mesa, in a plain loop of our own over all control steps, in the exact simulator, and in the kernel.

Mesa is a framework for models of agents; `mesa_team` is our model for it, with the minds and the tasks of all the others. Each
mission must find the same makespan in all four, and the same decisions at the same instants in the first three. Each task can
be done by 3 robots; mean task 200 control steps, given knowledge, strategy II, derived ordering; no faults. The kernel runs
these missions and many more of the kind. One thread each, CPU time; the fastest of several runs counts, one of each in turn,
as whatever else the machine does only slows a run down.

Of Mesa's time, its own is that of as many agents with nothing to do in as many steps; the minds' is that of the same calls to
the same minds, made once more without anything around them; the rest is the model: messages, tasks, and agents' steps.

    python benchmarks/peers.py [--json FILE] [--quick] [--runs N]
"""

import gc
import time
from collections.abc import Callable
from typing import Any

import mesa
from form import options, publish
from mesa_team import SAME, Team, compare, turns

from lalliance_agents.config import Mission
from lalliance_agents.model.events import Command, Event
from lalliance_agents.model.mind import Mind
from lalliance_agents.model.parameters import Parameters
from lalliance_study.circumstances import Circumstances
from lalliance_study.kernel import RESULTS, run_missions
from lalliance_study.kernel_state import Rules, rules_of
from lalliance_study.scenarios import Missions, Scenario, draw_missions, mission_of
from lalliance_study.simulator import Simulator

#: robots, tasks, missions, and how many of them the kernel runs besides
SHAPES = [(5, 10, 6, 4000), (10, 20, 4, 1500), (20, 40, 2, 500)]
QUICK = [(5, 10, 2, 400)]

#: The four, and those parts of Mesa's time that are measured.
DRIVERS = ("Mesa", "every step", "simulator", "kernel")
PARTS = ("framework", "minds")

Made = list[tuple[Mission, Circumstances]]


def in_mesa(made: Made) -> list[Team]:
    """Missions that Mesa has run."""
    teams = [Team(mission, circumstances) for mission, circumstances in made]
    for team in teams:
        team.run_model()
    return teams


def simulate(made: Made, *, every_step: bool) -> None:
    """Run missions in the simulator."""
    for mission, circumstances in made:
        Simulator(mission, circumstances=circumstances, every_step=every_step).run()


def check(made: Made, makespans: list[float]) -> None:
    """Hold all four against one another.

    Raises:
        SystemExit: they do not find the same.
    """
    for (mission, circumstances), makespan in zip(made, makespans, strict=True):
        for every_step in (False, True):
            run = Simulator(mission, circumstances=circumstances, every_step=every_step)
            difference = compare(Team(mission, circumstances), run)
            if difference is not None:
                raise SystemExit(difference)
        needed = run.world.makespan
        if needed is None or abs(needed - makespan) > SAME:
            raise SystemExit(f"the simulator needs {needed} s, the kernel {makespan} s")


class Idle(mesa.Agent):
    """An agent that does nothing, at the instants of a robot."""

    def __init__(self, model: mesa.Model, first: float) -> None:
        super().__init__(model)
        self.first = first

    def step(self) -> None:
        """Do nothing."""


class Nothing(mesa.Model):
    """As many agents as a team has, with nothing to do, for as many steps."""

    def __init__(self, team: Team) -> None:
        super().__init__(seed=0)
        self._left = team.steps
        for robot in team.robots.values():
            Idle(self, robot.first)
        self._turns = turns(self.agents, team.mission.control_period, team.timing.world_step)

    def step(self) -> None:
        """Have the agents step whose turn it is."""
        self._turns[(self.steps - 1) % len(self._turns)].do("step")
        self._left -= 1
        self.running = self._left > 0


class Overheard:
    """A mind whose calls are kept."""

    def __init__(self, mind: Mind, number: int, calls: list[tuple[int, str, tuple[Any, ...]]]) -> None:
        self._mind, self._number, self._calls = mind, number, calls

    def handle(self, event: Event, now: float) -> None:
        """See `Mind.handle`."""
        self._calls.append((self._number, "handle", (event, now)))
        self._mind.handle(event, now)

    def tick(self, now: float) -> list[Command]:
        """See `Mind.tick`."""
        self._calls.append((self._number, "tick", (now,)))
        return self._mind.tick(now)


def calls_of(made: Made) -> list[tuple[int, str, tuple[Any, ...]]]:
    """All that the minds of missions in Mesa are asked: the number of the mind, what, and with which arguments."""
    calls: list[tuple[int, str, tuple[Any, ...]]] = []
    number = 0
    for mission, circumstances in made:
        team = Team(mission, circumstances)
        for robot in team.robots.values():
            robot.mind = Overheard(robot.mind, number, calls)
            number += 1
        team.run_model()
    return calls


def replay(made: Made, calls: list[tuple[int, str, tuple[Any, ...]]]) -> float:
    """CPU time in which new minds answer the same calls, in seconds."""
    minds = [robot.mind for case in made for robot in Team(*case).robots.values()]
    deeds = [(getattr(minds[number], what), arguments) for number, what, arguments in calls]
    began = time.process_time()
    for deed, arguments in deeds:
        deed(*arguments)
    return time.process_time() - began


def taken(deed: Callable[[], object]) -> float:
    """CPU time that `deed` takes, in seconds."""
    began = time.process_time()
    deed()
    return time.process_time() - began


def least(made: Made, rules: Rules, missions: Missions, runs: int) -> dict[str, float]:
    """The least CPU time of several runs of each of the four, and of the parts of Mesa's, in seconds."""
    teams, calls = in_mesa(made), calls_of(made)
    gc.freeze()  # what is kept for later is not to be looked through in the time of anybody
    deeds: dict[str, Callable[[], object]] = {
        "Mesa": lambda: in_mesa(made),
        "every step": lambda: simulate(made, every_step=True),
        "simulator": lambda: simulate(made, every_step=False),
        "kernel": lambda: run_missions(rules, missions),
        "framework": lambda: [Nothing(team).run_model() for team in teams],
    }
    rounds = [
        {**{name: taken(deed) for name, deed in deeds.items()}, "minds": replay(made, calls)} for _ in range(runs)
    ]
    return {name: min(one[name] for one in rounds) for name in rounds[0]}


def row(robots: int, tasks: int, few: int, many: int, runs: int) -> list[dict[str, Any]]:
    """The figures of one size, a row for each of the four."""
    scenario = Scenario(robots=robots, tasks=tasks, coverage=3)
    missions = draw_missions(scenario, many)
    made = [mission_of(scenario, Parameters(), missions, number) for number in range(few)]
    rules = rules_of(made[0][0])
    makespans = run_missions(rules, missions)[:, RESULTS.index("makespan")]
    check(made, list(makespans[:few]))
    seconds = least(made, rules, missions, runs)
    shares = {part: seconds[part] / seconds["Mesa"] for part in PARTS}
    found: list[dict[str, Any]] = []
    for driver in DRIVERS:
        count = many if driver == "kernel" else few
        found.append(
            {
                "robots": robots,
                "tasks": tasks,
                "driven_by": driver,
                "missions": count,
                "cpu_seconds": seconds[driver],
                "missions_per_second": count / seconds[driver],
                "times_real_time": float(makespans[:count].sum()) / seconds[driver],
                "shares": {**shares, "model": 1 - sum(shares.values())} if driver == "Mesa" else None,
            }
        )
    for one in found:
        one["times_mesa"] = one["times_real_time"] / found[0]["times_real_time"]
    return found


def _share(part: str) -> Callable[[dict[str, Any]], str]:
    return lambda one: f"{one['shares'][part]:.0%}" if one["shares"] else ""


COLUMNS: dict[str, Callable[[dict[str, Any]], str]] = {
    "driven by": lambda one: one["driven_by"],
    "robots": lambda one: f"{one['robots']}",
    "tasks": lambda one: f"{one['tasks']}",
    "x real time": lambda one: f"{one['times_real_time']:,.0f}",
    "missions/s": lambda one: f"{one['missions_per_second']:,.1f}",
    "x Mesa": lambda one: f"{one['times_mesa']:,.2f}" if one["times_mesa"] < 10 else f"{one['times_mesa']:,.0f}",
    "Mesa's own": _share("framework"),
    "minds": _share("minds"),
    "model": _share("model"),
}


def main() -> None:
    """Run from the command line."""
    arguments = options(__doc__)
    arguments.add_argument("--runs", type=int, help="runs of each (default 8; with --quick 2)")
    chosen = arguments.parse_args()
    shapes, runs = (QUICK, 2) if chosen.quick else (SHAPES, 8)
    rows = [one for shape in shapes for one in row(*shape, chosen.runs or runs)]
    publish(
        "The same missions in Mesa and here, coverage 3, one thread",
        COLUMNS,
        rows,
        path=chosen.json,
        notes=["All find the same makespans; Mesa and the two simulators the same decisions at the same instants."],
        packages=["mesa", "numba"],
    )


if __name__ == "__main__":
    main()
