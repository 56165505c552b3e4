"""A data set's folders and text listings in; scenes, files and checked numbers out, every error naming file, line and column."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.errors import CameraError, FileError, InputError, system_errors
from dlama.files.rasters.images import SUFFIXES, existing_file
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import QUATERNION_TOLERANCE, check_pose, make_pose, rotation_from_quaternion

VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".webm")
"""Endings of videos, which are given in place of a data set."""
NEAREST_S = 0.02
"""Seconds up to which a time stamp belongs to another (as in TUM's own associate.py)."""
LEVELS = 3
"""A data set is the folder itself, or in its folders, or in theirs (7-Scenes: chess/seq-01)."""
OF_RESULTS = ("meta.json", "transforms.json", "origin")
"""What `dlama sequence` writes into every folder of results, and no other data set has together."""


@dataclass(frozen=True)
class Row:
    """The words of one line, with blanks between them."""

    path: Path
    line: int
    """Counted from 1."""
    words: tuple[str, ...]
    columns: tuple[int, ...]
    """Where each word begins, counted from 1, and where the last one ends."""

    def at(self, index: int) -> str:
        """`file:line:column` of a word; behind the last one, of the line's end."""
        return f"{self.path}:{self.line}:{self.columns[min(index, len(self.words))]}"

    def need(self, count: int, what: str) -> None:
        """Raise FileError unless the line has just so many words."""
        if len(self.words) != count:
            raise FileError(f"{self.at(count)}: the line has {len(self.words)} values; {count} are expected ({what})")

    def number(self, index: int, *, finite: bool = True) -> float:
        """The word as a number; raises FileError."""
        try:
            value = float(self.words[index])
        except ValueError:
            value = np.nan
        if not np.isfinite(value) and (finite or np.isnan(value)):
            kind = "finite number" if finite else "number"
            raise FileError(f"{self.at(index)}: '{self.words[index][:40]}' stands where a {kind} is expected")
        return value

    def whole(self, index: int) -> int:
        """The word as a whole number >= 0; raises FileError."""
        word = self.words[index]
        if not (word.isascii() and word.isdecimal()):
            raise FileError(f"{self.at(index)}: '{word[:40]}' stands where a whole number >= 0 is expected")
        return int(word)

    def numbers(self, what: str, count: int, *, finite: bool = True) -> list[float]:
        """All words as numbers; raises FileError unless there are `count`."""
        self.need(count, what)
        return [self.number(index, finite=finite) for index in range(count)]


def read_rows(path: Path, *, commas: bool = False, text: str | None = None) -> list[Row]:
    """The lines of a text file with content: no blank lines, none that begins with #. Raises FileError.

    commas: these stand between words, too (CSV). text: what the file holds; None: it is read, as UTF-8.
    """
    file = existing_file(path)
    try:
        text = file.read_text(encoding="utf-8-sig") if text is None else text
    except UnicodeDecodeError as error:
        raise FileError(f"{file}: is no text (byte {error.start} is not UTF-8)") from error
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            found = list(re.finditer(r"\S+", line.replace(",", " ") if commas else line))
            columns = (*(m.start() + 1 for m in found), found[-1].end() + 1 if found else 1)
            rows.append(Row(file, number, tuple(m[0] for m in found), columns))
    return rows


def matrix_of(rows: Sequence[Row], *, finite: bool = True) -> Float64Array:
    """4x4 of four rows, blanks between the numbers; raises FileError."""
    return np.array([row.numbers("a row of a 4x4 matrix", 4, finite=finite) for row in rows], np.float64)


def read_matrix(path: Path, *, finite: bool = True) -> Float64Array:
    """4x4 of a text file that holds nothing else; raises FileError."""
    rows = read_rows(path)
    if len(rows) != 4:
        raise FileError(f"{path}: holds {len(rows)} lines of numbers; a 4x4 matrix is expected")
    return matrix_of(rows, finite=finite)


def pose_at(where: str, world_from_cam: Float64Array) -> Float64Array:
    """A checked pose (re-orthonormalised within 1e-3); raises CameraError that begins with `where`."""
    try:
        return check_pose(world_from_cam)
    except CameraError as error:
        raise CameraError(f"{where}: {error}") from error


def pose_of(where: str, shift: Sequence[float], quaternion_xyzw: Sequence[float]) -> Float64Array:
    """The 4x4 pose of a translation and a unit quaternion; raises FileError, CameraError, which begin with `where`."""
    return pose_at(where, make_pose(rotation_at(where, quaternion_xyzw), shift))


def rotation_at(where: str, quaternion_xyzw: Sequence[float]) -> Float64Array:
    """The 3x3 rotation of a unit quaternion; raises FileError, which begins with `where`."""
    length = float(np.linalg.norm(quaternion_xyzw))
    if not abs(length - 1) <= QUATERNION_TOLERANCE:
        raise FileError(f"{where}: the quaternion has length {length:.6g}; a unit quaternion qx qy qz qw is expected")
    return rotation_from_quaternion(quaternion_xyzw)


def nearest_in_time(times: Float64Array, time: float, within: float = NEAREST_S) -> int | None:
    """The place of the nearest of ascending times, the earlier of two as near; None where it is farther away than `within`."""
    after = int(np.searchsorted(times, time))
    near = [place for place in (after - 1, after) if 0 <= place < len(times)]
    best = min(near, key=lambda place: abs(times[place] - time), default=None)
    # stamps are printed to a microsecond: what lies just on the border must not fall to rounding
    return None if best is None or abs(times[best] - time) > within + 5e-7 else best


def scene_folders(
    root: Path,
    holds_frames: Callable[[Path], bool],
    looked_for: str,
    scenes: Sequence[str] | None = None,
    files: Iterable[str] = (),
) -> dict[str, Path]:
    """The folders that hold a scene, by its name: the root, or those up to two levels below; of them the selected `scenes`.

    files: endings of files that are looked at like folders.

    `chess/seq-01` becomes `chess_seq-01`. Raises FileError when there is none (`looked_for` says what was looked for) and when
    two have one name, InputError for a scene that is not there.
    """
    if not holds_frames(root):
        check_folder(root)
    found = _find_folders(root, holds_frames, files)
    if not found:
        raise FileError(
            f"{root}: holds no such data set, nor do the folders up to two levels below; looked for {looked_for}"
        )
    by_name: dict[str, Path] = {}
    for folder in found:
        name = _scene_name(root, folder)
        if name in by_name:
            raise FileError(
                f"{folder}: is called {name} as a scene, and so is {by_name[name]}; folders of other names are expected"
            )
        by_name[name] = folder
    check_scenes(sorted(by_name, key=natural_order), scenes)
    kept = [name for name in by_name if scenes is None or name in scenes]
    return {name: by_name[name] for name in sorted(kept, key=natural_order)}


def _find_folders(
    root: Path, holds_frames: Callable[[Path], bool], files: Iterable[str], results: bool = False
) -> list[Path]:
    """The root, folders and files below it that hold frames; none inside another; results of ours where nothing else does."""
    level, found = [root], []
    for _ in range(LEVELS):
        found += [folder for folder in level if holds_frames(folder)]
        inside = [folder for folder in level if folder not in found and folder.is_dir()]
        level = [each for folder in inside for each in (*folders_in(folder, results), *files_in(folder, files))]
    return found if found or results else _find_folders(root, holds_frames, files, True)


def _scene_name(root: Path, folder: Path) -> str:
    """The names of the folders from the root to a scene, joined; of the root itself its own."""
    if folder == root:
        return root.stem if root.is_file() else root.resolve().name
    return "_".join(folder.relative_to(root).with_suffix("" if folder.is_file() else folder.suffix).parts)


def holds(*names: str) -> Callable[[Path], bool]:
    """What tells whether a folder has all these files and folders."""
    return lambda root: all((root / name).exists() for name in names)


def check_folder(root: Path) -> None:
    """Raise FileError where the folder of a data set is not there, or is no folder."""
    if root.is_dir():
        return
    what, such = "is a file" if root.exists() else "no such folder", ""
    if root.exists() and root.suffix.lower() in VIDEOS:
        what = "is a video without poses and depth"
        such = ", such as the dense workspace that COLMAP makes of its pictures"
    elif root.exists() and root.suffix.lower() in SUFFIXES:
        quoted = shlex.quote(str(root))
        what, such = "is a picture", f"; `dlama photo3d {quoted} [DEPTH] --only scene -o DIR` makes a scene.npz of one"
    raise FileError(f"{root}: {what}; the folder of a data set is expected{such}")


def folders_in(folder: Path, results: bool = True) -> list[Path]:
    """The visible folders right inside; with or without those of which `dlama sequence` wrote the frames."""
    found = [each for each in folder.iterdir() if each.is_dir() and not each.name.startswith(".")]
    return [each for each in found if results or not all((each / name).exists() for name in OF_RESULTS)]


def files_in(folder: Path, suffixes: Iterable[str]) -> list[Path]:
    """The visible files of these kinds (lower case, with dot), 2 before 10."""
    kinds = set(suffixes)
    found = (each for each in folder.iterdir() if each.suffix.lower() in kinds and not each.name.startswith("."))
    return sorted(found, key=lambda path: natural_order(path.name))


def pictures_below(folder: Path, nor: str = "") -> tuple[Path, ...]:
    """The pictures in a folder and below, by path. FileError where it is none, cannot be listed, or holds none; that message ends
    with `nor`."""
    if not folder.is_dir():
        raise FileError(f"{folder}: is no folder; a folder of pictures is expected")
    with system_errors(FileError):
        next(folder.iterdir(), None)  # PermissionError; rglob would find nothing there
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
    if not found:
        raise FileError(f"{folder}: holds no pictures ({', '.join(SUFFIXES)}){nor}")
    return tuple(found)


def files_by_stem(folder: Path, suffixes: Iterable[str]) -> dict[str, Path]:
    """The name without its ending -> file, of a folder that may be missing."""
    return {path.stem: path for path in files_in(folder, suffixes)} if folder.is_dir() else {}


def natural_order(name: str) -> list[tuple[int, int, str]]:
    """A sorting key that counts: frame 2 comes before frame 10."""
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name) if part]


def check_scenes(known: Sequence[str], scenes: Sequence[str] | None) -> None:
    """Raise InputError for a scene that is not there."""
    for name in scenes or ():
        if name not in known:
            raise InputError(f"scene '{name}' is not in this data set; it has {', '.join(known)}")
