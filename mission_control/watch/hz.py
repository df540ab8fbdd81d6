"""`lalliance hz`: how often messages come, of each key."""

import asyncio
import contextlib
import json
from pathlib import Path

import typer

from lalliance_agents.clock import MissionClock
from mission_control.reach import reached
from mission_control.watch.absence import told_of_absence
from mission_control.watch.onlooker import Onlooker
from mission_control.watch.patterns import whole_pattern
from mission_control.watch.rates import Arrivals
from mission_control.watch.words import printable

#: Time between two reports, in seconds.
PERIOD = 1.0
#: Keys told apart.
MOST_KEYS = 4096


class Meter:
    """The arrivals of all keys of a mission.

    Args:
        prefix: what every key begins with; it is not told.
        window: how many arrivals of each key are looked at.
    """

    def __init__(self, prefix: str, window: int) -> None:
        self._prefix = prefix
        self._window = window
        self._arrivals: dict[str, Arrivals] = {}
        self._came = False

    def add(self, key: str, now: float) -> None:
        """A message came."""
        self._came = True
        name = key.removeprefix(self._prefix)
        if name not in self._arrivals and len(self._arrivals) < MOST_KEYS:
            self._arrivals[name] = Arrivals(self._window)
        if name in self._arrivals:
            self._arrivals[name].add(now)

    def report(self, *, as_json: bool) -> str:
        """How often they came, a line for each key; and begin to look for news."""
        came, self._came = self._came, False
        rates = {name: arrivals.rate() for name, arrivals in sorted(self._arrivals.items())}
        if as_json:
            return json.dumps({name: None if rate is None else rate._asdict() for name, rate in rates.items()})
        if not came:
            return "no new messages"
        width = max(map(len, rates))
        return "\n".join(
            f"{printable(name):{width}}  "
            + (
                "one message so far"
                if rate is None
                else f"rate {rate.rate:8.3f} Hz  min {rate.shortest:.3f} s  max {rate.longest:.3f} s  "
                f"std dev {rate.deviation:.5f} s  window {rate.window}"
            )
            for name, rate in rates.items()
        )


async def hz(
    pattern: str,
    mission: str | None,
    connect: str | None,
    keys: Path | None,
    *,
    window: int,
    seconds: float | None,
    as_json: bool,
) -> None:
    """Print once a second how often messages come on keys that match `pattern`, or once, after so many `seconds`.

    Raises:
        UserError: there is no such mission, or no such key.
    """
    async with reached(mission, connect, keys) as there:
        only = whole_pattern(pattern, there.mission)
        meter = Meter(f"lalliance/{there.mission}/", window)
        clock = MissionClock()
        async with (
            Onlooker(there.bus, there.mission, clock, motivations=False, only=only, asks=False) as onlooker,
            told_of_absence(onlooker, there.endpoint),
        ):

            async def listen() -> None:
                async for sighting in onlooker:
                    meter.add(sighting.key, sighting.now)

            listening = asyncio.create_task(listen())
            try:
                while True:
                    await asyncio.sleep(PERIOD if seconds is None else seconds)
                    typer.echo(meter.report(as_json=as_json))
                    if seconds is not None:
                        return
            finally:
                listening.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await listening
