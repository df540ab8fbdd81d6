"""Processes that crash and hang: who is silent for tau has its task taken over, and who comes back does not disturb."""

import pytest
from support.bounds import attempts, slack, taken_in_time, takeover, takeovers

from lalliance_testing.launch import Launch

pytestmark = pytest.mark.lalliance(engine="both", speed=3)

CRASHES = """
name: crashes
tasks: {a: {}, b: {}, c: {}, d: {}, late: {arrives: 13}}
robots:                                        # the reserves are slower, and free once they have done their own task
  returner: {tasks: {a: 12, late: 3}}
  goner: {tasks: {b: 12}}
  reserve-a: {tasks: {a: 14, c: 2}}
  reserve-b: {tasks: {b: 14, d: 2}}
knowledge: given
parameters: {strategy: I, silence_timeout: 2.0, min_delay: 0.1, max_delay: 0.4}
faults: [{at: 5, robot: goner, kind: crash}]
deadline: 60
seed: 7
"""


def test_the_tasks_of_crashed_robots_are_taken_over_after_tau_and_who_is_restarted_works_again(
    lalliance_mission: Launch,
) -> None:
    mission = lalliance_mission(CRASHES)
    mission.wait_for("complete", task="c")
    crash = mission.inject(kind="crash", robot="returner", lasts=5)
    gone = mission.wait_for("gone", robot="returner")
    mission.wait_for("takeover", robot="reserve-a", other="returner", task="a")
    back = mission.wait_for("present", robot="returner")
    assert back.at - gone.at >= 5 - slack(mission)
    # The killed life said that it was on `a`; the new one, in a new incarnation, is believed when it says that it is not.
    summary = mission.finish()
    assert takeovers(summary, "a") == [("returner", "reserve-a", "silence")]
    assert takeovers(summary, "b") == [("goner", "reserve-b", "silence")]
    for task in ("a", "b"):
        one = takeover(summary, task)
        assert taken_in_time(mission, one, one["failed_at"])
    assert attempts(summary, "a") == ["returner", "reserve-a"]
    assert summary["tasks"]["late"]["by"] == ["returner"]
    assert summary["tasks"]["b"]["by"] == ["goner", "reserve-b"] or summary["tasks"]["b"]["by"] == ["reserve-b"]
    assert [(fault["text"], fault["fired"], fault["count"]) for fault in summary["faults"]] == [
        ("crash of goner", True, 1),
        ("crash of returner", True, 1),
    ]
    assert mission.faults()[crash]["state"] == "over"


HANGS = """
name: hangs
tasks: {a: {}, b: {}, c: {}, d: {}, e: {}, clock: {}}
robots:
  ghost: {tasks: {a: 9}}
  reserve-a: {tasks: {a: 16, c: 2}}
  dozer: {tasks: {b: 10}}                      # hangs shorter than tau
  sleeper: {tasks: {e: 10}}                    # hangs for good
  reserve: {tasks: {b: 14, d: 2, e: 12}}
  timer: {tasks: {clock: 12}}
knowledge: given
parameters: {strategy: I, silence_timeout: 2.0, min_delay: 0.1, max_delay: 0.4}
faults:
  - {at: 4, until: 4.6, robot: dozer, kind: hang}
  - {at: 6, robot: sleeper, kind: hang}
deadline: 60
seed: 7
"""


def test_who_hangs_longer_than_tau_loses_its_task_and_its_ghost_yields_when_it_returns(
    lalliance_mission: Launch,
) -> None:
    mission = lalliance_mission(HANGS)
    mission.wait_for("complete", task="c")
    hang = mission.inject(kind="hang", robot="ghost")
    hung = mission.wait_for("fault", fault=hang)
    mission.wait_for("takeover", robot="reserve-a", other="ghost", task="a")
    mission.wait_for("complete", task="clock")
    mission.heal(hang)
    # It was on the task for more than psi, as it sees it, and hears that another one is.
    mission.wait_for("yield", robot="ghost", task="a", cause="contender", other="reserve-a")
    summary = mission.finish()
    assert takeovers(summary, "a") == [("ghost", "reserve-a", "silence")]
    # Its body may have gone on for the moment that it took to hear the other one.
    ends = {(one["robot"], one["ended"]) for one in summary["tasks"]["a"]["attempts"]}
    assert ends - {("ghost", "lost"), ("ghost", "contender")} <= {("reserve-a", "complete")}
    assert attempts(summary, "a").count("reserve-a") == 1
    assert summary["tasks"]["a"]["by"] == ["reserve-a"]
    assert taken_in_time(mission, takeover(summary, "a"), hung.at)
    assert takeovers(summary, "b") == []
    assert attempts(summary, "b") == ["dozer"]
    assert takeovers(summary, "e") == [("sleeper", "reserve", "silence")]
    assert taken_in_time(mission, takeover(summary, "e"), 6.0)
    assert all(fault["fired"] for fault in summary["faults"])
