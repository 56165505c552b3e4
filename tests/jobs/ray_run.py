"""A list, a folder for results, and how many results come before a node dies, in; a run on a cluster of several nodes on this
computer, and a line of JSON for each result, out. A program of its own, as a cluster ends best with the process that made it."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

from small_jobs import FAST, deadly_work

from dlama.jobs import batch as room

NO_CLUSTER = 77
"""Exit code where Ray's own processes did not start."""
SIZE = {"object_store_memory": 80_000_000}


def main(jobs: str, out: str, before: int) -> None:
    """A head without processors, two nodes of one each; one of them is killed, a third joins."""
    import ray
    from ray.cluster_utils import Cluster

    try:
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False, **SIZE})
        nodes = [cluster.add_node(num_cpus=1, **SIZE) for _ in range(2)]
        ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
    except Exception as error:  # whatever Ray raises where its processes do not come up in time
        print(f"no cluster: {error}", file=sys.stderr)
        sys.exit(NO_CLUSTER)
    room.work = deadly_work
    for count, row in enumerate(room.batch(jobs, out, ray="auto", threads=1, **FAST), 1):
        print(f"row {row.as_json()}", flush=True)
        if count == before:
            cluster.remove_node(nodes[0], allow_graceful=False)
            with suppress(Exception):  # a busy computer may not start it in time; the other node is there
                cluster.add_node(num_cpus=1, **SIZE)


if __name__ == "__main__":
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
