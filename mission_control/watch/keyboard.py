"""Single keys pressed on the terminal, by name.

Who stops this process with Ctrl-Z gets the terminal as it was, and gives it back as this process had it.
"""

import asyncio
import contextlib
import os
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from typing import Any

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
    if _is_in_background(descriptor):
        yield False
        return
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:
        with _stoppable(descriptor, before, show):
            yield True
    finally:
        if not _is_in_background(descriptor):
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _is_in_background(descriptor: int) -> bool:
    """Whether others have the terminal, which stops who changes it in the background."""
    with contextlib.suppress(OSError):  # a terminal of another session, which nobody here is in the background of
        return os.tcgetpgrp(descriptor) != os.getpgrp()
    return False


@contextlib.contextmanager
def _stoppable(descriptor: int, before: list[Any], show: Callable[[bool], None]) -> Iterator[None]:
    """Give the terminal back as it was `before` when it stops this process, and take it again afterwards."""
    loop = asyncio.get_running_loop()

    def go_on() -> None:
        with contextlib.suppress(termios.error):  # the terminal is gone
            tty.setcbreak(descriptor)  # in the background, here it stands still again
        show(True)

    def stop() -> None:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
        show(False)
        loop.remove_signal_handler(signal.SIGTSTP)
        os.kill(os.getpid(), signal.SIGTSTP)  # here it stands still, unless nobody could have it go on
        loop.add_signal_handler(signal.SIGTSTP, stop)
        go_on()

    if signal.getsignal(signal.SIGTSTP) is not signal.SIG_DFL:  # it is not to be stopped
        yield
        return
    loop.add_signal_handler(signal.SIGTSTP, stop)
    loop.add_signal_handler(signal.SIGCONT, go_on)
    try:
        yield
    finally:
        loop.remove_signal_handler(signal.SIGTSTP)
        loop.remove_signal_handler(signal.SIGCONT)
