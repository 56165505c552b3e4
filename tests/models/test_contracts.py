"""Contracts in the metadata of network files (oracle: the round trip, and messages that name the file)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from dlama.errors import FileError, InputError
from dlama.models.contracts import CONTRACT_KEY, contract_metadata, read_contract


@dataclass(frozen=True)
class Sizes:
    """A contract."""

    side: int = 1
    mean: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.side < 1:
            raise InputError("contract: side of 1 or more is expected")


def test_a_contract_comes_back_as_it_was_written() -> None:
    """Tuples included, which JSON does not have."""
    written = contract_metadata("sizes", Sizes(7, (0.5, 2.0)))
    assert read_contract(Sizes, written[CONTRACT_KEY], "sizes", Path("n.onnx"), strict=True) == Sizes(7, (0.5, 2.0))


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize(
    "text", ["{", "[]", '{"network": "sizes", "side": "a"}', '{"network": "sizes", "side": 0}', "[" * 100_000]
)
def test_what_is_no_contract_is_an_error_of_the_file(text: str, strict: bool) -> None:
    """Not JSON, no table, values of another type or out of range, lists nested deeper than Python reads."""
    with pytest.raises(FileError, match=r"^n\.onnx: "):
        read_contract(Sizes, text, "sizes", Path("n.onnx"), strict=strict)


def test_unknown_fields_are_refused_where_the_text_may_be_written_by_hand() -> None:
    """Elsewhere they are a later version's, and passed over."""
    text = '{"network": "sizes", "sides": 2}'
    assert read_contract(Sizes, text, "sizes", Path("n.onnx")) == Sizes()
    with pytest.raises(FileError, match=r"n\.onnx: its contract has sides; known are mean, side"):
        read_contract(Sizes, text, "sizes", Path("n.onnx"), strict=True)
