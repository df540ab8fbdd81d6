"""Behaviour sets of one's own: a rover that waters beds with a pump and from a tank, neither of which the world knows."""

import asyncio

from lalliance_agents import BehaviorSet


class Pump:
    """Stands for a driver of real hardware: it draws air when it is opened for the first time."""

    def __init__(self) -> None:
        self.litres = 2.0
        self.primed = False

    def open(self) -> None:
        """Begin to pump."""
        if not self.primed:
            self.primed = True
            raise RuntimeError("the pump draws air")
        print("pump open", flush=True)

    def close(self) -> None:
        """End it."""
        print("pump closed", flush=True)


class Water(BehaviorSet):
    """Waters one bed."""

    def __init__(self, task: str, pump: Pump) -> None:
        super().__init__(task)
        self.pump = pump

    def applicable(self) -> bool:
        """What the world says of the bed, and what only the robot knows: whether there is water in its tank."""
        return super().applicable() and self.pump.litres > 0

    async def perform(self) -> None:
        """Pump until cancelled: the bed is wet, the tank is empty, or a teammate goes on."""
        self.pump.open()
        try:
            while True:
                await asyncio.sleep(0.1)
                self.pump.litres -= 0.1
        finally:
            self.pump.close()
            if self.pump.litres <= 0:
                await asyncio.sleep(0.5)  # clean-up may take its time, up to 2 s
                self.pump.litres = 2.0
                print("tank filled", flush=True)


def behaviors() -> list[BehaviorSet]:
    """One set for each bed, and one pump for both."""
    pump = Pump()
    return [Water(bed, pump) for bed in ("south-bed", "north-bed")]
