"""Names of readers on the command line in; damaged files given to each in a process of its own; a line for each that fails out.

    python tests/fuzz/fuzz_readers.py [EXAMPLES [READER ...]]

A process may take 1 GB more than it has at its start, and some seconds of processor time. An error that is not the package's
own, a crash, or memory running out is a failure; the edits that lead there are printed.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import resource
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings
from mutations import EDITS, Edit, mutated
from readers import Reader, all_readers

from dlama.errors import DlamaError

EXAMPLES = 40
MEMORY = 10**9
"""Bytes."""
SECONDS = 60
"""Of processor time, for all examples of one reader."""


def check(reader: Reader, folder: Path, edits: list[Edit]) -> None:
    """One damaged file. Raises what the reader raises, if that is not the package's own, or if memory ran out."""
    path = folder / reader.name
    path.write_bytes(reader.wrap(mutated(reader.data, edits)))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            reader.read(path)
    except DlamaError as error:
        causes: list[BaseException | None] = [error]
        while causes[-1] is not None:
            causes.append(causes[-1].__cause__ or causes[-1].__context__)
        if any(isinstance(cause, MemoryError) for cause in causes):
            raise MemoryError(f"told as: {error}") from error
        if len(str(error)) > 1500:
            raise AssertionError(f"a message of {len(str(error))} characters: {str(error)[:200]}") from error


def fuzz(reader: Reader, examples: int) -> None:
    """A valid file, which must be read, and damaged ones."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / reader.name).write_bytes(reader.wrap(reader.data))
        try:
            reader.read(Path(folder) / reader.name)
        except DlamaError as error:
            if not reader.refused or reader.refused not in str(error):
                raise AssertionError(f"the valid file is refused: {error}") from error

        @settings(max_examples=examples, deadline=None, database=None, derandomize=True, phases=[Phase.generate],
                  suppress_health_check=list(HealthCheck))  # fmt: skip
        @given(EDITS)
        def run(edits: list[Edit]) -> None:
            try:
                check(reader, Path(folder), edits)
            except BaseException:
                print(f"{reader.name}: edits {edits}", flush=True)
                raise

        run()


def in_a_process(reader: Reader, examples: int) -> int:
    """The exit status of a process that fuzzes one reader under limits."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1]
    status = 1
    try:
        faulthandler.enable()
        with contextlib.suppress(OSError):
            pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
            limit = pages * resource.getpagesize() + MEMORY
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        fuzz(reader, examples)
        status = 0
    except BaseException:
        traceback.print_exc(limit=-6)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def main() -> int:
    """How many readers failed."""
    examples = int(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES
    readers = all_readers()
    names = sys.argv[2:] or list(readers)
    failed = 0
    for name in names:
        status = in_a_process(readers[name], examples)
        if status:
            failed += 1
            print(f"FAILED {name}: wait status {status}", flush=True)
    print(f"{len(names) - failed} of {len(names)} readers pass, {examples} damaged files each")
    return failed


if __name__ == "__main__":
    sys.exit(main())
