"""Messages from a publisher in another process into this one: how many a second, and how late, through the bus and past it.

A message is an activity message as robots send it, under its own key; publisher and receiver are processes of their own, and
the router, where there is one, a third. Each way of receiving gets fresh processes and is measured twice: at a pace, for the
time from `put` to where the message ends up; and flooded, for how many a second end up there. A flood is more than any
receiver takes: what is too much is dropped on the way, and what counts is what arrived, between the first and the last.

The ways take turns, several rounds of them, so that whatever else the machine does strikes all alike; ratios are made within
a round, and medians are over the rounds. The goals: from `put` to a coroutine, the bus brings at least half of what Zenoh's
own callback receives that does nothing but count, and three times what one call of the loop for each message brings.

    python benchmarks/bus.py [--quick] [--json FILE] [--rounds N] [--seconds S]
"""

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import median, quantiles
from typing import Any, Self

import form
from bus_ends import PACE

from lalliance_agents.bus.router import free_endpoint

ENDS = Path(__file__).with_name("bus_ends.py")
TOLD = {
    "callback": "Zenoh's callback, counting",
    "reading": "Zenoh's callback, reading",
    "hop": "a call of the loop each",
    "handler": "the bus, a handler",
    "coroutine": "the bus, a coroutine",
    "messenger": "the bus, checked",
}
#: Those that the others are told beside.
RATIOS = ["callback", "reading", "hop"]
QUICK = [*RATIOS, "coroutine"]
#: What `coroutine` is to bring of what `callback` receives, and how many times what `hop` brings.
OF_CALLBACK, OF_HOP = 0.5, 3.0


class End:
    """One of the processes, which is there when the context is entered and gone when it is left."""

    def __init__(self, role: str, *options: str) -> None:
        command = [sys.executable, str(ENDS), role, *options]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)  # noqa: S603 - ours

    def __enter__(self) -> Self:
        """Return it, just started."""
        return self

    def __exit__(self, *_: object) -> None:
        """Kill it, if it has not ended."""
        with self._process as process:
            process.kill()

    def hear(self) -> str:
        """The next line that it says."""
        return (self._process.stdout or sys.stdin).readline().strip()

    def ask(self, line: str) -> str:
        """Tell it to do something, and wait for what it says then."""
        print(line, file=self._process.stdin, flush=True)
        return self.hear()

    def end(self) -> str:
        """Let it end; its last words."""
        return self._process.communicate(timeout=60)[0].strip()


def measure(way: str, *, direct: bool, seconds: float) -> dict[str, float]:
    """What comes through in one way: messages a second and shares; delays in seconds."""
    endpoint = ["--endpoint", free_endpoint(), *(["--direct"] if direct else [])]
    with ExitStack() as there:
        roles = [["receive", "--way", way], ["publish"], *([] if direct else [["route"]])]
        ends = [there.enter_context(End(*role, *endpoint)) for role in roles]
        for one in ends:
            one.hear()  # that it is ready
        receiver, publisher = ends[:2]
        paced = int(publisher.ask(f"paced {seconds}"))
        # Who looks for news is to find some.
        flood = int(publisher.ask(f"{'numbered' if way == 'messenger' else 'flood'} {seconds}"))
        publisher.end()
        found = json.loads(receiver.end())
    cuts = quantiles(found["lags"], n=100)
    return {
        "rate": found["rate"],
        "offered": flood / seconds,
        "flood_delivered": found["count"] / flood,
        "paced_delivered": len(found["lags"]) / paced,
        "p50": cuts[49],
        "p99": cuts[98],
    }


def summary(way: str, *, direct: bool, rounds: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, Any]:
    """The row of one way, from all rounds of all ways."""
    mine = [one[way] for one in rounds]
    return {
        "way": way,
        "direct": direct,
        **{figure: median(one[figure] for one in mine) for figure in mine[0]},
        **{f"of_{other}": median(one[way]["rate"] / one[other]["rate"] for one in rounds) for other in RATIOS},
    }


COLUMNS: form.Columns = {
    "from `put` to": lambda one: TOLD[one["way"]],
    "by": lambda one: "peer to peer" if one["direct"] else "router",
    "messages/s": lambda one: f"{one['rate']:,.0f}",
    "of counting": lambda one: f"{one['of_callback']:.2f} x",
    "of reading": lambda one: f"{one['of_reading']:.2f} x",
    "of the hop": lambda one: f"{one['of_hop']:.2f} x",
    "of flood": lambda one: f"{one['flood_delivered']:.0%}",
    f"p50 at {PACE:,}/s": lambda one: f"{one['p50'] * 1000:.2f} ms",
    "p99": lambda one: f"{one['p99'] * 1000:.2f} ms",
    "delivered": lambda one: f"{one['paced_delivered']:.1%}",
}


def against_goals(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """How the bus stands against its goals, a sentence each."""
    counting = {one["direct"]: one["of_hop"] for one in rows if one["way"] == "callback"}
    for one in rows:
        if one["way"] == "coroutine":
            begin = f"By {COLUMNS['by'](one)}, the bus brings to a coroutine"
            of = f"{one['of_callback']:.2f} times what Zenoh's callback receives when it only counts"
            reads = f"{one['of_reading']:.2f} times what it receives when it reads key and payload"
            yield f"{begin} {of} (the goal of {OF_CALLBACK:g} is {_met(one['of_callback'], OF_CALLBACK)}), and {reads}."
            hop = f"{one['of_hop']:.2f} times what `call_soon_threadsafe` a message brings"
            bound = f"a callback that only counts, and brings nothing to the loop, receives {counting[one['direct']]:.2f} times"
            yield f"{begin} {hop} (the goal of {OF_HOP:g} is {_met(one['of_hop'], OF_HOP)}); {bound}."


def _met(figure: float, goal: float) -> str:
    return "met" if figure >= goal else "missed"


def main() -> None:
    """Measure all ways."""
    arguments = form.options(__doc__)
    arguments.add_argument("--rounds", type=int, default=5)
    arguments.add_argument("--seconds", type=float, default=0.8, help="how long to send, at a pace and then as a flood")
    chosen = arguments.parse_args()
    count, seconds = (1, 0.1) if chosen.quick else (chosen.rounds, chosen.seconds)
    rounds: dict[bool, list[dict[str, dict[str, float]]]] = {True: [], False: []}
    ways = {True: list(TOLD), False: QUICK if chosen.quick else list(TOLD)}
    for _ in range(count):
        for direct, done in rounds.items():
            done.append({way: measure(way, direct=direct, seconds=seconds) for way in ways[direct]})
    rows = [summary(way, direct=direct, rounds=done) for direct, done in rounds.items() for way in ways[direct]]
    form.publish(
        "From `put` in one process to another",
        COLUMNS,
        rows,
        path=chosen.json,
        notes=list(against_goals(rows)),
        packages=["eclipse-zenoh"],
    )


if __name__ == "__main__":
    main()
