"""Recordings of missions: MCAP files with every message of a mission as it was on the bus.

A recording has one channel for each key. Payloads are the very bytes of the bus (msgpack); a channel's schema says, as a
JSON Schema, what such a message holds once it is unpacked. Presences are channels too, with a payload of the recording's
own. The log time of a message is the wall clock when it was seen, its publish time the same instant on the recorder's
mission clock; both in nanoseconds. Two metadata records tell which mission it is, with the text of its file, and how the
recording ended.

A recorder ends its chunk and hands it to the system twice a second, so that one that is killed loses less than a second and
leaves a file that opens: `scan` reads such a file up to its last whole record. `writer` and `reader` are the two ends of the
format, `recorder` fills a file from a bus, `player` plays one onto a bus, and `convert` makes one that viewers open,
with schemas from `viewer_schema`.
"""
