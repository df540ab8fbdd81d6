"""Who may look at the page, who may disturb the mission, and what both get, by plain HTTP and WebSocket."""

import contextlib
import http.client
import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from prometheus_client.parser import text_string_to_metric_families
from support.telling import TOKEN, Noting, Telling, page_of
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from lalliance_agents.errors import UserError
from mission_control.dashboard.guard import Guard, new_token, read_token
from mission_control.dashboard.site import LARGEST_REQUEST, Site

SHOWN = {"Authorization": f"Bearer {TOKEN}"}


class Page:
    def __init__(self, address: str, site: Site, telling: Telling, noting: Noting) -> None:
        self.address = address
        self.site = site
        self.telling = telling
        self.noting = noting
        self.host = urlsplit(address).netloc

    def ask(self, method: str, path: str, body: bytes = b"", **headers: str) -> tuple[int, str, dict[str, str]]:
        connection = http.client.HTTPConnection(self.host, timeout=10)
        connection.request(method, path, body, {"Host": self.host, **headers})
        answer = connection.getresponse()
        told = answer.status, answer.read().decode(), {name.lower(): value for name, value in answer.getheaders()}
        connection.close()
        return told

    def watch(self, **options: Any) -> Any:
        return connect(f"ws://{self.host}/watch", open_timeout=10, **options)


@pytest.fixture
def page() -> Iterator[Page]:
    telling, noting = Telling(), Noting()
    telling.takeover()
    with page_of(telling.chronicle, noting) as (address, site):
        yield Page(address, site, telling, noting)


INJECTION = json.dumps({"fault": {"kind": "crash", "robot": "left"}, "lasts": None}).encode()


def test_a_fault_is_injected_with_the_token(page: Page) -> None:
    status, text, _ = page.ask("POST", "/chaos/inject", INJECTION, **SHOWN)
    assert (status, json.loads(text)) == (200, {"done": True, "text": "done"})
    status, _, _ = page.ask("POST", "/chaos/heal", b'{"name": ""}', **SHOWN)
    assert page.noting.requests == [
        ("inject", {"fault": {"kind": "crash", "robot": "left"}, "lasts": None}), ("heal", {"name": ""})
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"Authorization": "Bearer the-token-of-those-tests"}, 401),
        ({"Authorization": "Bearer "}, 401),
        ({"Authorization": f"Basic {TOKEN}"}, 401),
        ({"Authorization": "Bearer tök"}, 401),
        ({**SHOWN, "Origin": "http://evil.example"}, 403),
        ({**SHOWN, "Origin": "null"}, 403),
        ({**SHOWN, "Origin": "http://127.0.0.1:1"}, 403),
        ({**SHOWN, "Host": "evil.example"}, 403),
        ({**SHOWN, "Host": "127.0.0.1@evil.example"}, 403),
    ],
)
def test_who_shows_no_token_or_comes_from_elsewhere_is_refused(
    page: Page, headers: dict[str, str], status: int
) -> None:
    found, text, _ = page.ask("POST", "/chaos/inject", INJECTION, **headers)
    assert found == status
    assert TOKEN not in text
    assert page.noting.requests == []


@pytest.mark.parametrize(
    ("body", "status"),
    [(b"", 400), (b"not json", 400), (b"[" * 10_000, 400), (b"x" * (LARGEST_REQUEST + 1), 400)],
)
def test_a_request_that_cannot_be_read_is_refused(page: Page, body: bytes, status: int) -> None:
    assert page.ask("POST", "/chaos/inject", body, **SHOWN)[0] == status
    assert page.ask("POST", "/chaos/explode", b"{}", **SHOWN)[0] == 404
    assert page.noting.requests == []


def test_a_page_of_somebody_else_cannot_watch(page: Page) -> None:
    with pytest.raises(InvalidStatus) as refused, page.watch(origin="http://evil.example"):
        pass
    assert refused.value.response.status_code == 403
    with pytest.raises(InvalidStatus), page.watch(additional_headers={"Host": "evil.example"}):
        pass
    with page.watch(origin=f"http://{page.host}") as viewer:
        assert json.loads(viewer.recv(10))["kind"] == "hello"


def test_the_page_may_load_nothing_from_elsewhere(page: Page) -> None:
    status, text, headers = page.ask("GET", "/")
    assert status == 200
    assert "<script" in text
    policy = headers["content-security-policy"]
    assert {"default-src 'none'", "script-src 'self'", "connect-src 'self'"} <= {
        one.strip() for one in policy.split(";")
    }
    assert "unsafe" not in policy
    assert (headers["x-content-type-options"], headers["referrer-policy"]) == ("nosniff", "no-referrer")
    for path in ("/page/../../../pyproject.toml", "/page/%2e%2e/guard.py", "/page/", "/nothing"):
        assert page.ask("GET", path)[0] == 404


