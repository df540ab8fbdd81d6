"""Qualities of service, which files do not need."""

from enum import Enum


class DurabilityPolicy(Enum):
    TRANSIENT_LOCAL = 1


class QoSProfile:
    def __init__(self, *, depth: int, durability: DurabilityPolicy) -> None:
        self.depth = depth
        self.durability = durability
