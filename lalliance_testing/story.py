"""What a failed test tells of a mission: its seed and how to repeat it, and what happened last."""

import json
import shlex
from pathlib import Path

from lalliance_testing.running import RunningMission

#: Events that are told: the last ones.
TOLD = 40
#: A silence timeout shorter than this, in real seconds, is at the mercy of the machine's scheduling.
SHORTEST_SILENCE = 0.15


def tell(running: RunningMission, path: Path, nodeid: str) -> tuple[str, str]:
    """The title and the text of a section of a report."""
    mission, real = running.mission, running.engine == "real"
    speed = f", speed {running.speed:g}" if real else ""
    title = f"lalliance mission {mission.name} ({running.engine}, seed {mission.seed}{speed})"
    lines = [str(event) for event in running.events]
    left_out = len(lines) - TOLD
    story = [f"… {left_out} earlier events", *lines[-TOLD:]] if left_out > 0 else lines or ["nothing has happened"]
    options = f"--seed {mission.seed}" + (f" --speed {running.speed:g}" if real else " --events")
    command = f"lalliance {'run' if real else 'simulate'} {shlex.quote(str(path))} {options}"
    again = f"--lalliance-seed {mission.seed}" + (f" --lalliance-speed {running.speed:g}" if real else "")
    notes = [f"To repeat it: pytest {shlex.quote(nodeid)} {again}", f"The mission alone: {command}"]
    if injected := running.injected():
        notes.append("with the faults that the test injected, as lines of its faults:")
        notes += [f"  - {json.dumps(fault)}" for fault in injected]
    silence = min(mission.parameters_of(robot).silence_timeout for robot in mission.robots) / running.speed
    if real and silence < SHORTEST_SILENCE:
        notes.append(
            f"At this speed {silence:.2g} real seconds of silence are a failure; a busy machine may see some that are none."
        )
    return title, "\n".join([*story, "", *notes])
