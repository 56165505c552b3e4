"""Two picture files of the same pixels in; whether they are turned alike when they are shown (EXIF), out."""

from __future__ import annotations

from collections.abc import Sequence

from dlama.errors import MaskError, ShapeError, check_same_size, format_size, warn
from dlama.files.rasters.images import orientation_of, picture_hw
from dlama.geometry.rgbd import BoolArray
from dlama.writing.atomic_write import PathLike


def orientation_difference(one: PathLike, other: PathLike) -> str:
    """How the EXIF orientations of two pictures of the same pixels differ, in words; "": they do not. Raises FileError."""
    turned = orientation_of(one), orientation_of(other)
    if turned[0] == turned[1]:
        return ""
    which, another, tag = (one, other, turned[0]) if turned[0] != 1 else (other, one, turned[1])
    found = f"{which} is shown turned by its EXIF orientation {tag}, {another} "
    return found + ("has none" if 1 in turned else f"by {turned[1]}")


def doubtful_turn(picture: PathLike, other: PathLike) -> str:
    """As `orientation_difference`, of two that fit as they are shown; "" also where they would not as they are stored, since a
    quarter turn of one exchanges its sides. Raises FileError."""
    turned, (height, width) = (orientation_of(picture), orientation_of(other)), picture_hw(picture)
    if height != width and (turned[0] >= 5) != (turned[1] >= 5):
        return ""
    return orientation_difference(picture, other)


def refuse_turned(picture: PathLike, other: PathLike, hw: tuple[int, int], other_hw: tuple[int, int]) -> None:
    """ShapeError where two pictures of the same pixels have exchanged sides, and the orientation of one of them explains it."""
    if hw != other_hw == hw[::-1] and (found := orientation_difference(picture, other)):
        raise ShapeError(
            f"{found}: {other} is {format_size(other_hw)} and {picture} {format_size(hw)}; turn the one without it "
            "the same way, or clear the tag (exiftool -Orientation= FILE)"
        )


def warn_of_turn(picture: PathLike, other: PathLike) -> None:
    """Warn (UserWarning) where a picture and its mask or depth fit in two ways by their EXIF orientations. Raises FileError."""
    if found := doubtful_turn(picture, other):
        warn(f"{found}; if both were made of the same stored pixels, clear the tag (exiftool -Orientation= FILE)")


def same_proportions(hw: Sequence[float], other_hw: Sequence[float], tolerance: float = 0.02) -> bool:
    """Whether width / height of pictures of two sizes are alike, up to a share, so that they can show the same field of view."""
    return abs(hw[1] / hw[0] * other_hw[0] / other_hw[1] - 1) <= tolerance


def check_mask_fits(mask: BoolArray, path: PathLike, picture: PathLike) -> None:
    """ShapeError or MaskError, which name both files: a mask that has not the size of its picture. Warns as `warn_of_turn`."""
    hw, own = picture_hw(picture), (mask.shape[0], mask.shape[1])
    refuse_turned(picture, path, hw, own)
    warn_of_turn(picture, path)
    check_same_size(str(path), own, str(picture), hw, MaskError)
