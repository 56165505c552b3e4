"""Results appear whole or not at all (oracle: what lies on the disk before and after)."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlama
from box_frame import CAMERA, WORLD
from dlama.errors import OutputError
from dlama.writing import atomic_write, drafts
from dlama.writing.atomic_write import new_directory, new_file


class Boom(Exception):
    """Something that goes wrong half-way."""


def everything(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_file_appears_on_success_only(tmp_path: Path) -> None:
    """A failure keeps the old one. A name of 255 bytes can be written; one that is too long, or has NUL, is an OutputError."""
    target = tmp_path / ("深" * 80 + ".png")
    with new_file(target) as draft:
        draft.write_text("whole")
        assert draft.suffix == ".png" and not target.exists()
    with pytest.raises(Boom), new_file(target) as draft:
        draft.write_text("half")
        raise Boom
    for name in ("n" * 300, "nul\0"):
        for place in (new_file, new_directory):
            with pytest.raises(OutputError, match="cannot be written"), place(tmp_path / name):
                pass
    assert target.read_text() == "whole" and everything(tmp_path) == [target.name]


def test_new_file_has_ordinary_rights(tmp_path: Path) -> None:
    """Oracle: a file made by open()."""
    (tmp_path / "plain").touch()
    with new_file(tmp_path / "ours") as draft:
        draft.write_text("x")
    with new_directory(tmp_path / "folder"):
        pass
    (tmp_path / "plain_folder").mkdir()
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert (tmp_path / "folder").stat().st_mode == (tmp_path / "plain_folder").stat().st_mode


def test_new_directory_is_made_with_its_parents(tmp_path: Path) -> None:
    """Where it fails nothing is left of them."""
    with pytest.raises(Boom), new_directory(tmp_path / "a" / "b") as draft:
        (draft / "x.txt").write_text("1")
        raise Boom
    assert everything(tmp_path) == []
    with new_directory(tmp_path / "a" / "b") as draft:
        (draft / "x.txt").write_text("1")
        (draft / "right").mkdir()
        (draft / "right" / "y.txt").write_text("2")
        assert not (tmp_path / "a" / "b").exists()
    assert everything(tmp_path) == ["a", "a/b", "a/b/right", "a/b/right/y.txt", "a/b/x.txt"]


def test_existing_directory_is_merged_and_survives_failure(tmp_path: Path) -> None:
    (tmp_path / "right").mkdir()
    (tmp_path / "right" / "old.txt").write_text("old")
    (tmp_path / "image.txt").write_text("old")
    with pytest.raises(Boom), new_directory(tmp_path) as draft:
        (draft / "image.txt").write_text("new")
        raise Boom
    assert (tmp_path / "image.txt").read_text() == "old" and len(everything(tmp_path)) == 3
    with new_directory(tmp_path) as draft:
        (draft / "image.txt").write_text("new")
        (draft / "right").mkdir()
        (draft / "right" / "new.txt").write_text("new")
    assert (tmp_path / "image.txt").read_text() == "new"
    assert everything(tmp_path) == ["image.txt", "right", "right/new.txt", "right/old.txt"]


FILES, FOLDERS = ("file/out.png", "no/such/folder/out.png", "."), ("file", "file/below", "/proc/dlama/out")


@pytest.mark.parametrize(
    ("make", "place"), [*((new_file, one) for one in FILES), *((new_directory, one) for one in FOLDERS)]
)
def test_an_unwritable_place_is_an_output_error(tmp_path: Path, make: Any, place: str) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="cannot be written"), make(tmp_path / place):
        pass
    assert everything(tmp_path) == ["file"]


class Killed(BaseException):
    """Stands for SIGKILL: nothing of the code after it may run."""


def killed_after(renames: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the process is dead after so many renames: no clean-up happens, and its drafts look like a dead process's."""
    count, rename, replace = [0], Path.rename, Path.replace

    def counted(call):  # type: ignore[no-untyped-def]
        def wrapped(self: Path, target: Path) -> Path:
            if count[0] == renames:
                monkeypatch.setattr(shutil, "rmtree", lambda *_, **__: None)
                monkeypatch.setattr(Path, "unlink", lambda *_, **__: None)
                monkeypatch.setattr(Path, "rmdir", lambda *_, **__: None)
                raise Killed
            count[0] += 1
            return call(self, target)

        return wrapped

    monkeypatch.setattr(Path, "rename", counted(rename))
    monkeypatch.setattr(Path, "replace", counted(replace))


NAMES = ("image.txt", "meta.txt", "right/image.txt")


def write_run(folder: Path, text: str) -> None:
    with new_directory(folder) as draft:
        (draft / "right").mkdir()
        for name in NAMES:
            (draft / name).write_text(text)


