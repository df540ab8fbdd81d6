"""Zenoh's threads, kept known to Python between their calls.

A thread that Python did not start gets a new thread state for each of its calls, and loses it with the call's end. To make
and unmake that takes longer than all that the bus does with a message. A call that asks for the state once more than it
gives it back leaves it to its thread, until the interpreter ends, as that of a daemon thread.

The state of a thread that ends is not freed before that, so only a limited number keep theirs; Zenoh's last as long as the
process, and are few.
"""

import ctypes
import threading

#: Threads that keep their state at most.
MOST_THREADS = 64

_ensure = ctypes.pythonapi.PyGILState_Ensure
_kept = 0


class _ThisThread(threading.local):
    """What a thread puts here is forgotten together with its state."""

    known = False


this_thread = _ThisThread()


def stay_known() -> None:
    """Keep the thread that runs this known to Python, if that can be; to be called while `this_thread` is not known."""
    global _kept  # noqa: PLW0603 - threads are the process's, not an object's
    if _kept < MOST_THREADS:
        _kept += 1
        this_thread.known = True
        _ensure()
