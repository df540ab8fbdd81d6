"""The study: the very model and world of a real mission in virtual time, many times over.

`simulator` runs any mission file exactly and repeatably; `campaign` runs random ones and holds them to what must never fail.
"""
