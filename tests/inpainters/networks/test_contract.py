"""A network's contract: read as it is written, refused where it is missing, torn or contradicts itself."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from dlama.errors import FileError, InputError
from dlama.inpainters.networks.contract import (
    CONTRACT_KEY,
    Contract,
    from_metadata,
    generator_contract,
    generator_metadata,
    require_planes,
)
from dlama.nets.architecture import GeneratorSettings
from tiny_networks import contract, contract_of_planes


def read(**changes: object) -> Contract | None:
    """The contract of three planes with changes, through JSON."""
    return from_metadata({CONTRACT_KEY: json.dumps({**contract(3), **changes})}, "x.onnx")


def test_what_is_written_is_read() -> None:
    """Closed form: the record by hand equals the one from metadata, field by field."""
    assert read() == replace(contract_of_planes(3), network="lama")
    assert read(out_range=[-1, 1]) == replace(contract_of_planes(3), network="lama", out_range=(-1.0, 1.0))
    assert read(out_range=None) == replace(contract_of_planes(3), network="lama", out_range=None)
    assert from_metadata({}, "x.onnx") is None


def test_a_generators_metadata_is_read_back(tmp_path: Path) -> None:
    """Round trip, and hashlib: the record by hand; next to it licence, source file, its digest and all settings."""
    source = tmp_path / "a.pt"
    source.write_bytes(b"weights")
    for activation, scale in (("tanh", (-1, 1)), ("none", None), ("sigmoid", (0, 1))):
        settings = GeneratorSettings(activation=activation)
        assert generator_contract(settings).out_range == scale
    words = generator_metadata(settings, source, "MIT")
    by_hand = replace(contract_of_planes(3), network="lama", multiple=settings.multiple, minimum=settings.minimum)
    assert from_metadata(words, "x.onnx") == generator_contract(settings) == by_hand
    assert json.loads(words[CONTRACT_KEY]) == {
        **contract(3),
        "licence": "MIT",
        "source": "a.pt",
        "source_sha256": hashlib.sha256(b"weights").hexdigest(),
        "architecture": asdict(settings),
    }


@pytest.mark.parametrize(("in_range", "out_range"), [((-1.0, 1.0), None), ((0.0, 1.0), (-1.0, 1.0))])
def test_what_comes_out_is_brought_to_0_and_1(in_range: tuple, out_range: tuple | None) -> None:
    """Closed form: -1..1 becomes 0..1, reported by out_range, or by in_range where that is None; nothing is clipped."""
    about = replace(contract_of_planes(3), in_range=in_range, out_range=out_range)
    np.testing.assert_allclose(about.unit_output(np.float32([-1, 0, 0.5, 1, 3])), [0, 0.5, 0.75, 1, 2])


def test_a_depth_plane_says_its_scale() -> None:
    """Frozen words: how trained files in use say it; a network of colours alone has no such line."""
    words = json.loads(generator_contract(GeneratorSettings(5, 4)).metadata()[CONTRACT_KEY])
    assert words["depth"] == "inverse depth, 0 = infinity, 0.75 = what 99 % of the known pixels do not exceed"
    assert words["in_planes"] == ["red", "green", "blue", "depth", "mask"]
    assert "depth" not in json.loads(generator_contract(GeneratorSettings()).metadata()[CONTRACT_KEY])


@pytest.mark.parametrize("masks", [1, 2])
def test_pairs_have_one_mask_or_two(masks: int) -> None:
    """Closed form: for 7 -> 6 and 8 -> 6 planes left first, of the masks too; it is the record by hand, and no other."""
    settings = GeneratorSettings(6 + masks, 6)
    found = generator_contract(settings)
    by_hand = replace(
        contract_of_planes(6, masks), network="lama", multiple=settings.multiple, minimum=settings.minimum
    )
    assert found == from_metadata(found.metadata(), "x.onnx") == by_hand
    assert found.out_planes == ("red", "green", "blue", "other red", "other green", "other blue")
    assert found.masks == masks and len(found.in_planes) == 6 + masks
    assert found.in_planes[6:] == (("mask",) if masks == 1 else ("left mask", "right mask"))
    require_planes(found, 6, "x.onnx", "pair")


@pytest.mark.parametrize("planes", [(4, 4), (4, 1), (5, 3)])
def test_generators_that_no_contract_fits_are_refused(planes: tuple[int, int]) -> None:
    """Law: what cannot be run is not written either; no mask, planes that do not come back, two masks of one picture."""
    with pytest.raises(InputError, match="contract"):
        generator_contract(GeneratorSettings(*planes))


def test_each_picture_is_zeroed_in_its_own_hole() -> None:
    """Closed form: planes of 0.5 called -1..1 are 0 everywhere; of 1 they are 1 but for the hole; masks in their polarity."""
    planes, holes = np.ones((1, 6, 2, 2), np.float32), np.zeros((2, 2, 2), bool)
    holes[0, 0, 0] = holes[1, 1, 1] = True
    for mask, filled in (("1 = fill", 1), ("0 = fill", 0)):
        about = replace(contract_of_planes(6, 2), mask=mask, in_range=(-1.0, 1.0), out_range=(0.0, 2.0))
        fed = about.network_input(planes, holes)[0]
        np.testing.assert_array_equal(fed[:3], np.broadcast_to([[0, 1], [1, 1]], (3, 2, 2)))
        np.testing.assert_array_equal(fed[3:6], np.broadcast_to([[1, 1], [1, 0]], (3, 2, 2)))
        np.testing.assert_array_equal(fed[6:] == filled, holes)
        np.testing.assert_array_equal(about.network_input(planes / 2, holes)[:, :6], 0)
        np.testing.assert_array_equal(about.unit_output(2 * planes), planes)


@pytest.mark.parametrize(
    ("changes", "reported"),
    [
        ({"in_planes": ["red", "green", "blue", "left mask", "right mask"]}, "a pair has 6"),
        ({"in_planes": ["red", "green", "blue", "mask", "mask"]}, "'left mask' and 'right mask'"),
        ({"in_planes": ["red", "green", "blue"]}, "mask last"),
        ({"mask": "white"}, "mask is 'white'"),
        ({"hole": "noise"}, "hole is 'noise'"),
        ({"in_range": [1, 0]}, "in_range"),
        ({"in_range": 7}, "in_range"),
        ({"multiple": 0}, "multiple is 0"),
        ({"multiple": 10**9}, "multiple is 1000000000"),
        ({"minimum": 10**400}, "minimum"),
        ({"side": 512.5}, "side is 512.5"),
        ({"in_range": [0, 1e300]}, "in_range"),
        ({"out_range": [0, float("nan")]}, "out_range"),
        ({"in_planes": [f"plane {n}" for n in range(1000)]}, "same planes"),
        ({"in_planes": [["red"]]}, "in_planes"),
        ({"network": None}, "network"),
        ({"out_planes": "red"}, "same planes"),
        ({"out_planes": ["red"]}, "same planes"),
    ],
)
def test_a_bad_contract_is_refused(changes: dict, reported: str) -> None:
    """Law: one line that names the file and the field."""
    with pytest.raises(FileError, match=reported) as error:
        read(**changes)
    assert "x.onnx" in str(error.value) and "\n" not in str(error.value)


def test_a_torn_contract_is_refused() -> None:
    """Law: no JSON, and a field short."""
    with pytest.raises(FileError, match=r"x\.onnx: its contract cannot be read"):
        from_metadata({CONTRACT_KEY: "{"}, "x.onnx")
    for text in ("[" * 100_000, "[]", "7", '{"a": "' + "a" * 2_000_000 + '"}'):
        with pytest.raises(FileError, match=r"x\.onnx: its contract") as refusal:
            from_metadata({CONTRACT_KEY: text}, "x.onnx")
        assert len(str(refusal.value)) < 300
    with pytest.raises(FileError, match=r"x\.onnx: its contract lacks in_planes, .*minimum"):
        from_metadata({CONTRACT_KEY: "{}"}, "x.onnx")


def test_wrong_channels_name_the_right_filler() -> None:
    """Law: 5 -> 4 is no lama, but joint."""
    require_planes(contract_of_planes(4), 4, "x.onnx", "joint")
    reported = r"x\.onnx: takes 5 planes and gives 4; the filler 'lama' needs 4 in and 3 out; the filler 'joint'"
    with pytest.raises(InputError, match=reported):
        require_planes(contract_of_planes(4), 3, "x.onnx", "lama")
    reported = r"takes 5 planes and gives 4; the filler 'pair' needs 7 or 8 in and 6 out; the filler 'joint'"
    with pytest.raises(InputError, match=reported):
        require_planes(contract_of_planes(4), 6, "x.onnx", "pair")
