"""Every example runs on the bundled data (oracles: their own asserts, and that each writes what it says)."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))


def test_examples_are_numbered() -> None:
    """01, 02, ... without a gap."""
    assert [path.name[:3] for path in EXAMPLES] == [f"{number:02d}_" for number in range(1, len(EXAMPLES) + 1)]
    assert len(EXAMPLES) >= 6


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(
    example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It runs in an empty folder, prints something, and writes only where it is reported."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example), "result"])
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out.strip()
    writes = "dlama.write(" in example.read_text("utf-8")
    assert [path.name for path in tmp_path.iterdir()] == (["result"] if writes else [])
    assert bool(list(tmp_path.rglob("meta.json"))) == writes