@pytest.mark.parametrize("renames", range(7))
def test_no_kill_mixes_two_runs_and_the_next_run_finishes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, renames: int
) -> None:
    """Oracle: all files of one run have one text, whichever rename was the last; other people's files survive it all."""
    out = tmp_path / "out"
    write_run(out, "first")
    (out / "notes.txt").write_text("mine")
    (out / "right" / "notes.txt").write_text("mine")
    (out / "folder").mkdir()
    (out / "folder" / "deep.txt").write_text("mine")
    with monkeypatch.context() as broken:
        killed_after(renames, broken)
        with contextlib.suppress(Killed):
            write_run(out, "second")
    if out.exists():
        assert len({(out / name).read_text() for name in NAMES}) == 1
    monkeypatch.setattr(drafts, "_swept", set())
    write_run(out, "third")
    assert [(out / name).read_text() for name in NAMES] == ["third"] * 3
    for name in ("notes.txt", "right/notes.txt", "folder/deep.txt"):
        assert (out / name).read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["out"] and len(everything(out)) == 8


def test_a_directory_that_cannot_be_renamed_is_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder somebody works in keeps its identity (oracle: its inode), and the next run finishes a killed one."""
    write_run(tmp_path, "first")
    (tmp_path / "notes.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    before = tmp_path.stat().st_ino
    with monkeypatch.context() as broken:
        killed_after(2, broken)
        with pytest.raises(Killed):
            write_run(Path(), "second")
    monkeypatch.setattr(drafts, "_swept", set())
    with new_directory(".") as draft:
        assert {(tmp_path / name).read_text() for name in NAMES} == {"second"}
        (draft / "image.txt").write_text("third")
    assert tmp_path.stat().st_ino == before and (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "image.txt").read_text() == "third"
    assert everything(tmp_path) == ["image.txt", "meta.txt", "notes.txt", "right", "right/image.txt"]


@pytest.mark.parametrize(
    "refused", [OSError(18, "Invalid cross-device link"), PermissionError(13, "Permission denied")]
)
def test_a_directory_whose_renaming_fails_is_filled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: OSError
) -> None:
    out, rename = tmp_path / "out", Path.rename
    write_run(out, "first")

    def refusing(self: Path, target: Path) -> Path:
        if self == out:
            raise refused
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", refusing)
    write_run(out, "second")
    assert {(out / name).read_text() for name in NAMES} == {"second"} and everything(tmp_path)[0] == "out"
    assert len(everything(tmp_path)) == 5


def test_a_link_stays_a_link_and_rights_stay(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir(mode=0o750)
    (tmp_path / "link").symlink_to("real")
    rights = (tmp_path / "real").stat().st_mode
    write_run(tmp_path / "link", "first")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real" / "meta.txt").read_text() == "first"
    assert (tmp_path / "real").stat().st_mode == rights


@pytest.mark.parametrize("name", ["image.txt", "right"])
def test_nothing_is_placed_where_one_object_cannot_be(tmp_path: Path, name: str) -> None:
    """A folder of the user's has the name of a result, or the reverse."""
    out = tmp_path / "out"
    out.mkdir()
    if name == "image.txt":
        (out / name).mkdir()
        (out / name / "mine.txt").touch()
    else:
        (out / name).write_text("mine")
    before = everything(tmp_path)
    with pytest.raises(OutputError, match=name):
        write_run(out, "new")
    assert everything(tmp_path) == before


KILLED_RUN = """
import os, signal, sys
from dlama.writing.atomic_write import new_directory, new_file
with new_directory(sys.argv[1] + "/out") as folder, new_file(sys.argv[1] + "/a.txt") as draft:
    (folder / "x.txt").write_text("half")
    if sys.argv[2] == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    print("ready", flush=True)
    sys.stdin.read()
"""


def test_drafts_of_killed_runs_go_and_those_of_living_ones_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: real processes, one killed, one at work."""
    run = [sys.executable, "-c", KILLED_RUN, str(tmp_path)]
    (tmp_path / "b.txt").write_text("mine")
    killed = subprocess.run([*run, "kill"], timeout=600)
    assert killed.returncode == -9 and len(list(tmp_path.iterdir())) == 3
    with subprocess.Popen([*run, "live"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as alive:
        try:
            assert alive.stdout is not None and alive.stdout.readline() == b"ready\n"
            with new_file(tmp_path / "c.txt") as draft:
                draft.write_text("c")
            names = sorted(path.name for path in tmp_path.iterdir())
            assert [name for name in names if name[0] != "."] == ["b.txt", "c.txt"]
            assert len(names) == 4 and all(f"{alive.pid}@" in name for name in names[:2])
        finally:
            alive.kill()
    monkeypatch.setattr(drafts, "_swept", set())
    write_run(tmp_path / "out", "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.txt", "c.txt", "out"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system has no /proc")
def test_the_draft_of_a_zombie_is_removed_and_that_of_a_running_process_stays(tmp_path: Path) -> None:
    """Oracle: the process table."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        draft = tmp_path / f"{drafts.DRAFT}{process.pid}@{drafts.HOST}-01234567-out"
        draft.mkdir()
        drafts.remove_abandoned(tmp_path, again=True)
        assert draft.exists()
        assert process.stdin is not None
        process.stdin.close()
        stat = Path(f"/proc/{process.pid}/stat")
        while stat.read_text("utf-8").rpartition(")")[2].split()[0] != "Z":  # nobody waits for it yet
            pass
        drafts.remove_abandoned(tmp_path, again=True)
        assert not draft.exists()


