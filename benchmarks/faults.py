"""Verbs that write in; each run again and again with one fault of the system put into it, and whether its law held, out.

    python benchmarks/faults.py [--verbs view remove ...] [--kinds full kill ...] [--every 1]

full      the n-th write, and every later one, finds the disk full: one line, exit code 2, what lay there before lies there still
kill      SIGKILL right before, and right after, the n-th rename: what is visible is whole, and the next run leaves nothing else
read-only the folder, or what it lies in, is closed to this user: one line, exit code 2, nothing changed
clock     the clock jumps ten years back and forth at every look: the results are those of a clock that does not

A small C library that is loaded before the system's own (LD_PRELOAD; Linux, a C compiler) counts writes and renames below the
folder and makes them fail; so what Python, OpenCV, OpenEXR and ONNX Runtime write is all the same. `--every 5` takes every
fifth place. A run that broke its law is printed, and the exit code is how many there were.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import hashlib
import io
import itertools
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/uio.h>
#include <unistd.h>
static char under[512]; static long none[2], *counts = none, full_at, kill_at; static int after;
void arm(const char *folder, const char *file, long full, long kill, int behind) {
  char all[2048]; snprintf(all, 2048, "%s|%s|%ld|%ld|%d", folder, file, full, kill, behind); setenv("DLAMA_ARM", all, 1);
  int fd = open(file, O_RDWR); counts = mmap(0, 16, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0); close(fd);
  strncpy(under, folder, 511); full_at = full; kill_at = kill; after = behind; }
__attribute__((constructor)) static void again(void) {  /* in the processes that an armed one starts */
  char folder[512], file[512]; long full, kill; int behind; const char *all = getenv("DLAMA_ARM");
  if (all && sscanf(all, "%511[^|]|%511[^|]|%ld|%ld|%d", folder, file, &full, &kill, &behind) == 5)
    arm(folder, file, full, kill, behind); }
static int ours(int fd) {
  char link[64], path[1024]; if (!under[0]) return 0;
  snprintf(link, 64, "/proc/self/fd/%d", fd); ssize_t n = readlink(link, path, 1023);
  if (n < 0) return 0; path[n] = 0; return strncmp(path, under, strlen(under)) == 0; }
static int no_room(int fd) { if (!ours(fd)) return 0; long n = __sync_add_and_fetch(counts, 1); return full_at && n >= full_at; }
#define REAL(name) static __typeof__(&name) real; if (!real) real = (__typeof__(&name)) dlsym(RTLD_NEXT, #name)
ssize_t write(int fd, const void *b, size_t n) {
  REAL(write); if (no_room(fd)) { errno = ENOSPC; return -1; } return real(fd, b, n); }
ssize_t pwrite64(int fd, const void *b, size_t n, off64_t o) {
  REAL(pwrite64); if (no_room(fd)) { errno = ENOSPC; return -1; } return real(fd, b, n, o); }
ssize_t writev(int fd, const struct iovec *v, int n) {
  REAL(writev); if (no_room(fd)) { errno = ENOSPC; return -1; } return real(fd, v, n); }
size_t fwrite(const void *b, size_t s, size_t n, FILE *f) {
  REAL(fwrite); if (no_room(fileno(f))) { errno = ENOSPC; return 0; } return real(b, s, n, f); }
int rename(const char *a, const char *b) {
  REAL(rename); int mine = under[0] && strncmp(b, under, strlen(under)) == 0;
  long n = mine ? __sync_add_and_fetch(counts + 1, 1) : 0;
  if (n && n == kill_at && !after) kill(getpid(), SIGKILL);
  int done = real(a, b);
  if (n && n == kill_at && after) kill(getpid(), SIGKILL);
  return done; }
"""
RESUMED = ("sequence", "worlds", "evaluate", "batch")
"""Verbs that leave what is done, and go on from there."""
VOLATILE = re.compile(
    r"(^|/)(meta\.json|cases/[^/]*\.json|report\.html|summary\.(json|md)|timings\.csv|manifest\.csv)$|\.webp$"
)
"""Files that say how long it took; they must be whole, not the same."""


def shim(folder: Path) -> Path:
    """The library, compiled."""
    source, library = folder / "shim.c", folder / "shim.so"
    source.write_text(SHIM)
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-w", "-o", library, source, "-ldl"], check=True)
    return library


