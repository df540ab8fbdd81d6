"""The edge of the robot: messages come in here and leave from here, and nothing else in the project knows how.

`base` says what a bus can do. `zenoh_bus` does it over a network, through a router (`router` runs one inside a Python
process), in Zenoh's own `threads`; `memory` does it inside one event loop, for tests. Both hand what they receive to an
`inbox`, so that order, limits and failing handlers are the same on either, and one conformance suite (`tests/bus`) holds
them to it. `patterns` spells out which keys a key expression matches. Up to here nobody knows what the payloads mean.

`messenger` does: it sends and takes one participant's checked messages. `link` says what rules do to a message, and `faulty`
does it to what arrives at one robot, with a `delay_line` for what comes late; `shared` is one bus for several robots of a
process. Both are `wrapped` around another bus.
"""
