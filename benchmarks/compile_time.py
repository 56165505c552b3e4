"""What the first run ever costs: seconds of processor time per kernel, compiled for one `dlama view` of the demo frame.

    python benchmarks/compile_time.py [--filler layered] [--functions]

Compiles into an empty folder of its own, so that it can be run again. Processor time, since what else the machine does lengthens
wall time; on a machine with nothing else to do both are the same but for a tenth. `--functions` lists pieces too, by own time.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import io
import os
import resource
import tempfile
import time
from importlib import resources
from pathlib import Path

DEMO = Path(str(resources.files("dlama"))) / "assets" / "demo"


def compile_demo(filler: str, folder: str) -> list[tuple[int, str, float, float]]:
    """Depth of nesting, name, seconds, seconds without those nested in it, of all that numba compiles for a view of the demo."""
    from numba.core.event import Event, Listener, install_listener

    running: list[list[float]] = []
    done = []

    class Clock(Listener):
        def on_start(self, event: Event) -> None:
            running.append([time.process_time(), 0.0])

        def on_end(self, event: Event) -> None:
            started, nested = running.pop()
            taken = time.process_time() - started
            if running:
                running[-1][1] += taken
            name = event.data["dispatcher"].py_func.__qualname__.replace(".<locals>", "")
            done.append((len(running), name, taken, taken - nested))

    from dlama.apps.cli import main

    words = ["view", str(DEMO / "street.jpg"), str(DEMO / "depth.png"), "--camera", str(DEMO / "camera.json")]
    with install_listener("numba:compile", Clock()), contextlib.redirect_stderr(io.StringIO()):
        main([*words, "--yaw", "20", "--filler", filler, "-o", f"{folder}/out"])
    return done


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--filler", default="layered")
    parser.add_argument("--functions", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = f"{folder}/kernels"
        done = compile_demo(args.filler, folder)
    if args.functions:
        own = collections.Counter[str]()
        for _, name, _, seconds in done:
            own[name] += seconds
        rows = own.most_common()
    else:
        rows = sorted(((name, taken) for nesting, name, taken, _ in done if nesting == 0), key=lambda row: -row[1])
    for name, taken in rows:
        print(f"  {name:28} {taken:6.2f}")
    kernels = [taken for nesting, _, taken, _ in done if nesting == 0]
    use = resource.getrusage(resource.RUSAGE_SELF)
    print(f"{len(kernels)} kernels of {len(done)} compiled functions: {sum(kernels):.1f} s of processor time")
    print(f"the whole command: {use.ru_utime + use.ru_stime:.1f} s")


if __name__ == "__main__":
    main()
