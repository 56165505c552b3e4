"""Requests of a browser in; a page out, on which pictures are marked, seen from elsewhere, completed and taken home.

Begin with `api.py`, which lists every address and the function behind it. A visit (`visits.py`) is one open page; it holds the
inputs (`inputs.py`), the marks (`marks.py`), and the completion with its result (`completions/`). `server.py` speaks HTTP, with
nothing but the standard library. The page itself is in assets/web.
"""
