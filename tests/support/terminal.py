"""A process of its own that runs a command in a terminal, and types a letter once a text is on its screen.

What the terminal was told goes to standard output; the exit status is the command's.
"""

import os
import pty
import sys


def run(text: str, letter: str, command: list[str]) -> int:
    shown = bytearray()

    def read(terminal: int) -> bytes:
        told = os.read(terminal, 1024)
        if text.encode() not in shown:
            shown.extend(told)
            if text.encode() in shown:
                os.write(terminal, letter.encode())
        return told

    return os.waitstatus_to_exitcode(pty.spawn(command, read))


if __name__ == "__main__":
    sys.exit(run(sys.argv[1], sys.argv[2], sys.argv[3:]))