def verbs(folder: Path) -> dict[str, tuple[list[str], str]]:
    """Verb -> its words but -o, and the name of what it writes; inputs are made in `folder`."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))  # before the `worlds` of this folder
    from box_frame import small_frame

    frame = small_frame(folder / "frame")
    picture, lens, fast = [str(frame / "image.png"), str(frame / "depth.png")], ["--fov", "60"], ["--filler", "telea"]
    calib = frame / "calib.txt"
    calib.write_text("cam0=[55 0 32; 0 55 24; 0 0 1]\ncam1=[55 0 32; 0 55 24; 0 0 1]\ndoffs=0\nbaseline=200\n")
    disparity = frame / "disparity.npy"
    import numpy as np

    np.save(disparity, np.full((48, 64), 4, np.float32))
    right = frame / "right.png"
    from PIL import Image

    Image.fromarray(np.roll(np.array(Image.open(picture[0])), -4, 1)).save(right)
    pair = [picture[0], str(right), "--calib", str(calib), "--disparity", str(disparity)]
    jobs = frame / "jobs.jsonl"
    rows = [{"id": f"j{n}", "verb": "view", "image": picture[0], "depth": picture[1], "yaw": n} for n in range(1, 3)]
    jobs.write_text("".join(json.dumps(row) + "\n" for row in rows))
    run("worlds", "--count", "1", "--size", "48", "-o", str(folder / "inputs" / "worlds"))
    run("view", *picture, *lens, *fast, "--yaw", "5", "--only", "scene", "-o", str(folder / "inputs" / "scene"))
    scene = str(folder / "inputs" / "scene" / "scene.npz")
    short = ["--protocol", "ori", "--limit", "1", "--recipes", "dlama", "--fillers", "telea", "--no-variants"]
    return {
        "view": (["view", *picture, *lens, *fast, "--yaw", "5"], "out"),
        "remove": (["remove", *picture, str(frame / "mask.png"), *lens, *fast], "out"),
        "stereo": (["stereo", *pair, *fast], "out"),
        "mask": (["mask", *picture, *lens, "--click", "30,25"], "out.png"),
        "depth": (["depth", picture[0], *lens], "out"),
        "sequence": (["sequence", scene, *fast], "out"),
        "video": (["video", scene, *fast, "--seconds", "0.2", "--fps", "10"], "out.webp"),
        "worlds": (["worlds", "--count", "1", "--size", "32"], "out"),
        "evaluate": (["evaluate", str(folder / "inputs" / "worlds"), *short], "out"),
        "batch": (["batch", str(jobs), *lens, *fast, "--only", "image", "--workers", "1"], "out"),
    }


def run(*words: str) -> tuple[int, str]:
    """A verb in a process forked from this one, which has everything loaded: its exit status, and its standard error."""
    with tempfile.TemporaryFile() as errors:
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                os.dup2(errors.fileno(), 2)
                code = 0
                try:
                    for prepare in PREPARE:
                        prepare()
                    from dlama.apps.cli import main

                    main(list(words))
                except SystemExit as stop:
                    code = int(stop.code or 0) if not isinstance(stop.code, str) else 1
                except BaseException:
                    import traceback

                    traceback.print_exc()
                    code = 70
                sys.stderr.flush()
                os._exit(code)
            os._exit(71)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        errors.seek(0)
        return status, errors.read().decode("utf-8", "replace")


def obey_permissions() -> None:
    """Take the right to pass by permissions (CAP_DAC_OVERRIDE) from this process, where it is root's (capset(2), version 3)."""
    libc, header = ctypes.CDLL(None, use_errno=True), (ctypes.c_uint32 * 2)(0x20080522, 0)
    sets = (ctypes.c_uint32 * 6)()  # effective, permitted and inheritable, twice 32 bits
    libc.capget(header, sets)
    sets[0] &= ~(1 << 1)
    sets[1] &= ~(1 << 1)  # access(2) asks what root may have
    libc.capset(header, sets)


def in_this_process(*words: str) -> None:
    """A verb, whatever it says."""
    from dlama.apps.cli import main

    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        main(list(words))


PREPARE: list[Callable[[], object]] = []
"""What a forked child does first: where its fault is put in."""


