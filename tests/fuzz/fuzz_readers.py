"""Names of readers on the command line in; damaged files given to each; a line for each, and what failed, out.

    python tests/fuzz/fuzz_readers.py [EXAMPLES [READER ...]]

The process may take 1 GB more than it has at its start, and some processor time. An error that is not the package's
own, a crash, or memory running out is a failure; the edits that lead there are printed.
"""

from __future__ import annotations

import faulthandler
import resource
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

from mutations import Edit, edits_of, mutated
from readers import Reader, all_readers

from dlama.errors import DlamaError

EXAMPLES = 30
MEMORY = 10**9
"""Bytes."""
SECONDS = 200
"""Of processor time, in which a loop without end ends."""


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
        if any(isinstance(cause, MemoryError) for cause in causes) and not reader.reserves:
            raise MemoryError(f"reported as: {error}") from error
        if len(str(error)) > 1500 or "\n" in str(error) or str(folder) not in str(error):
            raise AssertionError(f"one line that names the file is expected: {str(error)[:200]}") from error


def fuzz(reader: Reader, examples: int) -> None:
    """A valid file, which must be read, and damaged ones."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / reader.name).write_bytes(reader.wrap(reader.data))
        try:
            reader.read(Path(folder) / reader.name)
        except DlamaError as error:
            if not reader.refused or reader.refused not in str(error):
                raise AssertionError(f"the valid file is refused: {error}") from error

        for edits in edits_of(reader.name, examples):
            try:
                check(reader, Path(folder), edits)
            except Exception:
                print(f"{reader.name}: edits {edits}", flush=True)
                raise


def main() -> int:
    """How many readers failed."""
    faulthandler.enable()
    examples = int(sys.argv[1]) if len(sys.argv) > 1 else EXAMPLES
    readers = all_readers()
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    names, failed = sys.argv[2:] or list(readers), list[str]()
    for name in names:
        print(name, flush=True)  # the last one where a process ends
        try:
            fuzz(readers[name], examples)
        except Exception:
            traceback.print_exc(limit=-6)
            failed.append(name)
    print(f"{len(names) - len(failed)} of {len(names)} readers pass, {examples} damaged files each; not so {failed}")
    return len(failed)


if __name__ == "__main__":
    sys.exit(main())
