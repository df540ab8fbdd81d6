"""Worlds that are driven by hand through their history, for tests of the journal."""

import contextlib
import shutil
from pathlib import Path
from typing import Any

from lalliance_agents.config import Mission
from lalliance_agents.errors import UserError
from lalliance_agents.mission_file import parse_mission
from lalliance_agents.wire.messages import Action, ChaosCommand, DecisionMade, DeedDone, Effect, LinkReport
from world_server.history import History
from world_server.journal import Journal

POOL = """
name: team
environment: {kind: task_pool, hand_over: %s, noise: 0.3}
tasks: {a: {}, b: {after: [a]}, c: {arrives: 3}}
robots:
  r0: {tasks: {a: 1, b: 2, c: 3}}
  r1: {tasks: {a: 2, b: 9}}
  r2: {joins: 4, tasks: {c: 6, a: 5}}
parameters: {trials: 2}
phases: [{learning: active, trials: 2, until: full}, {}]
faults:
  - {at: 1, robot: r0, kind: crash, restart: true, until: 5}
  - {at: 2, until: 9, robot: r1, kind: slow, factor: 3}
  - {at: 0, until: 6, link: {from: "*", to: r1}, loss: 0.5}
  - {at: 3, until: 8, robot: r1, kind: blind, delay: 1}
deadline: 40
seed: 5
"""
BOX = """
name: team
environment: {kind: box_pushing}
tasks: {a: {}, b: {}}
robots: {r0: {tasks: {a: 6, b: 6}}, r1: {tasks: {a: 7, b: 7}}, r2: {tasks: {a: 20}}}
faults:
  - {at: 2, until: 4, robot: r0, kind: hang}
  - {at: 5, robot: r1, kind: stuck, task: a}
deadline: 60
"""
MISSIONS = [POOL % hand_over for hand_over in ("shared_max", "shared_add", "restart")] + [BOX]


def mission_of(text: str) -> Mission:
    return parse_mission(text, "test.yaml")


class Driven:
    """A history that is driven by hand, on a journal or without one."""

    def __init__(self, mission: Mission, journal: Journal | None) -> None:
        self.history = History(mission, journal, lambda _: None)

    def put_in(self, deed: str, robot: str, task: str | None, number: int, now: float) -> None:
        history, trial = self.history, self.history.world.trial
        header: dict[str, Any] = {"sender": robot, "incarnation": 1 + number // 3, "seq": 1, "at": now}
        match deed:
            case "act":
                history.act(Action(**header, task=task, trial=trial, fewest=min(number, 2)), now)
            case "decided":
                made = {"verb": "activate", "cause": "silence", "other": "r0", "active_for": 0.0, "factors": {}}
                history.decided(DecisionMade(**header, **made, task=task or "a", trial=trial, teammates=[]), now)
            case "reported":
                names = [entry.name for entry in history.world.failures.entries][: number + 1]
                # Of a fault that is not yet there, and of one twice: no robot that works says so.
                names += ["5-mute", "1-crash"] if number == 4 else []
                effects = [Effect(fault=name, sender="r1", count=number) for name in names]
                counts = {"sent": 3, "received": number, "dropped": {"stale": 1}, "teammates": {}, "missed": 0}
                history.reported(LinkReport(**header, **counts, ticks=7, effects=effects), now)
            case "gone" | "there":
                history.presence(robot, deed == "there", now)
            case "launcher":
                history.launcher(number % 2 == 0, now)
            case "done":
                history.done(DeedDone(**header, number=number), now)
            case "command":
                faults = ['{"robot": "r1", "kind": "mute"}', '{"robot": "r2", "kind": "stuck"}', "{}"]
                verb, fault = ("heal", "") if number > 2 else ("inject", faults[number])
                with contextlib.suppress(UserError):
                    history.obey(ChaosCommand(**header, verb=verb, fault=fault, lasts=1.5), now)  # type: ignore[arg-type]
            case "begin":
                history.begin(now)
            case "advance":
                history.advance(now)

    def state(self) -> dict[str, Any]:
        world = self.history.world
        return {
            "summary": world.summary(), "tasks": world.tasks(), "orders": world.orders(), "rules": world.rules(),
            "blind": world.blind(), "bodies": world.bodies, "elapsed": world.elapsed, "stage": world.stage,
            "trial": world.trial, "learning": world.learning, "next": world.next_change(),
            "launcher": world.has_launcher, "missing": world.missing(), "lives": world.ledger.lives(),
        }  # fmt: skip


def crash_image(journal: Path, to: Path) -> Path:
    """What a server that is killed now leaves behind."""
    for path in (journal, journal.with_name(f"{journal.name}-wal")):
        if path.exists():
            shutil.copy(path, to.with_name(path.name.replace(journal.name, to.name)))
    return to
