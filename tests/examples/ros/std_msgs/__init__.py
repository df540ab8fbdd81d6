"""Messages of this name, as far as examples/rounds uses them."""
