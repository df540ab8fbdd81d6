"""How goals end; the numbers are those of ROS."""


class GoalStatus:
    STATUS_SUCCEEDED = 4
    STATUS_CANCELED = 5
