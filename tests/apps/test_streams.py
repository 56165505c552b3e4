"""Closed, full and plain streams, and signals (oracles: redirections and exit codes of shells, what lies on the disk)."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from running import shell

from dlama.apps.terminal.output import errors_as_lines
from dlama.apps.terminal.streams import PLAINLY


@pytest.mark.parametrize(
    "environment",
    [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}],
)
def test_help_is_printed_where_only_ascii_can_be(tmp_path: Path, environment: dict[str, str]) -> None:
    done = shell("view --help", tmp_path, **environment)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.isascii() and len(done.stdout) > 10
    assert "\\u" not in done.stdout


def test_every_sign_of_help_has_a_plain_one() -> None:
    assert "• 20° → ╭─╮ 深".encode("ascii", PLAINLY) == b"* 20 deg -> +-+ \\u6df1"


@pytest.mark.slow
def test_names_that_are_not_text_are_printed(tmp_path: Path) -> None:
    """A name whose bytes are no UTF-8."""
    done = subprocess.run(
        [sys.executable, "-m", "dlama", "view", b"\xff.png", b"\xff.exr", "--fov", "60", "--yaw", "5", "-o", "out"],
        cwd=tmp_path,
        capture_output=True,
        timeout=600,
    )
    assert done.returncode == 2 and done.stderr.startswith(b"error: ") and b"Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux has a device that is always full")
@pytest.mark.parametrize("words", ["view --help", pytest.param("version", marks=pytest.mark.slow)])
def test_a_full_standard_output_is_one_line(tmp_path: Path, words: str) -> None:
    done = shell(f"{words} > /dev/full", tmp_path)
    assert (done.returncode, done.stderr) == (1, "error: output cannot be written: no space left on device\n")


@pytest.mark.slow
def test_a_closed_stream_does_not_stop_the_work(frame: Path) -> None:
    """And no file gets its number (oracle: the picture is a PNG)."""
    done = shell("view image.png depth.png --fov 60 --yaw 5 --filler telea --only image -o out >&- 2>&- <&-", frame)
    assert done.returncode == 0
    assert (frame / "out" / "image.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("words", ["view x >&-", "x >&-", "x 2> /dev/full", "x >&- 2>&-"])
def test_wrong_words_are_refused_though_a_stream_is_lost(tmp_path: Path, words: str) -> None:
    done = shell(words, tmp_path)
    assert (done.returncode, done.stdout) == (2, "") and "Traceback" not in done.stderr


STOPPED = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # nohup and shells' background jobs ignore both, as do their children
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from dlama.apps.terminal.output import errors_as_lines
from dlama.writing.atomic_write import new_directory
with errors_as_lines(), new_directory("out") as folder:
    (folder / "half.txt").write_text("half")
    print("ready", flush=True)
    signal.pause()
"""


@pytest.mark.parametrize(
    "number, line, code",
    [
        (signal.SIGINT, "error: interrupted; nothing half-written is left\n", 130),
        (signal.SIGTERM, "error: ended by SIGTERM; nothing half-written is left\n", 143),
        (signal.SIGHUP, "error: ended by SIGHUP; nothing half-written is left\n", 129),
    ],
)
def test_signals_end_with_one_line_and_leave_nothing(
    tmp_path: Path, number: signal.Signals, line: str, code: int
) -> None:
    def heard() -> None:
        """A suite started in the background or by nohup hands ignored signals on to its children."""
        signal.signal(number, signal.SIG_DFL)

    with subprocess.Popen(
        [sys.executable, "-c", STOPPED],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heard,
    ) as run:
        assert run.stdout is not None and run.stdout.readline() == "ready\n"
        run.send_signal(number)
        _, errors = run.communicate(timeout=600)
    assert (run.returncode, errors) == (code, line)
    assert list(tmp_path.iterdir()) == []


IN_A_CALLBACK = """
import ctypes, os, signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from dlama.apps.terminal.output import errors_as_lines
from dlama.writing.atomic_write import new_directory
def interrupted():
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):
        pass
with errors_as_lines(), new_directory("out") as folder:
    (folder / "half.txt").write_text("half")
    ctypes.CFUNCTYPE(None)(interrupted)()
    time.sleep(30)
    print("not stopped", flush=True)
"""


def test_ctrl_c_in_a_callback_of_a_c_library_is_not_lost(tmp_path: Path) -> None:
    """LLVM calls back for each kernel that is compiled, and ctypes prints an exception there and continues: a first run could not
    be stopped; a sleep, too, ends at once. Oracles: the exit code of shells, what lies on the disk."""
    done = subprocess.run(
        [sys.executable, "-c", IN_A_CALLBACK], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    line = "error: interrupted; nothing half-written is left\n"
    assert (done.returncode, done.stdout, done.stderr) == (130, "", line)
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_the_program_is_loaded_ends_with_one_line(tmp_path: Path) -> None:
    """The entry point, called as an installer's script calls it; a module that it loads early interrupts it. Oracle: the exit
    code of shells; SIGINT that the shell has ignored stays ignored."""
    (tmp_path / "tyro.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nraise SystemExit(7)\n")
    pyproject = Path(__file__).parents[2] / "pyproject.toml"
    module, function = re.findall(r'^dlama = "([\w.]+):(\w+)"$', pyproject.read_text("utf-8"), re.MULTILINE)[0]
    script = f"import sys\nfrom {module} import {function}\nsys.exit({function}())"
    line = "error: interrupted; nothing half-written is left\n"
    for handler, expected in ((signal.SIG_DFL, (130, "", line)), (signal.SIG_IGN, (7, "", ""))):
        done = subprocess.run(
            [sys.executable, "-c", script, "demo"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])},
            preexec_fn=partial(signal.signal, signal.SIGINT, handler),
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert (done.returncode, done.stdout, done.stderr) == expected


@pytest.mark.parametrize("value", ["0", pytest.param("x", marks=pytest.mark.slow)])
def test_threads_asked_for_must_be_a_number(tmp_path: Path, value: str) -> None:
    done = shell("worlds --count 1 --size 8", tmp_path, NUMBA_NUM_THREADS=value)
    assert done.returncode == 2
    assert done.stderr == (
        f"error: the environment variable NUMBA_NUM_THREADS is {value!r}; a whole number, 1 or more, is expected\n"
    )


@pytest.mark.parametrize(
    "error, line",
    [
        (PermissionError(13, "Permission denied", "a.png"), "error: a.png: permission denied\n"),
        (OSError(5, "Input/output error"), "error: output cannot be written: input/output error\n"),
        (MemoryError("Unable to allocate 298. GiB"), "error: out of memory: Unable to allocate 298. GiB; smaller"),
    ],
)
def test_errors_of_the_system_are_one_line(capsys: pytest.CaptureFixture[str], error: Exception, line: str) -> None:
    with pytest.raises(SystemExit), errors_as_lines():
        raise error
    shown = capsys.readouterr().err
    assert shown.startswith(line) and shown.count("\n") == 1
