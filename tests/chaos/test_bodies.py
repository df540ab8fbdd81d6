"""Bodies that are held up and senses that fail, while the robots go on talking: what patience and acquiescence make of it."""

import pytest
from support.bounds import attempts, slack, takeover, takeovers

from lalliance_testing.launch import Launch

pytestmark = pytest.mark.lalliance(engine="both", speed=3)

BODIES = """
name: bodies
tasks: {a: {}, c: {}, e: {}, f: {}, g: {}, h: {}, k: {}, m: {}, n: {}, clock: {}}
robots:
  stuck: {tasks: {a: 6}}
  patient: {tasks: {a: 8, c: 2}}
  picky: {tasks: {e: 6, f: 3}}                 # stuck at e, but not at f
  helper: {tasks: {e: 7, g: 2}}
  lonely: {tasks: {h: 3}}                      # stuck, and nobody can help
  slow: {tasks: {k: 6}}
  blind: {tasks: {m: 4}}
  tardy: {tasks: {n: 4}}
  timer: {tasks: {clock: 16}}
knowledge: given
parameters: {strategy: I, silence_timeout: 2.0, min_delay: 0.1, max_delay: 0.4}
faults:
  - {at: 1.5, robot: stuck, kind: stuck}
  - {at: 0, robot: picky, kind: stuck, task: e}
  - {at: 0, robot: lonely, kind: stuck}
  - {at: 0, robot: slow, kind: slow, factor: 1.5}
  - {at: 2, until: 6, robot: blind, kind: blind}
  - {at: 2, robot: tardy, kind: blind, delay: 1.5}
deadline: 60
seed: 7
"""


def test_patience_helps_the_stuck_and_nothing_is_done_twice_for_the_blind(lalliance_mission: Launch) -> None:
    mission = lalliance_mission(BODIES)
    period, late = mission.mission.control_period, slack(mission)
    given_up = mission.wait_for("give_up", robot="lonely", task="h", cause="no_success")
    mission.heal("3-stuck")
    summary = mission.finish()
    began = {task: summary["tasks"][task]["attempts"][0]["at"] for task in mission.mission.tasks}
    done = {task: record["completed_at"] for task, record in summary["tasks"].items()}

    # Stuck: impatience takes the task over when phi, here the own time, has passed; the stuck one yields to the contender.
    for task, former, taker, phi in (("a", "stuck", "patient", 8.0), ("e", "picky", "helper", 7.0)):
        assert takeovers(summary, task) == [(former, taker, "impatience")]
        one = takeover(summary, task)
        assert phi - late <= one["taken_at"] - began[task] <= phi + one["delay"] + 2 * period + late
        assert [event.cause for event in mission.happened("yield", robot=former, task=task)] == ["contender"]
        assert summary["tasks"][task]["by"][-1] == taker
    assert summary["tasks"]["f"]["by"] == ["picky"]

    # Stuck without a contender: given up after lambda, twice the own time; once healed, it succeeds.
    assert given_up.at - began["h"] == pytest.approx(2 * 3.0, abs=2 * period + late)
    assert set(attempts(summary, "h")) == {"lonely"}

    # Slow: six seconds of work take nine.
    assert done["k"] - began["k"] == pytest.approx(6 * 1.5, abs=late)

    # Blind: the task is complete in the world; its robot learns that when the fault is over, or so much later.
    [sensed] = mission.happened("sense_complete", robot="blind", task="m")
    assert done["m"] - began["m"] == pytest.approx(4.0, abs=late)
    assert 6.0 - late <= sensed.at <= 6.0 + 1.0 + 2 * period + late
    [sensed] = mission.happened("sense_complete", robot="tardy", task="n")
    assert sensed.at - done["n"] == pytest.approx(1.5 + period, abs=period + late)
    assert [fault["fired"] for fault in summary["faults"]] == [True] * 6