def test_a_draft_of_another_computer_goes_with_age(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other, mine = tmp_path / ".dlama-draft-77@elsewhere-0123abcd-x.png", tmp_path / ".dlama-draft-not ours"
    other.touch()
    mine.touch()
    drafts.remove_abandoned(tmp_path)
    assert other.exists()
    os.utime(other, (0, 0))
    os.utime(mine, (0, 0))
    monkeypatch.setattr(drafts, "_swept", set())
    drafts.remove_abandoned(tmp_path)
    assert not other.exists() and mine.exists()


def test_what_is_placed_was_flushed_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A power cut after a rename leaves no empty file: fsync comes first (oracle: the calls in their order)."""
    calls: list[str] = []
    flush, replace, rename = os.fsync, Path.replace, Path.rename
    monkeypatch.setattr(os, "fsync", lambda handle: (calls.append("flush"), flush(handle))[1])
    monkeypatch.setattr(Path, "replace", lambda self, to: (calls.append("place"), replace(self, to))[1])
    monkeypatch.setattr(Path, "rename", lambda self, to: (calls.append("place"), rename(self, to))[1])
    with new_file(tmp_path / "a") as draft:
        draft.write_text("a")
    assert calls == ["flush", "place"]
    calls.clear()
    write_run(tmp_path / "out", "x")
    assert calls == ["flush"] * 3 + ["place"]


def test_a_full_disk_at_the_last_moment_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "a").write_text("old")
    monkeypatch.setattr(atomic_write.os, "fsync", full)
    with pytest.raises(OutputError, match="no space left"), new_file(tmp_path / "a") as draft:
        draft.write_text("new")
    with pytest.raises(OutputError, match="no space left"):
        write_run(tmp_path / "out", "x")
    assert (tmp_path / "a").read_text() == "old" and everything(tmp_path) == ["a"]


def test_a_full_disk_is_reported_by_where_the_file_was_to_lie(tmp_path: Path) -> None:
    """Law: a message names the place that the user gave, not the draft, also where a library (OpenEXR) puts that into its own."""
    at_once = new_directory(tmp_path / "out")
    with (
        pytest.raises(OutputError) as reported,
        at_once as folder,
        new_directory(folder / "b") as b,
        new_file(b / "c.png"),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert str(reported.value) == f"{tmp_path / 'out' / 'b' / 'c.png'}: cannot be written: no space left on device"
    with pytest.raises(OutputError) as reported, new_file(tmp_path / "depth.exr") as draft:
        raise OSError(f'Failed to write to "{draft}"')
    place = tmp_path / "depth.exr"
    assert str(reported.value) == f'{place}: cannot be written: Failed to write to "{place}"'
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_that_names_nothing_is_reported_by_the_directory(tmp_path: Path) -> None:
    """As Python's own write of text has it; other errors of the system stay what they are."""
    with pytest.raises(OutputError, match=r"out: cannot be written: no space left on device"):  # noqa: SIM117
        with new_directory(tmp_path / "out"):
            raise OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(OSError, match="Permission denied") as caught, new_directory(tmp_path / "out"):
        raise PermissionError(errno.EACCES, "Permission denied")
    assert not isinstance(caught.value, OutputError) and list(tmp_path.iterdir()) == []


def test_a_loop_of_links_is_refused(tmp_path: Path) -> None:
    """Before anything is written; both links stay."""
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OutputError, match="a: cannot be written: too many levels"), new_directory(tmp_path / "a"):
        raise AssertionError("was opened")
    with pytest.raises(OutputError, match="cannot be written"), new_directory(tmp_path / "a" / "out"):
        raise AssertionError("was opened")
    assert everything(tmp_path) == ["a", "b"]


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="names are text there")
def test_results_go_to_names_that_are_no_text(tmp_path: Path) -> None:
    """Every kind of file of a result is written to and read from a folder whose name is no UTF-8 (oracle: the arrays)."""
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/out\xff"))
    rgbd = WORLD.rgbd(CAMERA)
    dlama.write(dlama.view(rgbd, CAMERA, filler="telea"), folder, also=["points", "scene", "hole"])
    back = dlama.read_rgbd(folder / "image.png", folder / "depth.exr", fov=60)
    assert np.array_equal(back.color, rgbd.color) and np.array_equal(back.depth, rgbd.depth)
    assert np.array_equal(dlama.read_scene(folder / "scene.npz").layers[0].depth, rgbd.depth)
