"""What robots hear of one another fails: who is not heard is taken to have ceased, and only that."""

import math

import pytest
from support.bounds import attempts, slack, taken_in_time, takeover, takeovers

from lalliance_testing.launch import Launch

pytestmark = pytest.mark.lalliance(engine="both", speed=3)

SILENCES = """
name: silences
tasks: {p: {}, q: {}, s: {}, t: {}, u: {}, v: {}, w: {}, x: {}, y: {}}
robots:
  mute: {tasks: {p: 9}}
  listener: {tasks: {p: 14, q: 2}}
  deaf: {tasks: {s: 2, t: 14}}
  talker: {tasks: {t: 9}}
  cut-off: {tasks: {v: 9}}
  one-way: {tasks: {u: 2, v: 14}}              # does not hear `cut-off`, which hears it
  witness: {tasks: {w: 2, v: 16}}              # hears both
  west: {tasks: {x: 9}}
  east: {tasks: {y: 2, x: 14}}
knowledge: given
parameters: {strategy: I, silence_timeout: 2.0, min_delay: 0.1, max_delay: 0.4}
faults:
  - {at: 4, robot: mute, kind: mute}
  - {at: 4, robot: deaf, kind: deaf}
  - {at: 4, link: {from: cut-off, to: one-way}, cut: true}
deadline: 60
seed: 7
"""


def test_who_is_not_heard_for_tau_is_relieved_by_those_who_do_not_hear_it_and_by_nobody_else(
    lalliance_mission: Launch,
) -> None:
    mission = lalliance_mission(SILENCES)
    mission.wait_for("complete", task="y")
    split = mission.inject(partition=[["west"], ["ea*"]])
    parted = mission.wait_for("fault", fault=split)
    mission.wait_for("takeover", robot="east", task="x")
    mission.heal(split)
    mission.wait_for("fault_over", fault=split)
    summary = mission.finish()
    silent = {
        "p": ("mute", "listener", 4.0),
        "t": ("talker", "deaf", 4.0),
        "v": ("cut-off", "one-way", 4.0),
        "x": ("west", "east", parted.at),
    }
    for task, (former, taker, since) in silent.items():
        assert takeovers(summary, task) == [(former, taker, "silence")]
        assert attempts(summary, task) == [former, taker]
        assert taken_in_time(mission, takeover(summary, task), since)
        # Nobody was really gone: the work goes on, and the task is complete when it would have been.
        began = summary["tasks"][task]["attempts"][0]["at"]
        assert summary["tasks"][task]["completed_at"] - began == pytest.approx(9.0, abs=slack(mission))
    assert all(fault["fired"] and fault["count"] >= 5 for fault in summary["faults"])
    assert mission.faults()[split]["state"] == "over"


LINKS = """
name: links
tasks: {t1: {}, t2: {}, t3: {}, t4: {}, t5: {}, t6: {}, t7: {}}
robots:
  lossy: {tasks: {t1: 9}}
  bursty: {tasks: {t2: 9}}
  late: {tasks: {t3: 9}}
  uneven: {tasks: {t4: 9}}
  tailed: {tasks: {t5: 9}}
  double: {tasks: {t6: 9}}
  shuffled: {tasks: {t7: 9}}
  ear: {tasks: {t1: 14, t2: 14, t3: 14, t4: 14, t5: 14, t6: 14, t7: 14}}
knowledge: given
parameters: {strategy: I, silence_timeout: 2.0, min_delay: 0.1, max_delay: 0.4}
faults:
  - {at: 0, link: {from: lossy, to: ear}, loss: 0.3}
  - {at: 0, link: {from: bursty, to: ear}, loss: {enter: 0.3, leave: 0.7}}
  - {at: 0, link: {from: late, to: ear}, delay: 0.5}
  - {at: 0, link: {from: uneven, to: ear}, delay: {uniform: [0.05, 0.4]}}
  - {at: 0, link: {from: tailed, to: ear}, delay: {lognormal: {median: 0.2, sigma: 0.8}}}
  - {at: 0, link: {from: double, to: ear}, duplicate: 1.0}
  - {at: 0, link: {from: shuffled, to: ear}, reorder: 0.5, held: 0.5}
deadline: 60
seed: 7
"""


def test_links_that_are_only_bad_make_nobody_take_over(lalliance_mission: Launch) -> None:
    mission = lalliance_mission(LINKS)
    summary = mission.finish()
    assert summary["takeovers"] == []
    assert {task: attempts(summary, task) for task in mission.mission.tasks} == {
        "t1": ["lossy"], "t2": ["bursty"], "t3": ["late"], "t4": ["uneven"], "t5": ["tailed"], "t6": ["double"],
        "t7": ["shuffled"],
    }  # fmt: skip
    count = {fault["name"]: fault["count"] for fault in summary["faults"]}
    shares = {"1-link": 0.3, "2-link": 0.3, "3-link": 1, "4-link": 1, "5-link": 1, "6-link": 1, "7-link": 0.5}
    assert {name: is_about(count[name], share) for name, share in shares.items()} == dict.fromkeys(shares, True), count
    dropped = summary["messages"]["dropped"]
    assert dropped["link fault"] == count["1-link"] + count["2-link"]
    # Each second copy is stale, and what was held back comes after what was sent later.
    assert dropped["stale"] >= count["6-link"] + 0.5 * count["7-link"]


def is_about(count: int, share: float) -> bool:
    """Whether a rule may have touched `count` messages of one robot, of which it touches a share.

    The robot speaks five times a second, for the nine seconds of its task and perhaps two before and after.
    """
    spread = 4 * math.sqrt(50 * share * (1 - share))
    return 40 * share - spread <= count <= 60 * share + spread
