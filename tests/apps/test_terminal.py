"""What the command prints, and what it loads (oracles: a pseudo terminal, an empty folder for numba's cache)."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from running import shell

WORDS = ["remove", "image.png", "depth.png", "mask.png", "--fov", "60", "--recipe", "paper", "--filler", "telea"]
"""A command that needs two kernels, and its words."""
OUT = ["--only", "image", "-o", "out"]


def on_a_terminal(words: list[str], folder: Path) -> str:
    """What a pseudo terminal shows of `python -m dlama WORDS`."""
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "dlama", *words], cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 65536):
            shown += chunk
    except OSError:  # Linux: the other end was closed
        pass
    os.close(ours)
    assert process.wait(timeout=600) == 0, shown
    return shown.decode()


@pytest.mark.slow
def test_a_terminal_sees_stages(frame: Path) -> None:
    """The bar names what is read and written; the summary is the last line."""
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", on_a_terminal([*WORDS, *OUT], frame))
    assert "remove: " in shown
    assert "write" in shown
    assert shown.rstrip().splitlines()[-1].startswith("out: ")


@pytest.mark.parametrize("verb", ["photo3d", "demo"])
def test_what_is_warned_of_while_a_verb_is_loaded_is_a_line(tmp_path: Path, verb: str) -> None:
    """Law: as what it warns of later, without file and source line (kernels that are not compiled warn at import)."""
    (tmp_path / "out").touch()
    picture = "none.jpg" if verb == "photo3d" else ""
    first, second = shell(f"{verb} {picture} -o out", tmp_path, NUMBA_DISABLE_JIT="1").stderr.splitlines()
    assert first.startswith("warning: NUMBA_DISABLE_JIT is set") and second.startswith("error: ")


@pytest.mark.slow
def test_a_pipe_sees_one_line_and_the_first_run_one_more(frame: Path) -> None:
    """No bar, no colours: one summary line on standard output. While kernels are compiled one line on standard error says so;
    once they are kept it stays empty (oracle: an empty folder for numba's cache, then the same one). With --quiet too, when one
    has to be compiled again."""
    kernels = frame / "kernels"
    cache = {"NUMBA_CACHE_DIR": str(kernels)}
    words = shlex.join([*WORDS, *OUT])
    first, second = (shell(words, frame, **cache) for _ in range(2))
    assert re.fullmatch(r"note: compiling kernels [^\n]* seconds[^\n]*\n", first.stderr)
    assert first.stdout.count("\n") == 1 and "\x1b" not in first.stdout
    assert second.stderr == "" and second.stdout.count("\n") == 1
    lost = next(path for path in kernels.rglob("visibility.violations*.nbi"))
    lost.unlink()
    quiet = shell(f"{words} --quiet", frame, **cache)
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    assert lost.exists()
