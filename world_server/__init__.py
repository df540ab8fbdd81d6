"""The world: it owns what exists, the tasks and their state, the robots' bodies and their failures."""
