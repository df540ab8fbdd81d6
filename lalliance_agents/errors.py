"""What can go wrong, told by whose fault it is.

Every error a user can cause derives from `UserError` and carries one finished sentence: where, which value, what was
expected. The command line prints that sentence and exits with status 2. Exceptions of other libraries are turned into
these at the edge where they arise; anything else that escapes is a defect of this project.
"""


class LallianceError(Exception):
    """Base of all errors of this project."""


class UserError(LallianceError):
    """The input or the surroundings are not as they must be; the message is a sentence for the user."""


class MissionError(UserError):
    """A mission file that cannot be used."""


class BusError(UserError):
    """The bus cannot be reached, or an endpoint cannot be used."""


class BehaviorError(UserError):
    """A user's behaviour sets cannot be loaded, or do not fit the mission."""


class MessageError(LallianceError):
    """A message from the bus that does not decode: dropped and counted, never fatal.

    Attributes:
        reason: one word that names the check that failed, used as the counter's label.
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason


def exact(number: float) -> str:
    """A number as a sentence about a limit tells it: with all the digits that set it apart from the limit."""
    return repr(float(number)).removesuffix(".0")