@contextlib.contextmanager
def prepared(*steps: Callable[[], object]) -> Iterator[None]:
    """Meanwhile children begin with these steps."""
    PREPARE.extend(steps)
    try:
        yield
    finally:
        PREPARE.clear()


def contents(place: Path) -> dict[str, str]:
    """Every file below, hidden ones too, by its relative path: a hash, or `whole` of what may differ from run to run."""
    files = [place] if place.is_file() else sorted(path for path in place.rglob("*") if path.is_file())
    found = {}
    for path in files:
        name, data = path.relative_to(place.parent).as_posix(), path.read_bytes()
        if "/manifest/" in name:  # a log of every run
            continue
        if path.suffix == ".json":
            json.loads(data)
        found[name] = ("whole" if data else "empty") if VOLATILE.search(name) else hashlib.sha256(data).hexdigest()[:12]
    return found


def hidden(place: Path) -> list[str]:
    """Drafts beside and below; what a sequence goes on from is none."""
    return [str(path) for path in place.parent.rglob(".dlama-*") if path.name != ".dlama-sequence"]


def one_line(told: str) -> bool:
    """Whether a failure is told as it must be: errors on a line each, no traceback."""
    lines = [line for line in told.splitlines() if not line.startswith(("warning: ", "note: ", "progress: "))]
    return bool(lines) and all(line.startswith("error: ") for line in lines)


class Bench:
    """One verb, what it writes, and what lay there before."""

    def __init__(self, name: str, words: list[str], target: str, folder: Path, library: ctypes.CDLL) -> None:
        self.name, self.words, self.library = name, words, library
        self.place, self.counts = folder / name / target, folder / "counts"
        self.place.parent.mkdir()
        self.count = {"injected": 0, "broken": 0}
        status, told = self.run()
        assert status == 0, f"{name} fails without any fault: {told}"
        self.right = contents(self.place)
        files = [path for path in self.place.parent.rglob("*") if path.is_file() and name not in RESUMED]
        self.before = {path: path.read_bytes() for path in files}

    def run(self) -> tuple[int, str]:
        return run(*self.words, "-o", str(self.place))

    def reset(self) -> None:
        """As after the first run; of a verb that goes on where it was ended as before it."""
        shutil.rmtree(self.place.parent)
        self.place.parent.mkdir()
        for path, data in self.before.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    def armed(self, full: int = 0, kill: int = 0, after: bool = False) -> Callable[[], object]:
        """What a child does first: from the n-th write on the disk is full; SIGKILL at the n-th rename."""
        self.counts.write_bytes(bytes(16))
        words = os.fsencode(self.place.parent), os.fsencode(self.counts)
        return lambda: self.library.arm(*words, ctypes.c_long(full), ctypes.c_long(kill), int(after))

    def counted(self) -> tuple[int, int]:
        """Writes and renames of a run without a fault."""
        self.reset()
        with prepared(self.armed()):
            self.run()
        writes, renames = struct.unpack("ll", self.counts.read_bytes())
        return writes, renames

    def broke(self, what: str, told: str) -> None:
        self.count["broken"] += 1
        print(f"BROKEN {self.name}, {what}: {' '.join(told.split())[-400:]}", flush=True)

    def half_written(self) -> list[str]:
        """Visible files that are neither whole nor absent."""
        try:
            visible = {name: one for name, one in contents(self.place).items() if ".dlama-" not in name}
        except (ValueError, OSError) as error:
            return [str(error)]
        return [name for name, one in visible.items() if self.right.get(name, one) != one]

    def full(self, writes: int, every: int) -> None:
        for n in range(1, writes + 1, every):
            self.reset()
            with prepared(self.armed(full=n)):
                status, told = self.run()
            self.count["injected"] += 1
            where, drafts, half = (
                f"full at write {n} of {writes} (exit {status})",
                hidden(self.place),
                self.half_written(),
            )
            lost = [] if self.name in RESUMED else [name for name in self.right if name not in contents(self.place)]
            if status not in (1, 2) or not one_line(told) or half or lost or drafts:
                self.broke(f"{where}, half-written {half}, lost {lost}, drafts {drafts}", told)
            elif self.name in RESUMED:
                self.made_good(where)

    def kill(self, renames: int, every: int) -> None:
        for n, after in itertools.product(range(1, renames + 1, every), (False, True)):
            self.reset()
            with prepared(self.armed(kill=n, after=after)):
                status, told = self.run()
            self.count["injected"] += 1
            where = f"killed {'after' if after else 'before'} rename {n} of {renames}"
            if half := self.half_written():
                self.broke(f"{where} (exit {status}), half-written {half}", told)
            else:
                self.made_good(where)

    def made_good(self, where: str) -> None:
        """Run once more: everything is there, and nothing else."""
        status, told = self.run()
        found = contents(self.place)
        differ = [name for name in {*found, *self.right} if found.get(name) != self.right.get(name)]
        if status != 0 or differ or hidden(self.place):
            self.broke(
                f"{where}, then the next run (exit {status}): {differ} differ, drafts {hidden(self.place)}", told
            )

    def read_only(self) -> None:
        for closed in (self.place.parent, self.place):
            self.reset()
            if not closed.exists():
                continue
            closed.chmod(0o555 if closed.is_dir() else 0o444)
            before = contents(self.place)
            with prepared(obey_permissions):
                status, told = self.run()
            self.count["injected"] += 1
            closed.chmod(0o755)
            inside = closed == self.place.parent or self.place.is_file()  # what is in an open folder may be replaced
            wrote = status == 0 and contents(self.place) == self.right and inside
            refused = status == 2 and one_line(told) and contents(self.place) == before
            if not (refused or wrote) or hidden(self.place):
                self.broke(f"read-only {closed.name} (exit {status})", told)

    def clock(self) -> None:
        self.reset()
        real, jumps = time.time, itertools.cycle((-3.2e8, 0.0, 3.2e8))

        def jumping() -> None:
            time.time = lambda: real() + next(jumps)  # type: ignore[assignment]

        with prepared(jumping):
            status, told = self.run()
        self.count["injected"] += 1
        found = contents(self.place)
        differ = [name for name in {*found, *self.right} if found.get(name) != self.right.get(name)]
        if status != 0 or differ:
            self.broke(f"a clock that jumps (exit {status}), {differ} differ", told)


