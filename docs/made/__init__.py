"""The parts of pages that are made from the code, and what the site needs to be built.

    python -m made      (from docs/, as `make docs` does)

writes each of them anew, between its marks in its page; the rest of a page is written by hand. The pages are committed with
what was made, so that they can be read without building anything, and a test holds them to the code. `links` is a hook of
MkDocs. Nothing of this folder gets into the site.
"""
