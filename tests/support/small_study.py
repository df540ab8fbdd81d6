"""A study small enough for tests, of planners alone, so that nothing is compiled; as a module it is carried out.

python -m support.small_study DIR JOBS
"""

import sys
from pathlib import Path

from lalliance_study.experiments.contenders import baseline
from lalliance_study.experiments.plan import Experiment, Grid, Yardsticks
from lalliance_study.experiments.presets import DYING, PLAIN, Preset
from lalliance_study.experiments.runner import HandOut, here, open_study, run

SMALL = Preset(
    "small",
    "planners with and without deaths",
    24,
    (
        Experiment(
            "dear",
            "Does the optimum help?",
            (Grid(((6, 12, 4),), (100.0,), circumstances=(PLAIN, DYING)),),
            tuple(map(baseline, ("random", "lpt", "optimum"))),
            Yardsticks(work_limit=1.0, shared=True),
            part=1,
        ),
        Experiment("cheap", "Does the rest?", (Grid(((3, 5, 2),), (400.0,)),), (baseline("auction"),), share=0.25),
    ),
)


def carry_out(out: Path, hand_out: HandOut) -> list[int]:
    """Run what is left of the small study; the numbers of rows that came."""
    came: list[int] = []
    run(open_study(out, SMALL, seed=3), hand_out, came.append)
    return came


if __name__ == "__main__":
    carry_out(Path(sys.argv[1]), here(int(sys.argv[2])))