def main() -> int:
    """How many runs broke their law."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--verbs", nargs="+")
    parser.add_argument("--kinds", nargs="+", default=["full", "kill", "read-only", "clock"])
    parser.add_argument("--every", type=int, default=1)
    given = parser.parse_args()
    if "DLAMA_SHIM" not in os.environ:
        with tempfile.TemporaryDirectory(prefix="dlama-faults-") as name:
            Path(name).chmod(0o755)
            library = str(shim(Path(name)))
            alone = {
                "NUMBA_NUM_THREADS": "1",
                "NUMBA_THREADING_LAYER": "workqueue",
                "OMP_NUM_THREADS": "1",
            }  # threads do not survive a fork
            environment = {**os.environ, **alone, "LD_PRELOAD": library, "DLAMA_SHIM": library}
            return subprocess.run([sys.executable, __file__, *sys.argv[1:]], env=environment, check=False).returncode
    library = ctypes.CDLL(os.environ["DLAMA_SHIM"])
    total: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="dlama-faults-") as name:
        Path(name).chmod(0o755)
        known = verbs(Path(name))
        for verb in given.verbs or known:  # here, so that children find everything loaded and compiled
            if verb not in RESUMED:
                in_this_process(*known[verb][0], "-o", str(Path(name) / f"warm-{known[verb][1]}"))
        for verb in given.verbs or known:
            bench, started = Bench(verb, *known[verb], Path(name), library), time.monotonic()
            writes, renames = bench.counted()
            if "full" in given.kinds:
                bench.full(writes, given.every)
            if "kill" in given.kinds:
                bench.kill(renames, given.every)
            if "read-only" in given.kinds:
                bench.read_only()
            if "clock" in given.kinds:
                bench.clock()
            total += Counter(bench.count)
            print(
                f"{verb:9} {writes:4d} writes, {renames:3d} renames: {bench.count['injected']} faults, "
                f"{bench.count['broken']} broken, {time.monotonic() - started:.0f} s",
                flush=True,
            )
    print(f"{total['injected']} faults injected, {total['broken']} runs broke their law")
    return min(total["broken"], 100)


if __name__ == "__main__":
    sys.exit(main())
