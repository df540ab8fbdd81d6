"""Looking at a mission from outside: what comes over the bus, what it adds up to, and what it means in words.

`onlooker` listens on a bus and hands on sightings, a message each, exactly as it came; a recording holds the same. `story`
puts sightings together to the mission as seen so far, and `happened` and `words` say what happened. Nothing here takes part
in a mission.
"""
