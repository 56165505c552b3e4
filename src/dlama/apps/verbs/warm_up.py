"""`dlama warm-up`: kernels compiled ahead of their first use, by several processes, out."""

from __future__ import annotations

import time

from dlama.apps.options import Report
from dlama.apps.terminal.output import report_result
from dlama.errors import OutputError, format_count


def warm_up(*, report: Report) -> None:
    """Compiles what commands compute with, so that the first of them does not wait: for images of machines, and for CI."""
    from dlama.geometry.kernels.ahead import listed_kernels, start_compiling
    from dlama.models.network_file import processor_count

    with report_result("warm-up", report) as result:
        started = time.perf_counter()
        running = start_compiling("all", processor_count())
        if any([one.wait() for one in running]):  # noqa: C419  (all of them end)
            raise OutputError(
                "kernels could not be compiled, or not be kept: `python -m dlama.geometry.kernels.ahead all 0 1` says why"
            )
        count = len(listed_kernels())
        line = f"{format_count(count, 'kernel')} compiled or found on disk, {time.perf_counter() - started:.1f} s"
        result.add(line, kernels=count)
