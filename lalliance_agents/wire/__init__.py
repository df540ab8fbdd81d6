"""What goes over the bus: how keys are spelled, and how messages are packed, checked and ordered. Pure."""
