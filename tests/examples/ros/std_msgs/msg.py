"""Plain messages."""


class String:
    def __init__(self, data: str = "") -> None:
        self.data = data
