"""From faults of links as people write them to link rules as they go over the bus."""

from typing import Any

from lalliance_agents.faults import (
    Bursts,
    Fault,
    LinkFault,
    LogNormalDelay,
    Partition,
    RadioFault,
    UniformDelay,
)
from lalliance_agents.wire.messages import LinkRule


def link_rules(fault: Fault, name: str) -> list[LinkRule]:
    """The rules that a fault is made of; none if it has nothing to do with links.

    Args:
        fault: the fault.
        name: what it is called where its effects are counted.
    """
    match fault:
        case LinkFault():
            effects: dict[str, Any] = {"cut": fault.cut, **_loss(fault), **_delay(fault), **_others(fault)}
            return [
                LinkRule(fault=name, senders=list(senders), receivers=list(receivers), **effects)
                for senders, receivers in fault.pairs()
            ]
        case Partition():
            return [
                LinkRule(fault=name, senders=list(senders), receivers=list(receivers), cut=True)
                for senders, receivers in fault.pairs()
            ]
        case RadioFault(kind="mute"):
            return [LinkRule(fault=name, senders=[fault.robot], receivers=["*"], cut=True)]
        case RadioFault():
            return [LinkRule(fault=name, senders=["*"], receivers=[fault.robot], cut=True)]
        case _:
            return []


def _loss(fault: LinkFault) -> dict[str, float]:
    match fault.loss:
        case Bursts() as bursts:
            return {
                "loss": bursts.good,
                "burst_loss": bursts.bad,
                "burst_enter": bursts.enter,
                "burst_leave": bursts.leave,
            }
        case None:
            return {}
        case share:
            return {"loss": share}


def _delay(fault: LinkFault) -> dict[str, str | float]:
    match fault.delay:
        case UniformDelay(uniform=(shortest, longest)):
            return {"delay": "uniform", "delay_by": shortest, "delay_to": longest}
        case LogNormalDelay(lognormal=law):
            return {"delay": "lognormal", "delay_by": law.median, "delay_to": law.sigma}
        case None:
            return {}
        case seconds:
            return {"delay": "constant", "delay_by": seconds, "delay_to": seconds}


def _others(fault: LinkFault) -> dict[str, float]:
    return {"duplicate": fault.duplicate or 0.0, "reorder": fault.reorder or 0.0, "held": fault.held}
