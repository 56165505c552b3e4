"""What is found of a noun: once, apart for each function, and gone with it (oracles: a counter, the garbage collector)."""

from __future__ import annotations

import gc
import pickle
import weakref

import numpy as np

from dlama.geometry.view import View
from worlds import rgbd_of


def a_view() -> View:
    """Two by three pixels, at 2 m."""
    return View.from_rgbd(rgbd_of(np.full((2, 3), 2)))


class Found:
    """Something that a function finds."""


def test_each_function_is_called_once_for_a_noun() -> None:
    """Law: the same object comes back for the same noun and function, and another one for any other."""
    calls: list[View] = []

    def find(view: View) -> Found:
        calls.append(view)
        return Found()

    def find_more(view: View) -> Found:
        return Found()

    one, other = a_view(), a_view()
    assert one.find_once(find) is one.find_once(find)
    assert one.find_once(find) is not other.find_once(find) and one.find_once(find_more) is not one.find_once(find)
    assert len(calls) == 2 and calls[0] is one and calls[1] is other


def test_what_was_found_goes_with_the_noun_and_is_not_sent_with_it() -> None:
    """Law: nothing keeps it once the noun is gone; a pickled noun is as small as before."""
    view = a_view()
    before = len(pickle.dumps(view))
    found = weakref.ref(view.find_once(lambda _: Found()))
    assert found() is not None and len(pickle.dumps(view)) == before
    del view
    gc.collect()
    assert found() is None
