"""The web page: a mission as it is, and as it was at any instant so far, live or of a recording.

    sightings ─▶ chronicle ─▶ view, one per viewer ─▶ WebSocket ─▶ page/ in the browser
                     └─▶ metrics

`chronicle` puts sightings together and keeps the past in `series` that never grow beyond a limit; `losses` tells what share of
messages is lost on the way. `view` knows what one viewer has seen already and says what is new. These are pure. `site` serves
them over HTTP, `guard` says who may, `disturb` hands a viewer's faults on to the mission, and `feed` fetches the sightings.
`page/` is served as it lies there: modules of JavaScript, one style sheet, and a font, with its licence.
"""
