"""Where to drive."""

from types import SimpleNamespace as Part


class NavigateToPose:
    class Goal:
        def __init__(self) -> None:
            pose = Part(position=Part(x=0.0, y=0.0, z=0.0), orientation=Part(x=0.0, y=0.0, z=0.0, w=1.0))
            self.pose = Part(header=Part(frame_id=""), pose=pose)
