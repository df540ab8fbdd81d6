"""What a message costs its sender and its receiver in CPU time, without any network.

To encode is to build a checked message and to pack it, to decode is to unpack and to check it completely; beside each stands
msgpack alone on the same document. The messages are those of a mission of ten robots and twenty tasks. Then what the faulty
bus adds to a message on its way to a handler: while no rule is in force and when none names its link, beside a handler that is
called at once; and when one does, for which the message must be decoded. Then a presence message's way through the messenger.

What is compared takes turns, many times; the least time counts, as whatever else the machine does only slows a turn down.

    python benchmarks/codec.py [--quick] [--json FILE] [--turns N]
"""

import asyncio
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import form
import msgpack

from lalliance_agents.bus.base import Handler, Registration, Sample
from lalliance_agents.bus.faulty import FaultyBus
from lalliance_agents.bus.memory import MemoryBus, MemoryHub
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.clock import MissionClock
from lalliance_agents.wire.keys import OF_WORLD, WORLD, Keys, Kind
from lalliance_agents.wire.messages import BODY_OF, LinkRule, decode, encode

KEYS = Keys("benchmark")
ROBOTS = [f"robot-{number}" for number in range(1, 11)]
TASKS = [f"crate-{number}" for number in range(1, 21)]
ME, SENDER, TASK = ROBOTS[0], ROBOTS[1], TASKS[2]
#: Messages in one turn.
TURN = 200
_STAGE = {"mission": "running", "trial": 1, "learning": "adaptive", "elapsed": 31.25}
_FACTORS = {
    "motivation": 0.75, "pace": "fast", "category": 1, "rate": 0.4, "delay": 2.5, "own_time": 12.25, "best_time": 9.5,
    "boredom": 0.25, "psi": 20.5, "lambda": 30.5, "sensory_feedback": 1, "impatience_reset": 1, "acquiescence": 1,
}  # fmt: skip
_RULE = LinkRule(fault="loss-1", senders=[SENDER], receivers=["*"], loss=0.1)

FIELDS: dict[Kind, dict[str, Any]] = {
    Kind.ACTIVITY: {"task": TASK, "trial": 1, "active_for": 7.25, "expected": 11.5},
    Kind.HEARTBEAT: {"trial": 1},
    Kind.HELLO: {"tasks": TASKS[:6]},
    Kind.ACTION: {"task": TASK, "trial": 1, "fewest": 5},
    Kind.SENSE_TASK: {"trial": 1, "learning": "adaptive", "applicable": True, "complete": False, "progress": 0.375},
    Kind.SENSE_ROBOT: _STAGE,
    Kind.DECISION: {
        "verb": "activate", "task": TASK, "cause": "free", "other": None, "active_for": 0.0, "trial": 1,
        "factors": _FACTORS, "teammates": [{"name": name, "silence": 0.25, "expected": 9.5} for name in ROBOTS[1:3]],
    },
    Kind.MOTIVATION: {"active": [TASK], "sets": dict.fromkeys(TASKS[:6], _FACTORS)},
    Kind.LINK: {
        "sent": 310, "received": 1200, "dropped": {"link fault": 12}, "ticks": 600, "missed": 0,
        "teammates": {name: {"received": 133, "silence": 0.125} for name in ROBOTS[1:]},
    },
    Kind.EVENT: {"kind": "complete", "robot": ME, "task": TASK, "elapsed": 31.25, "trial": 1, "text": "completed"},
    Kind.STATUS: {
        **_STAGE, "trials": 1,
        "tasks": {task: {"complete": False, "applicable": True, "progress": 0.375} for task in TASKS},
        "robots": {robot: {"present": True, "task": TASK} for robot in ROBOTS},
    },
    Kind.CHAOS_RULES: {"seed": 7, "rules": [_RULE], "blind": []},
}  # fmt: skip


