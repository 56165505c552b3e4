"""Parameters of job lists (oracles: the command line's signatures, values by hand)."""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from dlama.apps.cli import VERBS as COMMANDS
from dlama.errors import InputError
from dlama.jobs.parameters import FILES, KNOWN, NETWORKS, VERBS, checked
from dlama.jobs.perform import PERFORM


def options_of(taker: Callable[..., Any]) -> Iterator[str]:
    """Names of all that a verb takes."""
    hints = typing.get_type_hints(taker, include_extras=True)
    for name in inspect.signature(taker).parameters:
        yield from options_of(hints[name]) if dataclasses.is_dataclass(hints[name]) else [name]


@pytest.mark.parametrize("verb", VERBS)
def test_names_are_those_of_the_command_line(verb: str) -> None:
    """Oracle: the verb's signature; depth and mask of `remove` are one option there, output and report the list's affair."""
    wanted = set(options_of(COMMANDS[verb])) - {"output", "quiet", "json"}
    if "depth_and_mask" in wanted:
        wanted = wanted - {"depth_and_mask"} | {"depth", "mask"}
    assert set(VERBS[verb]) == wanted
    assert verb in PERFORM and set(PERFORM) == set(VERBS)


def test_defaults_of_the_command_line_are_parameters() -> None:
    """Every option of `dlama batch` that is no matter of the run is a parameter of some verb; all but input files are there."""
    from dlama.apps.verbs.batch import Running, Which

    own = {one.name for group in (Running, Which) for one in dataclasses.fields(group)}
    offered = set(options_of(COMMANDS["batch"])) - own - {"words", "output", "quiet", "json"}
    assert offered <= set(KNOWN)
    assert set(KNOWN) - offered == set(FILES) - {"camera", "to", "calib"}
    assert set(NETWORKS) <= set(KNOWN)


@pytest.mark.parametrize(
    ("name", "typed", "value"),
    [
        ("yaw", "-3.5", -3.5), ("yaw", 4, 4.0), ("seed", "7", 7), ("pivot", "auto", "auto"), ("pivot", "3", 3.0),
        ("sharpen", "no", False), ("sharpen", True, True), ("resize_depth", "nearest", "nearest"),
        ("metres_at", "3,4=2 5,6=7.5", ((3.0, 4.0, 2.0), (5.0, 6.0, 7.5))), ("metres_at", [[3, 4, 2]], ((3.0, 4.0, 2.0),)),
        ("only", "image, depth", ("image", "depth")), ("only", ["image"], ("image",)),
    ],
)  # fmt: skip
def test_values_as_typed_and_from_json(name: str, typed: Any, value: Any) -> None:
    """By hand."""
    assert checked("view", {"image": "a.png", "dolly": 1, name: typed})[name] == value


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"yaw": "five"}, "yaw is 'five'; a number is wanted"),
        ({"yaw": "nan"}, "yaw is 'nan'; a number is wanted"),
        ({"yaw": True}, "yaw is True; a number is wanted"),
        ({"yaw": 1, "seed": 1.5}, "seed is 1.5; a whole number is wanted"),
        ({"yaw": 1, "sharpen": "maybe"}, "sharpen is 'maybe'; true or false is wanted"),
        ({"yaw": 1, "mode": "lines"}, "mode is 'lines'; one of surface, points is wanted"),
        ({"yaw": 1, "mask": "m.png"}, "mask says nothing to view"),
        ({"yaw": 1, "to": "t.json"}, "to=TARGET.json and `yaw` contradict each other"),
        ({}, "nothing says where the new camera stands"),
    ],
)
def test_values_that_cannot_be(given: dict[str, Any], message: str) -> None:
    """Messages by hand."""
    with pytest.raises(InputError, match=message):
        checked("view", {"image": "a.png", **given})
    with pytest.raises(InputError, match="image is missing; view wants image"):
        checked("view", {"yaw": 3})


def test_points_and_boxes() -> None:
    """By hand, as typed and from JSON."""
    for click, box in (("1,2 3,4.5", "1,2,3,4"), ([[1, 2], [3, 4.5]], [1, 2, 3, 4])):
        found = checked("remove", {"image": "a.png", "click": click, "box": box})
        assert found["click"] == [[1, 2], [3, 4.5]] and found["box"] == [1, 2, 3, 4]
    with pytest.raises(InputError, match="box is '1,2,3'; X,Y,W,H in pixels is wanted"):
        checked("remove", {"image": "a.png", "box": "1,2,3"})
