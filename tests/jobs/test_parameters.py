"""Parameters of job lists (oracles: the command line's signatures, values by hand)."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.apps.cli import VERBS as COMMANDS
from dlama.errors import InputError
from dlama.jobs.batch import check_defaults
from dlama.jobs.job import job_of
from dlama.jobs.parameters import FILES, KNOWN, NEEDED, NETWORKS, VERBS, check_parameters
from dlama.jobs.verbs import PERFORM
from verb_options import fields_of


def options_of(verb: str) -> set[str]:
    """Names of all that a verb of the command line takes."""
    return {name for name, *_ in fields_of(COMMANDS[verb])}


JSON_VALUES = (
    3, -1, 1.5, float("nan"), True, [], [1], [None], [[1, 2]], [[1, 2, 3]], {}, {"a": 1}, 10**400, "abc", "1,2", "nan,1",
    "1e999,2", ["a"], [{"x": 1}], "a\0b", [1, 2, 3], b"x", object(), np.array([1, 2]), Path("a.png"),
)  # fmt: skip
"""What may stand in a row by mistake."""


@pytest.mark.parametrize("verb", VERBS)
def test_no_value_of_a_row_ends_the_run(verb: str) -> None:
    """Law: a bad value is the error of its job; `only: 3` and `click: 5` had ended the whole run with a TypeError."""
    files = dict.fromkeys(NEEDED[verb], "a.png")
    for name in VERBS[verb]:
        for value in JSON_VALUES:
            job = job_of({"id": "a", "verb": verb, **files, name: value}, {}, "/list", "jobs.jsonl: line 1")
            assert job.error is None or job.error.startswith("jobs.jsonl: line 1: ")
            assert len(job.options_hash) == 16


def test_a_path_in_a_row_is_a_file() -> None:
    """Rows in Python hold paths as well as texts; a file among the defaults is one of the working directory."""
    job = job_of({"id": "a", "verb": "depth", "image": Path("rgb", "a.png")}, {}, "/list", "job 1")
    assert job.error is None and job.files == {"image": str(Path("/list/rgb/a.png"))}
    job = job_of(
        {"id": "a", "verb": "depth", "image": "file:///a.png", "depth_model": "file:///n.onnx"}, {}, "/list", ""
    )
    assert job.files == {"image": "/a.png"} and job.parameters["depth_model"] == "/n.onnx"
    given = check_defaults(None, {"camera": "cam.json", "depth_model": "moge-small", "to": Path("to.json"), "fov": 3})
    here = Path.cwd()
    expected = {"camera": str(here / "cam.json"), "depth_model": "moge-small", "to": str(here / "to.json"), "fov": 3}
    assert given == expected


@pytest.mark.parametrize("verb", VERBS)
def test_names_are_those_of_the_command_line(verb: str) -> None:
    """Oracle: the verb's signature; depth and mask of `remove` are one option there, output and report the list's affair."""
    expected = options_of(verb) - {"output", "quiet", "json"}
    if "depth_and_mask" in expected:
        expected = expected - {"depth_and_mask"} | {"depth", "mask"}
    assert set(VERBS[verb]) == expected
    assert verb in PERFORM and set(PERFORM) == set(VERBS)


def test_defaults_of_the_command_line_are_parameters() -> None:
    """Every option of `dlama batch` that is no matter of the run is a parameter of some verb; all but input files are there."""
    from dlama.apps.verbs.batch import Running, Which

    own = {one.name for group in (Running, Which) for one in dataclasses.fields(group)}
    offered = options_of("batch") - own - {"words", "output", "quiet", "json"}
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
        ("also", "scene,points", ("scene", "points")),
    ],
)  # fmt: skip
def test_values_as_typed_and_from_json(name: str, typed: Any, value: Any) -> None:
    """By hand."""
    assert check_parameters("view", {"image": "a.png", "dolly": 1, name: typed})[name] == value


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"yaw": "five"}, "yaw is 'five'; a number is expected"),
        ({"yaw": "nan"}, "yaw is 'nan'; a finite number is expected"),
        ({"yaw": True}, "yaw is True; a number is expected"),
        ({"yaw": 1, "seed": 1.5}, "seed is 1.5; a whole number is expected"),
        ({"yaw": 1, "sharpen": "maybe"}, "sharpen is 'maybe'; true or false is expected"),
        ({"yaw": 1, "mode": "lines"}, "mode is 'lines'; one of surface, points is expected"),
        ({"yaw": 1, "mask": "m.png"}, "mask does not apply to view"),
        ({"yaw": 1, "to": "t.json"}, "to=TARGET.json and yaw contradict each other"),
        ({}, "no camera move is given"),
    ],
)
def test_values_that_cannot_be(given: dict[str, Any], message: str) -> None:
    """Messages by hand."""
    with pytest.raises(InputError, match=message):
        check_parameters("view", {"image": "a.png", **given})
    with pytest.raises(InputError, match="image is missing; view needs image"):
        check_parameters("view", {"yaw": 3})


def test_points_and_boxes() -> None:
    """By hand, as typed and from JSON."""
    for click, box in (("1,2 3,4.5", "1,2,3,4"), ([[1, 2], [3, 4.5]], [1, 2, 3, 4])):
        found = check_parameters("remove", {"image": "a.png", "click": click, "box": box})
        assert found["click"] == [[1, 2], [3, 4.5]] and found["box"] == [1, 2, 3, 4]
    assert check_parameters("remove", {"image": "a.png", "click": [256, 345]})["click"] == [[256, 345]]
    with pytest.raises(InputError, match="box is '1,2,3'; X,Y,W,H in pixels is expected"):
        check_parameters("remove", {"image": "a.png", "box": "1,2,3"})
