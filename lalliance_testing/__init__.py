"""Tests of missions under faults: a pytest plugin whose fixture runs a mission as real processes, or exactly in virtual time.

`plugin` holds what pytest calls, and imports nothing heavy, as every run of pytest on this machine loads it. `launch` is what
the fixture gives a test; `running` is one mission in a test's hands, whatever moves it: `real`, the launcher of `lalliance run`
in a thread, or `twin`, the exact simulator. `happenings` are what a test waits for, `judgement` what must hold of every
mission, `story` what a failed test tells. See docs/testing.md.
"""
