"""HTML in; shown below a notebook's cell, or as a page in the web browser."""

from __future__ import annotations

import sys
import tempfile
import webbrowser
from importlib import import_module
from pathlib import Path


def show_html(content: str) -> None:
    """Show HTML below the cell of a running notebook; elsewhere as a page in the web browser, from a temporary file."""
    shell = sys.modules.get("IPython")  # a notebook has imported it; nobody else needs it
    if shell is not None and type(shell.get_ipython()).__name__ == "ZMQInteractiveShell":
        display = import_module("IPython.display")
        display.display(display.HTML(content))
        return
    webbrowser.open(temporary_page(content).as_uri())


def temporary_page(content: str) -> Path:
    """HTML as a page in a temporary file, which stays."""
    with tempfile.NamedTemporaryFile("w", prefix="dlama-", suffix=".html", encoding="utf-8", delete=False) as file:
        file.write(whole_page(content))
    return Path(file.name)


def whole_page(content: str) -> str:
    """HTML with the head of a page before it."""
    style = "margin:24px;font:15px system-ui,sans-serif;color-scheme:light dark"
    return f"<!doctype html><meta charset='utf-8'><title>dlama</title><body style='{style}'>{content}"
