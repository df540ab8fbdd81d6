"""Failure detection under loss: how soon a silence is noticed, how often a living robot is taken to be silent, what that costs.

`law` says what to expect, `probe`, `cost` and `reactions` measure in the exact simulator, `plan` runs it all on all cores,
`figures` and `tables` draw from rows and from nothing else. `python -m lalliance_study.detection run` and `... draw`.
"""
