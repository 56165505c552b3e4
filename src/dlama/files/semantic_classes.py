"""EasySynth's SemanticClasses.csv in (lines `name,R,G,B`, no header); the colours of classes by name out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from dlama.errors import FileError, MaskError
from dlama.files.rasters.images import existing_file
from dlama.writing.atomic_write import PathLike

RGB = tuple[int, int, int]
CLASSES_FILE = "SemanticClasses.csv"
FOLDERS_UP = 3
"""How many folders above a semantic picture its class table is looked for (EasySynth: 2)."""


def read_classes(path: PathLike) -> dict[str, RGB]:
    """The colours of all classes by name, each channel 0..255; raises FileError naming the line."""
    classes: dict[str, RGB] = {}
    for number, line in enumerate(unreal_text(path).splitlines(), 1):
        if not line.strip():
            continue
        name, *cells = line.rsplit(",", 3)  # a name may hold commas
        color, name = _rgb_of(cells), name.strip()
        if color is None:
            raise FileError(f"{path}:{number}: the line is '{line[:80]}'; name,R,G,B of 0 to 255 each is expected")
        if name in classes:
            raise FileError(f"{path}:{number}: class '{name}' is there for the second time")
        classes[name] = color
    return classes


def _rgb_of(cells: Sequence[str]) -> RGB | None:
    """Three whole numbers of 0 to 255; None: they are something else."""
    levels = [int(cell) for cell in cells if re.fullmatch(r"\s*[0-9]{1,3}\s*", cell)]
    return (levels[0], levels[1], levels[2]) if len(levels) == len(cells) == 3 and max(levels) <= 255 else None


def class_color(name: str, picture: PathLike) -> RGB:
    """The colour of a class: "R,G,B", or its name in the SemanticClasses.csv next to the picture or up to three folders above.

    Raises MaskError (no table, or no such name: it lists the known), FileError (what the table holds).
    """
    if re.fullmatch(r"[-+\d\s]+,[-+\d\s]+,[-+\d\s]+", name):
        color = _rgb_of(name.split(","))
        if color is None:
            raise MaskError(f"`mask_class` is {name[:40]}; R,G,B of 0 to 255 each is expected")
        return color
    table = _find_table(picture)
    classes = read_classes(table)
    if name not in classes:
        raise MaskError(f"{table}: no class is called '{name}'; known: {', '.join(classes)}; or give R,G,B")
    return classes[name]


def semantic_picture(picture: PathLike) -> Path:
    """The semantic picture that belongs to a colour picture of EasySynth: SemanticImage/NAME.png next to ColorImage/NAME.jpeg.

    Raises FileError where there is none.
    """
    path = Path(picture)
    found = path.absolute().parent.parent / "SemanticImage" / f"{path.stem}.png"
    if not found.is_file():
        raise FileError(f"{path}: no semantic picture belongs to it; {found} was looked for")
    return found


def unreal_text(path: PathLike) -> str:
    """A text file as Unreal writes it: UTF-16 with a byte order mark as soon as one letter needs it, else UTF-8.

    Raises FileError.
    """
    data = existing_file(path).read_bytes()
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise FileError(f"{path}:{line}:1: is no {encoding} text") from error


def _find_table(picture: PathLike) -> Path:
    for folder in list(Path(picture).absolute().parents)[: FOLDERS_UP + 1]:
        if (folder / CLASSES_FILE).is_file():
            return folder / CLASSES_FILE
    raise MaskError(
        f"{picture}: no {CLASSES_FILE} next to it or up to {FOLDERS_UP} folders above; give the class as R,G,B"
    )
