"""Imports inside the room run one way too (oracle: the syntax tree of every file): metrics < protocols < runner < report."""

from __future__ import annotations

from test_layers import SOURCE, imported

ORDER = ["metrics", "protocols", "runner", "report"]


def offences(folder: str, code: str) -> list[str]:
    """The imports of a folder's file that run the wrong way."""
    later = ORDER[ORDER.index(folder) + 1 :]
    return [name for name in imported(code) if name.startswith(tuple(f"dlama.evaluation.{one}" for one in later))]


def test_metrics_know_no_protocol_and_nothing_that_measures_knows_the_report() -> None:
    """A metric is pure, and a change of the report leaves every result as it is."""
    for folder in ORDER:
        files = list((SOURCE / "evaluation" / folder).glob("*.py"))
        assert len(files) > 3
        for file in files:
            assert offences(folder, file.read_text(encoding="utf-8")) == [], file


def test_this_guard_can_fail() -> None:
    """An import inside a function counts."""
    code = "def f():\n    from dlama.evaluation.report import panels\nfrom dlama.evaluation.metrics import depth"
    assert offences("runner", code) == ["dlama.evaluation.report.panels"] and offences("report", code) == []
