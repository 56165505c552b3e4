"""COLMAP folders in (a model in sparse/0, sparse or the folder; images/; depth maps next to them); posed frames and cases out.

Depth: depth/NAME.png (16-bit millimetres), .exr, .pfm, .npy, of the picture NAME.jpg; or the dense workspace's own
stereo/depth_maps/NAME.jpg.geometric.bin (else .photometric.bin). It must have the unit of the model's positions: metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dlama.datasets.frames import Dataset
from dlama.datasets.posed.colmap_model import ColmapImage, read_model
from dlama.datasets.posed.posed_frames import FrameFiles, Lens, PosedFrame, posed_frame
from dlama.datasets.posed.view_pairs import LOG, read_posed
from dlama.errors import FileError

MODEL_FOLDERS = ("sparse/0", "sparse", "")
DEPTH_FOLDERS, DEPTH_KINDS = ("depth", "depths"), (".png", ".exr", ".pfm", ".npy")
DENSE, DENSE_KINDS = "stereo/depth_maps", (".geometric.bin", ".photometric.bin")


def looks_like_colmap(root: Path) -> bool:
    """True where a model lies in a folder, and no transforms.json of nerfstudio, which often has one next to it."""
    return model_folder(root) is not None and not (root / "transforms.json").is_file()


def model_folder(root: Path) -> Path | None:
    """Where the model lies, if there is one."""
    for name in MODEL_FOLDERS:
        for kind in (".txt", ".bin"):
            if all((root / name / f"{part}{kind}").is_file() for part in ("cameras", "images")):
                return root / name
    return None


def colmap(root: Path, *, scenes: Sequence[str] | None = None, limit: int | None = None) -> Dataset:
    """The scenes of a folder (itself one, or holding several). Raises FileError, CameraError."""
    looked_for = "cameras and images (.txt or .bin) in sparse/0, sparse or the folder itself"
    return read_posed("colmap", root, looks_like_colmap, looked_for, _frames, scenes, limit)


def _frames(scene: str, folder: Path) -> list[PosedFrame]:
    model = model_folder(folder)
    assert model is not None
    images = read_model(model)
    frames = []
    for image in images:
        depth = depth_of(folder, image)
        if depth is not None:
            lens = Lens(str(model), image.camera.intrinsics, 0.5, image.camera.hw)
            units = 1000.0 if depth.suffix == ".png" else 1.0
            files = FrameFiles(folder / "images" / image.name, depth, lens, image.world_from_cam, units, far_code=True)
            name = Path(image.name).with_suffix("").as_posix().replace("/", "_")
            frames.append(posed_frame(scene, name, files))
    if not frames:
        raise FileError(
            f"{folder}: none of the model's {len(images)} images has a depth map; depth/NAME.png (millimetres) or "
            f"{DENSE}/NAME{DENSE_KINDS[0]} is expected"
        )
    if len(frames) < len(images):
        LOG.warning(
            "%s: %d of %d images have no depth and are left out", folder, len(images) - len(frames), len(images)
        )
    return frames


def depth_of(folder: Path, image: ColmapImage) -> Path | None:
    """The depth map next to the model for an image."""
    stem = Path(image.name).with_suffix("")
    places = [folder / name / f"{stem}{kind}" for name in DEPTH_FOLDERS for kind in DEPTH_KINDS]
    places += [folder / DENSE / f"{image.name}{kind}" for kind in DENSE_KINDS]
    return next((place for place in places if place.is_file()), None)
