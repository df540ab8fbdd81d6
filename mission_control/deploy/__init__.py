"""What a deployment needs besides the processes themselves: keys."""
