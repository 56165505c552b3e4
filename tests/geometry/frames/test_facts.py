"""What is found of a noun: once, apart for each function, and gone with it (oracles: a counter, the garbage collector)."""

from __future__ import annotations

import gc
import pickle
import weakref

import numpy as np

from dlama.geometry.view import View
from worlds import rgbd_of


class Found:
    """What a function finds of a view."""

    def __init__(self, view: View) -> None:
        pass


def test_what_is_found_is_found_once_and_goes_with_the_noun() -> None:
    """Law: the same object for the same noun and function, another for any other; once the noun is gone nothing keeps it, and a
    pickled noun is as small as before."""
    view, other = (View.from_rgbd(rgbd_of(np.full((2, 3), 2))) for _ in range(2))
    before = len(pickle.dumps(view))
    assert view.find_once(Found) is view.find_once(Found)
    assert view.find_once(Found) is not other.find_once(Found)
    assert view.find_once(Found) is not view.find_once(lambda view: Found(view))
    assert len(pickle.dumps(view)) == before
    found = weakref.ref(view.find_once(Found))
    del view
    gc.collect()
    assert found() is None
