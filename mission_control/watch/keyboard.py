"""Single keys pressed on the terminal, by name."""

import asyncio
import contextlib
import os
import sys
import termios
import tty
from collections.abc import Callable, Iterator

from mission_control.watch.screen import is_in_background, stoppable

_NAMES = {
    b"\x1b[A": "up",
    b"\x1b[B": "down",
    b"\x1b[C": "right",
    b"\x1b[D": "left",
    b"\x1b[5~": "page up",
    b"\x1b[6~": "page down",
    b"\x1b[H": "home",
}


def names(pressed: bytes) -> Iterator[str]:
    """The keys that a terminal sent at once, by letter or name; an unknown code is left out with what follows it."""
    at = 0
    while at < len(pressed):
        found = next((code for code in _NAMES if pressed.startswith((code, code.replace(b"[", b"O")), at)), None)
        if found is not None:
            yield _NAMES[found]
            at += len(found)
        elif pressed[at : at + 1] == b"\x1b":
            return
        else:
            yield chr(pressed[at])
            at += 1


@contextlib.contextmanager
def keyboard(pressed: Callable[[str], None], show: Callable[[bool], None] = lambda _: None) -> Iterator[bool]:
    """Have `pressed` called in the event loop with each key; whether any can come.

    They come from a terminal, if this process has it, or from a pipe. `show` is called with False before this process is
    stopped from the terminal, and with True when it has it again.
    """
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # there is no standard input
        yield False
        return
    loop = asyncio.get_running_loop()

    def take() -> None:
        came = b""
        with contextlib.suppress(OSError):  # the terminal is gone
            came = os.read(descriptor, 1024)
        if not came:
            loop.remove_reader(descriptor)
        for name in names(came):
            pressed(name)

    with _unbuffered(descriptor, show) as is_ours:
        can_come = is_ours
        try:
            if is_ours:
                loop.add_reader(descriptor, take)
        except OSError:  # a file, which is not waited for
            can_come = False
        try:
            yield can_come
        finally:
            loop.remove_reader(descriptor)


@contextlib.contextmanager
def _unbuffered(descriptor: int, show: Callable[[bool], None]) -> Iterator[bool]:
    """Have a terminal hand out each letter at once and show none; whether it is for this process to say."""
    if not os.isatty(descriptor):
        yield True
        return
    if is_in_background():
        yield False
        return
    before = termios.tcgetattr(descriptor)

    def take(taken: bool) -> None:
        if taken:
            with contextlib.suppress(termios.error):  # the terminal is gone
                tty.setcbreak(descriptor)
        else:
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
        show(taken)

    tty.setcbreak(descriptor)
    try:
        with stoppable(take):
            yield True
    finally:
        if not is_in_background():
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
