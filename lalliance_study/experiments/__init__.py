"""The study's experiments: what is compared on which missions, carried out in parts, and kept as rows.

`presets` says which experiments there are, as data; `plan` numbers their scenarios and cuts them into parts; a part is carried
out by `work`, wherever there is a processor; `runner` hands parts out and keeps what comes back: `rows` in Parquet files, one a
part, and a `manifest` of all that shaped them. Whoever reports reads these two and nothing else.
"""
