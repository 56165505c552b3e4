"""The notebooks of examples/ run from top to bottom and are stored without outputs (oracles: Jupyter's schema, last values)."""

from __future__ import annotations

import ast
from pathlib import Path

import nbformat
import pytest

NOTEBOOKS = sorted((Path(__file__).parent.parent / "examples").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert cells and all(not cell.outputs and cell.execution_count is None for cell in cells)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No cell fails; a cell that ends in a noun shows HTML that loads nothing from elsewhere, less than 1 MB in all."""
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {"__name__": "__main__"}
    values = [
        run_cell(cell.source, space) for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"
    ]
    shown = [value._repr_html_() for value in values if hasattr(value, "_repr_html_")]
    assert len(shown) >= 3
    assert not any(address in html for html in shown for address in ("http://", "https://", 'src="//'))
    assert sum(map(len, shown)) < 1_000_000
    assert not list(tmp_path.iterdir())


def run_cell(source: str, space: dict[str, object]) -> object:
    """As a notebook does: its statements, then the value of an expression at its end; None without one."""
    cell = ast.parse(source)
    last = cell.body.pop() if isinstance(cell.body[-1], ast.Expr) else None
    exec(compile(cell, "cell", "exec"), space)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), space) if last else None
