"""A robot that works and is listened to: how often it is taken to be silent while it lives, how soon when it has died.

One speaker works on a task for as long as the mission lasts. Each of its hearers could do that task too, so it hears the
speaker, and is busy with a task of its own, so that nothing follows from what it notices. Each has a tau of its own: one run
measures all of them over the same messages, of which every link loses its own share.
"""

import random
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lalliance_agents.config import Mission
from lalliance_agents.faults import Crash
from lalliance_study.detection.law import Loss
from lalliance_study.logbook import Timing
from lalliance_study.simulator import Simulator

RATE = 5.0
#: The common task comes into being when everybody is busy but the speaker; a while later all is steady; in seconds.
ARRIVES = 3.0
STEADY = 6.0
#: Time for which the speaker works before it dies, in which no more than a hundredth of a long silence is cut off; in seconds.
WORKED = 10.0
SPEAKER = "speaker"


def hearer(number: int) -> str:
    """The name of the hearer with the tau of this number."""
    return f"hearer-{number}"


def probe(
    tau_rhos: Sequence[float],
    loss: Loss,
    *,
    lasts: float,
    seed: int,
    jitter: float = 0.0,
    faults: Sequence[Mapping[str, Any]] = (),
) -> Mission:
    """A mission with a speaker and one hearer for each of `tau_rhos`.

    Args:
        tau_rhos: tau times rho of each hearer.
        loss: of the speaker's messages.
        lasts: how long the mission is, in seconds.
        seed: its seed.
        jitter: messages are late by up to this, uniformly; in seconds.
        faults: further faults.
    """
    names = [hearer(number) for number in range(len(tau_rhos))]
    rule = {"at": 0.0, "link": {"from": SPEAKER}, "loss": loss.rule()}
    if jitter:
        rule["delay"] = {"uniform": [0.0, jitter]}
    robots: dict[str, Any] = {SPEAKER: {"tasks": {"common": 1e6}}}
    for name, tau_rho in zip(names, tau_rhos, strict=True):
        own = {"silence_timeout": round(tau_rho / RATE, 9)}
        robots[name] = {"tasks": {f"of-{name}": 1e6, "common": 2e6}, "parameters": own}
    return Mission.model_validate(
        {
            "name": "probe",
            "tasks": {"common": {"arrives": ARRIVES}} | {f"of-{name}": {} for name in names},
            "robots": robots,
            "knowledge": "given",
            "parameters": {"min_delay": 0.1, "max_delay": 0.5, "broadcast_rate": RATE},
            "faults": [rule, *faults],
            "deadline": lasts,
            "seed": seed,
        }
    )


def count_suspicions(
    tau_rhos: Sequence[float], loss: Loss, jitter: float, lasts: float, seed: int
) -> tuple[list[int], float]:
    """How often each hearer took the living speaker to be silent, and in how many seconds."""
    mission = probe(tau_rhos, loss, lasts=STEADY + lasts, seed=seed, jitter=jitter)
    simulator = Simulator(mission)
    before: list[int] = []
    simulator.call_at(STEADY, lambda: before.extend(_lapses(simulator, len(tau_rhos))))
    simulator.run()
    after = _lapses(simulator, len(tau_rhos))
    return [late - early for early, late in zip(before, after, strict=True)], simulator.now - STEADY


def _lapses(simulator: Simulator, hearers: int) -> list[int]:
    ears = [simulator.members[hearer(number)].mind.hearing.presences for number in range(hearers)]
    return [heard[SPEAKER].lapses if SPEAKER in heard else 0 for heard in ears]


def time_detections(tau_rhos: Sequence[float], loss: Loss, seeds: Sequence[int]) -> list[list[float]]:
    """For each of `tau_rhos`, how long after its death the speaker was taken to be silent, once per seed; in seconds.

    It is negative where the speaker was held to be silent already when it died.
    """
    timed: list[list[float]] = [[] for _ in tau_rhos]
    for seed in seeds:
        dies = ARRIVES + WORKED + random.Random(seed).random()
        crash = Crash(kind="crash", at=dies, robot=SPEAKER).model_dump(exclude_unset=True)
        lasts = dies + max(tau_rhos) / RATE + 1.0
        simulator = Simulator(probe(tau_rhos, loss, lasts=lasts, seed=seed, faults=[crash]))
        simulator.run()
        [gone] = [line.at for line in simulator.log if (line.who, line.what) == (SPEAKER, "gone")]
        death = gone - Timing().message_delay
        for number, times in enumerate(timed):
            times.append(simulator.members[hearer(number)].mind.hearing.presences[SPEAKER].lapsed_at - death)
    return timed


def quantiles(times: Sequence[float]) -> dict[str, float]:
    """The quantiles of detection times, what was noticed before the death counting as noticed at once; in seconds.

    The median's interval takes the ranks between which it lies with a probability of 95 %.
    """
    ordered = np.sort(np.maximum(times, 0.0))
    spread = 0.98 * np.sqrt(len(ordered))
    ranks = np.clip(np.round(len(ordered) / 2 + np.array([-spread, spread])).astype(int), 0, len(ordered) - 1)
    values = {f"p{share}": float(np.quantile(ordered, share / 100)) for share in (10, 50, 90, 99)}
    return values | {"low": float(ordered[ranks[0]]), "high": float(ordered[ranks[1]])}
