"""The page over HTTP: its files, the connections of its viewers, requests to disturb the mission, metrics and health."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from mission_control.dashboard.chronicle import Chronicle
from mission_control.dashboard.disturb import Disturber, Outcome
from mission_control.dashboard.guard import HEADERS, Guard
from mission_control.dashboard.view import State, View
from mission_control.dashboard.viewer import Viewer

PAGE = Path(__file__).parent / "page"
#: Viewers at a time.
MOST_VIEWERS = 32
#: Bytes of a request to disturb the mission.
LARGEST_REQUEST = 16 * 1024
#: What Prometheus expects to be told of the form of metrics.
METRICS_TYPE = "text/plain; version=0.0.4; charset=utf-8"


@dataclass(slots=True)
class Site:
    """What is served.

    Attributes:
        chronicle: the mission.
        guard: who may what.
        hello: what each viewer is told first.
        disturber: does to the mission what is asked for.
        metrics: what Prometheus reads.
        trouble: what is wrong, in a sentence; empty if all is well.
        viewers: how many there are.
    """

    chronicle: Chronicle
    guard: Guard
    hello: State
    disturber: Disturber
    metrics: Callable[[], bytes]
    trouble: Callable[[], str]
    viewers: int = field(default=0, init=False)

    def app(self) -> ASGIApp:
        """The application."""
        routes = [
            Route("/", self._index),
            Route("/health", self._health),
            Route("/metrics", self._metrics),
            Route("/chaos/{verb}", self._disturb, methods=["POST"]),
            WebSocketRoute("/watch", self._watch),
            Mount("/page", StaticFiles(directory=PAGE)),
        ]
        return Guarded(Starlette(routes=routes), self.guard)

    async def _index(self, _: Request) -> Response:
        return FileResponse(PAGE / "index.html")

    async def _health(self, _: Request) -> Response:
        trouble = self.trouble()
        return PlainTextResponse(f"{trouble or 'ok'}\n", 503 if trouble else 200)

    async def _metrics(self, _: Request) -> Response:
        return Response(self.metrics(), media_type=METRICS_TYPE)

    async def _disturb(self, request: Request) -> Response:
        if not self.guard.may_disturb(request.headers):
            return _told(Outcome(False, "this needs the token; expected the address that the command printed"), 401)
        try:
            content = await _small_json(request)
        except ValueError as error:
            return _told(Outcome(False, str(error)), 400)
        verbs = {"inject": self.disturber.inject, "heal": self.disturber.heal}
        verb = verbs.get(request.path_params["verb"])
        if verb is None:
            return _told(Outcome(False, "expected inject or heal"), 404)
        outcome = await verb(content)
        return _told(outcome, 200 if outcome.done else 409)

    async def _watch(self, socket: WebSocket) -> None:
        if self.viewers >= MOST_VIEWERS:
            await socket.close(1013, "too many viewers")
            return
        self.viewers += 1
        try:
            await socket.accept()
            await Viewer(socket, View(self.chronicle), self.hello).serve()
        finally:
            self.viewers -= 1


def _told(outcome: Outcome, status: int) -> Response:
    return JSONResponse({"done": outcome.done, "text": outcome.text}, status)


async def _small_json(request: Request) -> Any:
    """The JSON in a request.

    Raises:
        ValueError: it is too large, or no JSON.
    """
    body = b""
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > LARGEST_REQUEST:
                raise ValueError(f"the request is too large; expected at most {LARGEST_REQUEST} bytes")
    except ClientDisconnect:
        raise ValueError("the request ended early") from None
    try:
        return json.loads(body)
    except (ValueError, RecursionError):
        raise ValueError("the request is no JSON; expected a document") from None


class Guarded:
    """Turns away what does not belong here, and adds to each answer what a browser must not do with it.

    Args:
        inner: the application.
        guard: judges requests.
    """

    def __init__(self, inner: ASGIApp, guard: Guard) -> None:
        self._inner = inner
        self._guard = guard

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""

        async def furnished(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
            await send(message)

        if self._guard.is_own(Headers(scope=scope)):
            await self._inner(scope, receive, furnished)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": "not from here"})
        else:
            refusal = PlainTextResponse("this page is called by another name, or from another page\n", 403)
            await refusal(scope, receive, furnished)
