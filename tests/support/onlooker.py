"""A process of its own that takes an operator's keys and prints what happens in a mission, a line each.

It finds the router and the keys where the environment says, as the commands do: `LALLIANCE_CONNECT` and `LALLIANCE_KEYS`.

Events and decisions are told as `lalliance run` tells them; and of each life of a robot, when it was first heard.
"""

import asyncio
import os
import sys
import time
from pathlib import Path

from lalliance_agents.bus.credentials import credentials_in
from lalliance_agents.bus.messenger import Messenger
from lalliance_agents.bus.zenoh_bus import open_bus
from lalliance_agents.wire.keys import OPERATOR, Key, Keys, Kind
from lalliance_agents.wire.messages import Message
from mission_control.watch.story import Story


async def look_on(mission: str) -> None:
    keys, story, heard = Keys(mission), Story(mission), set[tuple[str, int]]()

    def tell(_: Key, message: Message) -> None:
        if happened := story.hear(message, time.monotonic()):
            print(happened, flush=True)

    def hear(_: Key, message: Message) -> None:
        life = (message.sender, message.incarnation)
        if life not in heard:
            heard.add(life)
            print(f"heard {message.sender} first at {time.time():.3f}", flush=True)

    shown = credentials_in(Path(os.environ["LALLIANCE_KEYS"]), OPERATOR)
    async with await open_bus(os.environ["LALLIANCE_CONNECT"], credentials=shown) as bus:
        messenger = Messenger(bus, keys, OPERATOR, 1, time.monotonic)
        for kind in (Kind.EVENT, Kind.DECISION):
            await messenger.listen(keys.build(kind), tell)
        for kind in (Kind.ACTIVITY, Kind.HEARTBEAT):
            await messenger.listen(keys.build(kind), hear)
        print("looking on", flush=True)
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(look_on(sys.argv[1]))
