"""What a robot's process cannot do without, and nothing else: Python, asyncio, Zenoh, and as many messages of its size.

    python benchmarks/bare.py ENDPOINT PARENT [NAME [MATE …]]

It makes a step ten times a second. With a name it publishes three keys, one of them 5 times a second and two once, and hears
those of its mates that a robot hears: the first and the last. What Zenoh's threads bring waits for the next step.
`team_size.py` starts it.
"""

import asyncio
import json
import sys
from collections import deque

import zenoh

from lalliance_agents.bus.session import client_settings
from lalliance_agents.lineage import end_with_parent

KEYS = ("presence", "link", "action")
#: Bytes of a message, about those of an announcement.
SIZE = 150


class Ear:
    """Keeps what Zenoh's threads bring until the next step."""

    def __init__(self) -> None:
        self.heard = 0
        self._waiting: deque[zenoh.Sample] = deque()

    def __call__(self, sample: zenoh.Sample) -> None:
        """Called by Zenoh."""
        self._waiting.append(sample)

    def collect(self) -> None:
        """Read what came."""
        while self._waiting:
            self._waiting.popleft().payload.to_bytes()
            self.heard += 1


async def live(endpoint: str, names: list[str]) -> None:
    """Send and hear until killed."""
    drop = zenoh.CongestionControl.DROP
    with zenoh.open(zenoh.Config.from_json5(json.dumps(client_settings(endpoint, 5.0)))) as session:
        ear = Ear()
        callback = zenoh.handlers.Callback(ear, indirect=False)
        heard = [
            session.declare_subscriber(f"bare/{key}/{mate}", callback)
            for mate in names[1:]
            for key in (KEYS[0], KEYS[-1])
        ]
        ways = [
            session.declare_publisher(f"bare/{key}/{name}", congestion_control=drop)
            for name in names[:1]
            for key in KEYS
        ]
        sys.stdout.write(f"ready to hear {len(heard)} keys\n")
        sys.stdout.flush()
        payload, step = bytes(SIZE), 0
        while True:
            await asyncio.sleep(0.1)
            ear.collect()
            step += 1
            for way in ways if step % 10 == 0 else ways[: step % 2 == 0]:
                way.put(payload)


if __name__ == "__main__":
    end_with_parent(int(sys.argv[2]))
    asyncio.run(live(sys.argv[1], sys.argv[3:]))