def least(deeds: dict[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """The least CPU time that each of the deeds takes, in seconds; they take turns."""
    found = dict.fromkeys(deeds, float("inf"))
    for _ in range(turns):
        for name, deed in deeds.items():
            began = time.process_time()
            for _ in range(TURN):
                deed()
            found[name] = min(found[name], (time.process_time() - began) / TURN)
    return found


def header(number: int, sender: str = SENDER) -> dict[str, Any]:
    """The header of one message."""
    return {"sender": sender, "incarnation": 3, "seq": number, "at": 31.5}


def row(what: str, size: int, taken: float, beside: str, plain: float) -> dict[str, Any]:
    """A figure and the one beside it, in seconds."""
    return {"what": what, "bytes": size, "seconds": taken, "beside": beside, "beside_seconds": plain}


def coding(turns: int) -> Iterator[dict[str, Any]]:
    """What it takes to encode and to decode each kind."""
    for kind, fields in FIELDS.items():
        body = BODY_OF[kind]
        given = {**header(1, WORLD if kind in OF_WORLD else SENDER), **fields}
        packed = encode(body(**given))
        document = msgpack.unpackb(packed)
        taken = least(
            {
                "encode": lambda body=body, given=given: encode(body(**given)),
                "pack": partial(msgpack.packb, document),
                "decode": partial(decode, body, packed),
                "unpack": partial(msgpack.unpackb, packed),
            },
            turns,
        )
        name = kind.name.lower().replace("_", " ")
        yield row(f"encode {name}", len(packed), taken["encode"], "msgpack.packb", taken["pack"])
        yield row(f"decode {name}", len(packed), taken["decode"], "msgpack.unpackb", taken["unpack"])


class Ear(MemoryBus):
    """A bus that gives away what the last subscriber registered, so that it can be called without the way there."""

    handler: Handler

    async def subscribe(self, pattern: str, handler: Handler, **options: bool) -> Registration:  # type: ignore[override]  # MemoryBus promises its own kind of registration, which nobody here needs
        """Keep the handler, too."""
        self.handler = handler
        return await super().subscribe(pattern, handler, **options)


def presence(numbers: Iterable[int]) -> Iterator[Sample]:
    """Activity messages of one robot."""
    key = KEYS.build(Kind.ACTIVITY, robot=SENDER, task=TASK)
    body = BODY_OF[Kind.ACTIVITY]
    return (Sample(key, encode(body(**header(number), **FIELDS[Kind.ACTIVITY]))) for number in numbers)


def pass_on(_: Sample) -> None:
    """Take a message and do nothing."""


RULES = {
    "no rule in force": [],
    "rules on other links": [_RULE.model_copy(update={"senders": [ROBOTS[5]]})],
    "a rule of loss on its link": [_RULE],
    "a rule of bursts on its link": [_RULE.model_copy(update={"burst_enter": 0.02, "burst_leave": 0.2})],
    "its link cut": [_RULE.model_copy(update={"loss": 0.0, "cut": True})],
}


#: Where nothing happens to a message, nor is it decoded.
UNTOUCHED = [f"faulty bus, {name}" for name in list(RULES)[:2]]


async def receiving(turns: int) -> list[dict[str, Any]]:
    """What the faulty bus and the messenger add to one presence message."""
    deeds: dict[str, Callable[[], object]] = {}
    messages = list(presence(range(1, TURN * (turns + 1))))
    pattern = KEYS.build(Kind.ACTIVITY, task=TASK)

    def each(handler: Handler) -> Callable[[], None]:
        coming = iter(messages)
        return lambda: handler(next(coming))

    clock = MissionClock()
    for name, rules in RULES.items():
        hub = MemoryHub()
        world = Messenger(MemoryBus(hub), KEYS, WORLD, 1, clock.now)
        told = world.sample(Kind.CHAOS_RULES, seed=7, rules=rules)
        await world.offer(told.key, lambda _, told=told: [told])
        ear = Ear(hub)
        faulty = FaultyBus(ear, KEYS, ME, clock)
        await faulty.obey(timeout=5.0)
        await faulty.subscribe(pattern, pass_on)
        deeds[f"faulty bus, {name}"] = each(ear.handler)
    ear = Ear(MemoryHub())
    await Messenger(ear, KEYS, ME, 1, clock.now).listen(pattern, lambda *_: None)
    deeds["messenger, fresh and checked"] = each(ear.handler)
    plain = {"decode": each(lambda sample: decode(BODY_OF[Kind.ACTIVITY], sample.payload)), "a handler": each(pass_on)}
    taken, size = least({**deeds, **plain}, turns), len(messages[0].payload)
    untouched, decoded = ("a handler", taken["a handler"]), ("decode activity", taken["decode"])
    return [row(name, size, taken[name], *(untouched if name in UNTOUCHED else decoded)) for name in deeds]


COLUMNS: form.Columns = {
    "what": lambda one: one["what"],
    "bytes": lambda one: f"{one['bytes']:,}",
    "CPU time": lambda one: f"{one['seconds'] * 1e6:.2f} µs",
    "beside it": lambda one: one["beside"],
    "its time": lambda one: f"{one['beside_seconds'] * 1e6:.2f} µs",
    "ratio": lambda one: f"{one['seconds'] / one['beside_seconds']:.1f} x",
}


def main() -> None:
    """Measure everything."""
    arguments = form.options(__doc__)
    arguments.add_argument("--turns", type=int, default=150)
    chosen = arguments.parse_args()
    turns = 2 if chosen.quick else chosen.turns
    rows = [*coding(turns), *asyncio.run(receiving(turns))]
    form.publish("What a message costs, in CPU time", COLUMNS, rows, path=chosen.json, packages=["msgpack", "pydantic"])


if __name__ == "__main__":
    main()
