"""A network's contract: read as it is written, refused where it is missing, torn or contradicts itself."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dlama.errors import FileError, InputError
from dlama.inpainters.networks.contract import CONTRACT_KEY, Contract, demand, from_metadata, of_planes
from networks import contract


def read(**changes: object) -> Contract | None:
    """The contract of three planes with changes, through JSON."""
    return from_metadata({CONTRACT_KEY: json.dumps({**contract(3), **changes})}, "x.onnx")


def test_what_is_written_is_read() -> None:
    """Closed form: the record by hand equals the one from metadata, field by field."""
    assert read() == of_planes(3, network="lama")
    assert read(out_range=[-1, 1]) == of_planes(3, network="lama", out_range=(-1.0, 1.0))
    assert read(out_range=None) == of_planes(3, network="lama", out_range=None)
    assert from_metadata({}, "x.onnx") is None


def test_the_exporter_speaks_the_same_words() -> None:
    """Somebody else's code: the contract that the exporter writes is one that can be read."""
    from dlama.nets.architecture import GeneratorSettings
    from dlama.nets.export import contract as exported

    settings = GeneratorSettings()
    found = from_metadata({CONTRACT_KEY: json.dumps(exported(settings, "none", "a.pt", "0" * 64))}, "x.onnx")
    assert found == of_planes(3, network="lama", multiple=settings.multiple, minimum=settings.minimum)


@pytest.mark.parametrize("masks", [1, 2])
def test_pairs_have_one_mask_or_two(masks: int) -> None:
    """Somebody else's code: what the exporter writes for 7 -> 6 and 8 -> 6 planes is the record by hand, and no other."""
    from dlama.nets.architecture import GeneratorSettings
    from dlama.nets.export import contract as exported

    settings = GeneratorSettings(6 + masks, 6)
    found = from_metadata({CONTRACT_KEY: json.dumps(exported(settings, "none", "a.pt", "0" * 64))}, "x.onnx")
    assert found == of_planes(6, masks, network="lama", multiple=settings.multiple, minimum=settings.minimum)
    assert found is not None and found.masks == masks and len(found.in_planes) == 6 + masks
    assert found.in_planes[6:] == (("mask",) if masks == 1 else ("left mask", "right mask"))
    demand(found, 6, "x.onnx", "pair")


def test_each_picture_is_zeroed_in_its_own_hole() -> None:
    """Closed form: planes of 0.5 called -1..1 are 0 everywhere; of 1 they are 1 but for the hole; masks in their polarity."""
    planes, holes = np.ones((1, 6, 2, 2), np.float32), np.zeros((2, 2, 2), bool)
    holes[0, 0, 0] = holes[1, 1, 1] = True
    for mask, filled in (("1 = fill", 1), ("0 = fill", 0)):
        about = of_planes(6, 2, mask=mask, in_range=(-1.0, 1.0), out_range=(0.0, 2.0))
        fed = about.stacked(planes, holes)[0]
        np.testing.assert_array_equal(fed[:3], np.broadcast_to([[0, 1], [1, 1]], (3, 2, 2)))
        np.testing.assert_array_equal(fed[3:6], np.broadcast_to([[1, 1], [1, 0]], (3, 2, 2)))
        np.testing.assert_array_equal(fed[6:] == filled, holes)
        np.testing.assert_array_equal(about.stacked(planes / 2, holes)[:, :6], 0)
        np.testing.assert_array_equal(about.values(2 * planes), planes)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"in_planes": ["red", "green", "blue", "left mask", "right mask"]}, "a pair has 6"),
        ({"in_planes": ["red", "green", "blue", "mask", "mask"]}, "'left mask' and 'right mask'"),
        ({"in_planes": ["red", "green", "blue", "right mask", "left mask"]}, "'left mask' and 'right mask'"),
        ({"in_planes": ["red", "green", "blue"]}, "mask last"),
        ({"mask": "white"}, "mask is 'white'"),
        ({"hole": "noise"}, "hole is 'noise'"),
        ({"in_range": [1, 0]}, "in_range"),
        ({"in_range": 7}, "cannot be read"),
        ({"multiple": 0}, "multiple 0"),
        ({"in_planes": ["mask", "red", "green", "blue"]}, "mask last"),
        ({"out_planes": ["red"]}, "same planes"),
    ],
)
def test_a_bad_contract_is_refused(changes: dict, told: str) -> None:
    """Law: one line that names the file and the field."""
    with pytest.raises(FileError, match=told) as error:
        read(**changes)
    assert "x.onnx" in str(error.value) and "\n" not in str(error.value)


def test_a_torn_contract_is_refused() -> None:
    """Law: no JSON, and a field short."""
    with pytest.raises(FileError, match=r"x\.onnx: its contract cannot be read"):
        from_metadata({CONTRACT_KEY: "{"}, "x.onnx")
    with pytest.raises(FileError, match=r"x\.onnx: its contract lacks in_planes, .*minimum"):
        from_metadata({CONTRACT_KEY: "{}"}, "x.onnx")


def test_wrong_channels_name_the_right_filler() -> None:
    """Law: 5 -> 4 is no lama, but joint."""
    demand(of_planes(4), 4, "x.onnx", "joint")
    told = r"x\.onnx: takes 5 planes and gives 4; the filler 'lama' wants 4 in and 3 out; the filler 'joint'"
    with pytest.raises(InputError, match=told):
        demand(of_planes(4), 3, "x.onnx", "lama")
    told = r"takes 5 planes and gives 4; the filler 'pair' wants 7 or 8 in and 6 out; the filler 'joint'"
    with pytest.raises(InputError, match=told):
        demand(of_planes(4), 6, "x.onnx", "pair")
    with pytest.raises(InputError, match="5 planes"):
        of_planes(5)
    with pytest.raises(InputError, match="3 masks"):
        of_planes(6, 3)
