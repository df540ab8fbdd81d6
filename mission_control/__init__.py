"""The operator's side: the commands, the processes they start, and what a person sees of a mission."""
