"""The faults of benchmarks/mutants.py can still be put in (oracle: the files): each text stands once, each test exists."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_every_fault_can_be_put_in_and_names_tests_that_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    from mutants import MUTANTS

    gone = [one.name for one in MUTANTS if text(f"src/dlama/{one.file}").count(one.old) != 1]
    tests = {words for one in MUTANTS for words in one.tests.split()}
    missing = [
        words for words in tests if words.partition("::")[2].partition("[")[0] not in text(words.partition("::")[0])
    ]
    assert (gone, missing) == ([], [])
    sys.modules.pop("mutants")


def text(file: str) -> str:
    """What a file of the checkout holds; of a folder its names; nothing where there is none."""
    path = ROOT / file
    if path.is_dir():
        return " ".join(each.name for each in path.iterdir())
    return path.read_text("utf-8") if path.is_file() else ""
