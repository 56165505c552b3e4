"""Modules to load in; the same modules, loaded without a search for garbage among them, out."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def loading() -> Iterator[None]:
    """While modules are loaded no garbage is collected, and later not among them: they stay to the end of the process.

    Looking through their half a million objects again and again takes a tenth of a short command.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if collecting:
            gc.enable()
