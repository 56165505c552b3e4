"""A hook of mkdocs: the parsers of the command line in, the page reference/cli.md out; the page is not kept in the repository."""

from __future__ import annotations

import contextlib
import io
import os
from typing import Any

PAGE = "reference/cli.md"
WIDTH = "84"


def help_of(words: list[str]) -> str:
    """What `dlama WORDS --help` prints, in plain characters."""
    from dlama.apps.cli import main

    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        main([*words, "--help"])
    return text.getvalue().rstrip()


def page() -> str:
    """The whole page: a section per verb with its help."""
    from dlama.apps.cli import VERBS

    os.environ |= {"COLUMNS": WIDTH, "NO_COLOR": "1", "TERM": "dumb"}
    lines = [
        "# Command line",
        "",
        "Made from the parsers: this is what `dlama VERB --help` prints. Exit code 0: done; 1: something was found wrong or some"
        " jobs failed; 2: an input or an option cannot be used; the message names it.",
        "",
        "`dlama --tyro-print-completion bash` (or `zsh`) prints a script for shell completion.",
        "",
    ]
    for verb in VERBS:
        lines += [f"## dlama {verb}", "", "```text", help_of([verb]), "```", ""]
    return "\n".join(lines)


def on_files(files: Any, config: Any) -> Any:
    """Add the generated page to those of docs/."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, PAGE, content=page()))
    return files
