"""Keys, on a terminal and on a pipe."""

import asyncio
import os
import pty
import signal
import sys
import termios
from collections.abc import Iterator
from typing import TextIO

import pytest

from mission_control.watch.keyboard import keyboard


@pytest.fixture(params=["terminal", "pipe"])
def typed(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Where letters can be typed that come on standard input."""
    far, near = pty.openpty() if request.param == "terminal" else os.pipe()[::-1]
    with os.fdopen(near) as stdin, os.fdopen(far, "wb", buffering=0) as letters:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield letters.fileno()


def mode() -> list[object] | None:
    return termios.tcgetattr(sys.stdin) if sys.stdin.isatty() else None


async def test_each_key_is_told_at_once_and_the_terminal_is_left_as_it_was(typed: int) -> None:
    pressed: asyncio.Queue[str] = asyncio.Queue()
    before = mode()
    with keyboard(pressed.put_nowait) as can_come:
        assert can_come
        os.write(typed, b"x ")
        os.write(typed, b"\x1b[A")
        async with asyncio.timeout(10):
            assert [await pressed.get() for _ in range(3)] == ["x", " ", "up"]
    assert mode() == before


async def test_who_stops_it_has_the_terminal_as_it_was_and_gives_it_back(monkeypatch: pytest.MonkeyPatch) -> None:
    far, near = pty.openpty()
    with os.fdopen(near) as stdin, os.fdopen(far):
        monkeypatch.setattr(sys, "stdin", stdin)
        before = mode()
        told: list[object] = []
        over = asyncio.Event()

        def kill(process: int, number: int) -> None:
            told.append((process == os.getpid(), number, mode() == before))

        def show(shown: bool) -> None:
            told.append(shown)
            if shown:
                over.set()

        monkeypatch.setattr(os, "kill", kill)
        with keyboard(lambda _: None, show):
            ours = mode()
            signal.raise_signal(signal.SIGTSTP)
            async with asyncio.timeout(10):
                await over.wait()
            assert told == [False, (True, signal.SIGTSTP, True), True]
            assert mode() == ours != before
        assert mode() == before
        assert signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL


async def test_where_nothing_can_be_typed_none_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    nowhere: list[TextIO | None] = [None]
    with open(os.devnull) as empty:  # noqa: PTH123, ASYNC230 - as a shell does
        for stdin in [*nowhere, empty]:
            monkeypatch.setattr(sys, "stdin", stdin)
            with keyboard(lambda _: None) as can_come:
                assert not can_come
