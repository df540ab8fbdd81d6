"""Who handles signals."""

from enum import Enum


class SignalHandlerOptions(Enum):
    NO = 0
