"""The study: the very model and world of a real mission in virtual time, many times over.

`simulator` runs any mission file exactly and repeatably; `campaign` runs random ones and holds them to what must never fail.
`scenarios` draws the missions of the paper's experiments, and `kernel` runs thousands of those a second, with the very events
of the simulator; it needs the extra `study`.
"""
