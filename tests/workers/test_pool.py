"""Tasks on processes that die (oracles: squares, exit codes and signals by hand)."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parent))  # worker processes look for `tasks` where this process does
from tasks import deadly, square

from dlama.workers.pool import Pool, WorkerError, run_all


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_a_death_costs_its_own_task_alone(tmp_path: Path) -> None:
    """Killed once: it runs again; twice: it is left, and how it died is said; all others are answered."""
    tasks = [("square", 2), ("kill", None), ("kill", tmp_path / "once"), ("memory", 0), ("exit", 3), ("square", 3)]
    ended = {str(one.task): one for one in run_all(deadly, tasks, 2)}
    assert len(ended) == len(tasks)
    reported = {key: one.died or one.answer for key, one in ended.items()}
    assert [reported[str(task)] for task in tasks] == [
        4,
        "killed by SIGKILL, perhaps as memory ran out",
        "lived",
        "out of memory",
        "exit code 3",
        9,
    ]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_a_process_stays_warm_and_is_replaced_when_it_is_killed() -> None:
    """One process answers until it is killed while idle, which loses no task (oracle: another one answers, and has the threads
    that were asked for)."""
    with Pool(square, 1, threads=3) as pool:

        def answer(number: int) -> tuple[int, int, str]:
            pool.submit(number)
            (ended,) = pool.wait()
            return ended.answer

        (four, first, _), (nine, again, _) = answer(2), answer(3)
        os.kill(first, signal.SIGKILL)
        os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
        sixteen, other, threads = answer(4)
    assert (four, nine, sixteen) == (4, 9, 16) and again == first != other and threads == "3"


def test_closing_ends_what_runs() -> None:
    """No process is left when the pool is closed."""
    with Pool(deadly, 1) as pool:
        pool.submit(("wait", None))
        assert pool.free == 0
        (process,) = (worker.process for worker in pool._workers)
    assert not process.is_alive()


def test_a_script_without_a_guard_is_reported_so(tmp_path: Path) -> None:
    """Processes that cannot start are an error with the cause, and no endless row of processes."""
    script = tmp_path / "script.py"
    script.write_text("from dlama.workers.pool import run_all\nprint(list(run_all(len, [()], 1)))\n")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=600)
    assert done.returncode == 1
    assert WorkerError.__name__ in done.stderr.splitlines()[-1]
    assert 'if __name__ == "__main__":' in done.stderr.splitlines()[-1]


FIRST = """
import multiprocessing, signal, sys
from dlama.workers.threads import hold_interrupts

def answer(pipe):
    pipe.send(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))

if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")
    for _ in range(2):
        ours, theirs = context.Pipe()
        process = context.Process(target=answer, args=(theirs,))
        with hold_interrupts():
            process.start()
        print(ours.recv(), signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))
        process.join()
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no masks of signals")
def test_the_first_process_gets_no_ctrl_c_either(tmp_path: Path) -> None:
    """Oracle: the system's mask of signals in the new process, and in this one afterwards. The first one was interrupted while
    it loaded, with a traceback."""
    (tmp_path / "first.py").write_text(FIRST)
    done = subprocess.run([sys.executable, tmp_path / "first.py"], capture_output=True, text=True, timeout=600)
    assert (done.stdout.split("\n"), done.stderr) == (["True False", "True False", ""], "")
