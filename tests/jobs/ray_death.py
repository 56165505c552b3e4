"""A list, a folder for results, and how many results come before the only node dies, in; what `dlama batch --ray local` prints
and its exit code out. A program of its own, as a cluster ends best with the process that made it."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path

from dlama.apps.cli import main as dlama
from dlama.jobs import on_ray

WITHIN_SECONDS = 4.0
"""How long no node is waited for here."""


def kill_node(out: Path, before: int) -> None:
    """End the only node once so many results are there."""
    import ray

    while len(list(out.rglob("meta.json"))) < before:
        time.sleep(0.05)
    (raylet,) = ray._private.worker._global_node.all_processes["raylet"]
    os.kill(raylet.process.pid, signal.SIGKILL)


def main(jobs: str, out: str, before: int) -> None:
    """Exit code of `dlama batch`."""
    on_ray.BACK_SECONDS, on_ray.LOOK_SECONDS, on_ray.NODE_SECONDS = WITHIN_SECONDS, 1.0, 5.0
    threading.Thread(target=kill_node, args=(Path(out), before), daemon=True).start()
    words = ["batch", jobs, "-o", out, "--ray", "local", "--workers", "1", "--threads", "1"]
    sys.exit(dlama([*words, "--fov", "60", "--filler", "telea", "--only", "image,depth"]))


if __name__ == "__main__":
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ |= {f"RAY_health_check_{name}": "500" for name in ("initial_delay_ms", "period_ms", "timeout_ms")}
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