def test_a_slow_viewer_is_given_the_latest_state_and_no_queue(page: Page) -> None:
    with page.watch() as viewer:
        assert json.loads(viewer.recv(10))["kind"] == "hello"
        first = json.loads(viewer.recv(10))
        for second in range(7, 100):
            page.telling.status(float(second), a=second / 100)
        with pytest.raises(TimeoutError):
            viewer.recv(0.5)
        viewer.send(json.dumps({"drawn": first["number"]}))
        second_one = json.loads(viewer.recv(10))
    assert second_one["now"] == 99.0
    assert second_one["scene"]["tasks"]["a"]["progress"] == 0.99


def test_a_viewer_asks_for_the_past(page: Page) -> None:
    with page.watch() as viewer:
        viewer.send(json.dumps({"show": 3.0, "robot": "left"}))
        messages = [json.loads(viewer.recv(10)) for _ in range(3)]
    [past] = [message for message in messages if message["kind"] == "past"]
    assert (past["at"], past["scene"]["tasks"]["a"]["progress"]) == (3.0, 0.25)


@pytest.mark.parametrize("message", ["not json", "[1]", "x" * 3000, "[" * 2000, b"{}"])
def test_a_viewer_that_talks_nonsense_is_left(page: Page, message: str | bytes) -> None:
    with page.watch() as viewer:
        viewer.send(message)
        with pytest.raises(ConnectionClosed) as left:
            list(iter(lambda: viewer.recv(10), None))
    assert left.value.rcvd is not None
    assert left.value.rcvd.code in {1007, 1009}
    with page.watch() as viewer:
        for oddity in ({"show": "x"}, {"show": 1e400}, {"show": 10**400}, {"robot": 7}, {"drawn": None}, {}):
            viewer.send(json.dumps(oddity))
        assert json.loads(viewer.recv(10))["kind"] == "hello"


def test_prometheus_reads_the_metrics(page: Page) -> None:
    page.telling.link(6.5, by="right", left={"received": 7, "silence": 2.5, "lost_for": 1.4})
    status, text, headers = page.ask("GET", "/metrics")
    assert (status, headers["content-type"]) == (200, "text/plain; version=0.0.4; charset=utf-8")
    samples = {
        (sample.name, *sample.labels.values()): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    assert samples["lalliance_messages_total", "decision", "read"] == 2
    assert samples["lalliance_takeovers_total", "silence"] == 1
    assert samples["lalliance_control_periods_missed_total", "right"] == 2
    assert samples["lalliance_task_progress", "a"] == 0.75
    assert samples["lalliance_link_silence_seconds", "right", "left"] == 2.5
    assert samples["lalliance_mission_stage", "running"] == 1
    assert page.ask("GET", "/health")[:2] == (200, "ok\n")


def test_whoever_only_connects_makes_room_for_others(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mission_control.dashboard.serving.MOST_CONNECTIONS", 5)
    host, _, port = page.host.partition(":")
    with contextlib.ExitStack() as opened, page.watch() as viewer:
        assert json.loads(viewer.recv(10))["kind"] == "hello"
        idle = [opened.enter_context(socket.create_connection((host, int(port)), timeout=10)) for _ in range(8)]
        for one in idle:
            one.sendall(b"GET / HT")
        assert page.ask("GET", "/health")[0] == 200
        with contextlib.suppress(ConnectionResetError):
            assert idle[0].recv(1) == b""
        assert json.loads(viewer.recv(10))["kind"] == "update"


def test_a_connection_without_a_request_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mission_control.dashboard.serving.LONGEST_CONNECTION", 0.05)
    with page_of(Telling().chronicle, Noting()) as (address, _):
        host, _, port = urlsplit(address).netloc.partition(":")
        with socket.create_connection((host, int(port)), timeout=10) as idle, contextlib.suppress(ConnectionResetError):
            assert idle.recv(1) == b""


def test_a_mission_that_is_not_heard_is_not_well(page: Page) -> None:
    page.site.trouble = lambda: "nothing has been heard of the mission for 7 s"
    assert page.ask("GET", "/health")[:2] == (503, "nothing has been heard of the mission for 7 s\n")


def test_names_by_which_a_page_is_called() -> None:
    guard = Guard(new_token(), ["Page.example"])
    own = ["localhost:8080", "127.0.0.1:1", "[::1]:8080", "192.0.2.7", "page.example:80"]
    other = ["", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "a b", "[::1", "localhost/x"]
    assert [host for host in own if not guard.is_own({"host": host})] == []
    assert [host for host in other if guard.is_own({"host": host})] == []
    assert guard.is_own({"host": "localhost:8080", "origin": "http://localhost:8080"})
    assert not guard.is_own({"host": "localhost:8080", "origin": "http://localhost:8081"})


@pytest.mark.parametrize(
    ("content", "why"), [("short", "no token"), ("two words are none", "no token"), ("ä" * 20, "no token")]
)
def test_a_file_that_holds_no_token_is_refused(tmp_path: Path, content: str, why: str) -> None:
    path = tmp_path / "token"
    with pytest.raises(UserError, match="No such file"):
        read_token(path)
    path.write_text(content)
    with pytest.raises(UserError, match=why):
        read_token(path)
    with pytest.raises(UserError, match="/dev/zero: this is no token"):
        read_token(Path("/dev/zero"))
    path.write_text(f"{TOKEN}\n")
    assert read_token(path) == TOKEN
