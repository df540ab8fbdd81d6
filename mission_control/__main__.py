"""`python -m mission_control` is `lalliance`; so is the console script.

To import the commands takes a moment. Ctrl-C in that moment ends the process with the sentence that it gets later, so the
handler is there before them, and nothing else is imported here.
"""

import os
import signal


def _leave(number: int, _frame: object) -> None:
    os.write(2, b"lalliance: interrupted\n")
    os._exit(128 + number)


def main() -> None:
    """Run the command line."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    from mission_control.cli import main as command_line  # noqa: PLC0415 - see above

    command_line()


if __name__ == "__main__":
    main()
