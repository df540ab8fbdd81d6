"""Each failure, of a robot or of the radio: who notices it, how, and after how long.

Three robots can do two tasks: the first works on the one that it is best at, the second on the other, the third is free. A
long task for the second follows, so that there is time for what comes late. Something befalls the first in the middle of its
work. What the team makes of that is the first start, yield or end of an attempt of which the same mission without the fault,
with the same seed, knows nothing; until the fault both are the same to the last byte.
"""

import math
import random
from typing import Any

from lalliance_agents.config import Mission
from lalliance_study.detection.probe import RATE
from lalliance_study.detection.rows import Reaction
from lalliance_study.logbook import Line
from lalliance_study.simulator import Simulator

VICTIM = "first"
#: Own times at the tasks, in seconds.
OWN_TIMES = {"first": (20.0, 40.0), "second": (30.0, 25.0), "third": (35.0, 45.0)}
LAST_TIME = 60.0
#: When the fault comes, in seconds: after about a tenth to three quarters of the victim's work.
COMES = 3.0, 15.0
TAU_RHO = 5.0
DEADLINE = 400.0

FAULTS: dict[str, dict[str, Any]] = {
    "crash": {"kind": "crash", "robot": VICTIM},
    "crash, back after 5 s": {"kind": "crash", "robot": VICTIM, "restart": True},
    "hang": {"kind": "hang", "robot": VICTIM},
    "stuck": {"kind": "stuck", "robot": VICTIM},
    "slow ×4": {"kind": "slow", "factor": 4.0, "robot": VICTIM},
    "mute": {"kind": "mute", "robot": VICTIM},
    "deaf": {"kind": "deaf", "robot": VICTIM},
    "blind": {"kind": "blind", "robot": VICTIM},
    "loss of 30 %": {"link": {}, "loss": 0.3},
    "bursts, 30 %": {"link": {}, "loss": {"enter": 3 / 35, "leave": 0.2}},
    "late by 0.05 to 0.4 s": {"link": {}, "delay": {"uniform": [0.05, 0.4]}},
    "disorder of 10 %": {"link": {}, "duplicate": 0.1, "reorder": 0.1},
    "cut from it to a free robot": {"link": {"from": VICTIM, "to": "third"}, "cut": True},
    "partition from the others": {"partition": [[VICTIM], ["second", "third"]]},
}
"""What befalls, and for good but for the crash with a return: the first robot, or what robots hear of one another."""


def scene(seed: int, fault: str | None) -> Mission:
    """The mission, with a fault from `FAULTS` or without."""
    at = round(random.Random(seed).uniform(*COMES), 3)
    able = {name: {"left": left, "right": right} for name, (left, right) in OWN_TIMES.items()}
    able["second"]["last"] = LAST_TIME
    return Mission.model_validate(
        {
            "name": "scene",
            "tasks": {"left": {}, "right": {}, "last": {"after": ["left", "right"]}},
            "robots": {name: {"tasks": times} for name, times in able.items()},
            "knowledge": "given",
            "parameters": {
                "min_delay": 0.1,
                "max_delay": 0.5,
                "broadcast_rate": RATE,
                "silence_timeout": TAU_RHO / RATE,
            },
            "faults": [] if fault is None else [FAULTS[fault] | {"at": at}],
            "deadline": DEADLINE,
            "seed": seed,
        }
    )


def reaction(seed: int, fault: str) -> Reaction:
    """How the team took `fault`."""
    healthy, failing = Simulator(scene(seed, None)), Simulator(scene(seed, fault))
    silent: list[float] = []

    def look() -> None:
        """Note when the victim was first counted as silent; every teammate that has noticed still does."""
        for name, member in failing.members.items():
            heard = member.mind.hearing.presences.get(VICTIM) if name != VICTIM and member.runs else None
            if heard is not None and heard.absent:
                silent.append(heard.lapsed_at)

    for second in range(1, int(COMES[1]) + 5):
        failing.call_at(float(second), look)
    without, made = healthy.run(), failing.run()
    came = next(line.at for line in failing.log if line.what == "fault")
    first = _first_of_its_own(failing.log, healthy.log, came)
    return Reaction(
        fault=fault,
        seed=seed,
        silent=min(silent, default=math.nan) - came,
        decided=math.nan if first is None else first.at - came,
        who="nobody" if first is None else ("itself" if first.who == VICTIM else "teammate"),
        what="" if first is None else f"{first.what}: {first.why}",
        delay=(made["makespan"] or math.nan) - without["makespan"],
    )


def _first_of_its_own(log: list[Line], other: list[Line], since: float) -> Line | None:
    """The first decision in `log` after `since` that is not in `other`."""
    # That `last` begins later is no reaction, but what the fault has cost.
    known, decisions = set(other), {"activate", "yield", "give_up", "drop"}
    made = (line for line in log if line.at >= since and line.what in decisions and line.task != "last")
    return next((line for line in made if line not in known), None)
