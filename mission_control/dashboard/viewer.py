"""One viewer's connection: what is new goes out a few times a second, and questions about the past are answered.

An update goes out when the one before was drawn, and not more often than `PERIOD`. Of several questions that wait, the latest
is answered. So whoever is slow, or asks too much, costs no more than one message at a time, and no queue grows.
"""

import asyncio
import json
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from lalliance_agents.wire.messages import LONGEST
from mission_control.dashboard.view import State, View

#: Least time between two updates, in seconds.
PERIOD = 0.2
#: Letters of a message of a viewer.
LONGEST_MESSAGE = 2048


class Viewer:
    """Talks with one viewer until it goes.

    Args:
        socket: an accepted connection.
        view: what this viewer sees.
        hello: the first message.
    """

    def __init__(self, socket: WebSocket, view: View, hello: State) -> None:
        self._socket = socket
        self._view = view
        self._hello = hello
        self._drawn = asyncio.Event()
        self._asked = asyncio.Event()
        self._question: tuple[float, str] = (0.0, "")
        self._number = 0
        self._sending = asyncio.Lock()

    async def serve(self) -> None:
        """Talk until the viewer goes."""
        work = [asyncio.create_task(part()) for part in (self._listen, self._inform, self._answer)]
        try:
            await asyncio.wait(work, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for part in work:
                part.cancel()
            # Whoever goes while it is spoken to is no error.
            results = await asyncio.gather(*work, return_exceptions=True)
        for result in results:
            expected = WebSocketDisconnect | asyncio.CancelledError
            if isinstance(result, BaseException) and not isinstance(result, expected):
                raise result

    async def _send(self, message: State) -> None:
        text = json.dumps(message, separators=(",", ":"), allow_nan=False)
        async with self._sending:
            await self._socket.send_text(text)

    async def _inform(self) -> None:
        loop = asyncio.get_running_loop()
        await self._send(self._hello)
        while True:
            due = loop.time() + PERIOD
            update = self._view.update()
            self._number = update["number"]
            self._drawn.clear()
            await self._send(update)
            await self._drawn.wait()
            await asyncio.sleep(due - loop.time())

    async def _answer(self) -> None:
        while True:
            await self._asked.wait()
            self._asked.clear()
            await self._send(self._view.past(*self._question))

    async def _listen(self) -> None:
        while True:
            came = await self._socket.receive()
            if came["type"] == "websocket.disconnect":
                return
            text = came.get("text") or ""
            try:
                message = json.loads(text) if len(text) <= LONGEST_MESSAGE else None
            except (ValueError, RecursionError):
                message = None
            if not isinstance(message, dict):
                await self._socket.close(1007, "not a message of this page")
                return
            self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        robot, at = message.get("robot"), message.get("show")
        if message.get("drawn") == self._number:
            self._drawn.set()
        if isinstance(at, int | float) and abs(at) <= LONGEST:
            self._question = float(at), robot if isinstance(robot, str) else ""
            self._asked.set()
        elif isinstance(robot, str):
            self._view.choose(robot)
