"""The whole terminal, taken and given back.

Who stops this process with Ctrl-Z gets the terminal as it was, and gives it back as this process had it.
"""

import asyncio
import contextlib
import os
import signal
from collections.abc import Callable, Iterator

from rich.live import Live

#: How often who goes on in the background looks whether it has the terminal again, in seconds.
LOOK_AGAIN = 0.5


def show(live: Live, shown: bool) -> None:
    """Take the screen, or give it back to who has the terminal meanwhile."""
    if shown:
        live.start(refresh=True)
    else:
        live.stop()


def is_in_background() -> bool:
    """Whether others have the terminal of this process, which stops who changes it in the background."""
    try:
        terminal = os.open(os.ctermid(), os.O_RDONLY | os.O_NOCTTY)
    except OSError:  # there is none
        return False
    try:
        return os.tcgetpgrp(terminal) != os.getpgrp()
    except OSError:  # it is gone
        return False
    finally:
        os.close(terminal)


@contextlib.contextmanager
def stoppable(take: Callable[[bool], None]) -> Iterator[None]:
    """Have `take` called with False before this process is stopped from the terminal, and with True when it goes on.

    Only in an event loop.
    """
    loop = asyncio.get_running_loop()

    waiting: asyncio.TimerHandle | None = None

    def go_on() -> None:
        nonlocal waiting
        if waiting is not None:
            waiting.cancel()
        if is_in_background():  # nobody tells when that ends
            waiting = loop.call_later(LOOK_AGAIN, go_on)
        else:
            take(True)

    def stop() -> None:
        take(False)
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
        if waiting is not None:
            waiting.cancel()
