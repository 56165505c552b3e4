"""A folder in; the Dataset it holds out. The closed set of layouts, and how one is recognised."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypedDict

from dlama.arguments import check_count
from dlama.completion.options import Unpack
from dlama.datasets.captures import arkitscenes, azure_kinect, polycam, record3d, rosbag, scannetpp, stray_scanner
from dlama.datasets.easysynth.dataset import easysynth, looks_like_easysynth
from dlama.datasets.frames import Dataset, Protocol
from dlama.datasets.pairs_json import looks_like_pairs, pairs_json
from dlama.datasets.posed import colmap, nerfstudio, replica, scannet, trajectory_log, tum
from dlama.datasets.posed.lenses import CameraOption
from dlama.datasets.posed.numbered_frames import SEVEN_SCENES, TSDF_FUSION
from dlama.datasets.posed.posed_frames import posed_frames
from dlama.datasets.posed.scene_file import LAYOUT as SCENE
from dlama.datasets.posed.scene_file import is_scene_file, scene_file
from dlama.datasets.posed.view_pairs import posed_dataset
from dlama.datasets.removal_folder import looks_like_removal, removal_folder
from dlama.datasets.stereo_folder import looks_like_stereo, stereo_folder
from dlama.datasets.text_tables import LEVELS, check_folder, check_scenes, files_in, folders_in, scene_folders
from dlama.errors import FileError, InputError, system_errors
from dlama.files.scenes.scene_npz import HOW_WRITTEN


@dataclass(frozen=True)
class Layout:
    """One way in which a data set lies on disk."""

    looked_for: str
    """What distinguishes it from the others, in words."""
    looks_like: Callable[[Path], bool]
    """Whether a folder, or a file, is such a data set; looks at names only."""
    read: Callable[..., Dataset]
    """`read(root, **options)`; reads listings, no pictures but the depth that pairs are chosen by."""
    options: frozenset[str] = frozenset()
    """Which of `DatasetOptions` it takes; `scenes` and `limit` are applied afterwards where not."""
    files: tuple[str, ...] = ()
    """Endings of files that are such a data set by themselves."""
    parts: tuple[str, ...] = ()
    """Names that no other layout has: a folder with one of them that does not fit lacks a part."""


class SeveralLayoutsError(InputError):
    """A folder that is a data set, of one layout as well as of another."""


def _posed(
    name: str, looked_for: str, reader: Any, takes_camera: bool = False, **others: tuple[str, ...]
) -> tuple[str, Layout]:
    """A layout of posed frames by its name.

    reader: a file with `looks_like(folder)`, which looks at names only (and `is_scene`, where more can be read than is
    recognised), and `list_frames(place)`, of which takes_camera says that it has two more parameters, the root and the camera.
    others: `files` and `parts`.
    """

    files = others.get("files", ())

    def fits(is_scene: Callable[[Path], bool]) -> Callable[[Path], bool]:
        return lambda place: place.suffix.lower() in files if place.is_file() else is_scene(place)

    def read(
        root: Path,
        *,
        camera: CameraOption = None,
        scenes: Sequence[str] | None = None,
        limit: int | None = None,
        **reading: Any,
    ) -> Dataset:
        more = (root, camera) if takes_camera else ()
        is_scene = fits(getattr(reader, "is_scene", reader.looks_like))
        folders = scene_folders(root, is_scene, looked_for, scenes, files)
        frames = []
        for scene, place in folders.items():
            frames += posed_frames(scene, place, reader.list_frames(place, *more), **reading)
        return posed_dataset(name, root, frames, limit)

    options = {"scenes", "limit", *OF_FRAMES, *(("camera",) if takes_camera else ())}
    return name, Layout(looked_for, fits(reader.looks_like), read, frozenset(options), **others)


OF_FRAMES = ("depth_scale", "max_depth", "resize_depth")
"""Options of all layouts of posed frames: how the files of a frame are read."""
APPLIED_AFTERWARDS = frozenset({"scenes", "limit"})
"""Options that `select_cases` applies where a layout does not."""
_LOWRES = ("lowres_wide.traj", "lowres_depth", "lowres_wide_intrinsics")

LAYOUTS: dict[str, Layout] = {
    "easysynth": Layout(
        "CameraPoses.csv or CameraRig.json, and ColorImage",
        looks_like_easysynth,
        easysynth,
        frozenset({"depth_range", "removal_object"}),
    ),
    "pairs": Layout("pairs.json", looks_like_pairs, pairs_json),
    "removal": Layout("with.color.png and without.color.png", looks_like_removal, removal_folder),
    "stereo": Layout("im0.png and im1.png, or left.png and right.png", looks_like_stereo, stereo_folder),
    **dict(
        [
            _posed("tum", "rgb.txt, depth.txt and groundtruth.txt", tum, True, parts=("groundtruth.txt", "rgb.txt")),
            _posed("7-scenes", "frame-*.pose.txt and frame-*.depth.png", SEVEN_SCENES, True),
            _posed("scannet", "folders color, depth and pose", scannet, True),
            _posed("tsdf-fusion", "camera-intrinsics.txt and frame-*.pose.txt", TSDF_FUSION, True),
            _posed("redwood", "trajectory.log and a folder depth", trajectory_log, True),
            _posed("replica", "traj.txt and a folder results", replica, True),
            _posed("colmap", "images and cameras (.txt or .bin) in sparse/0 or sparse", colmap),
            _posed("nerfstudio", "transforms.json, or transforms_train.json and the like", nerfstudio),
            _posed("stray-scanner", "rgb.mp4, odometry.csv and depth", stray_scanner, parts=("odometry.csv",)),
            _posed("polycam", "keyframes with depth and cameras", polycam, parts=("keyframes",)),
            _posed(
                "record3d", "a .r3d file, or metadata and a folder rgbd", record3d, files=(".r3d",), parts=("rgbd",)
            ),
            _posed("arkitscenes", "lowres_wide.traj and a folder lowres_depth", arkitscenes, parts=_LOWRES),
            _posed("rosbag", "a .bag, .mcap or .db3 file, or a folder with metadata.yaml", rosbag, files=rosbag.FILES),
            _posed("azure-kinect", "a .mkv file", azure_kinect, files=(".mkv",)),
            _posed("scannetpp", scannetpp.POSES, scannetpp, parts=(scannetpp.POSES, scannetpp.FOLDER)),
        ]
    ),
}
"""Every layout by the name that `layout` takes."""
KITTI = ("image_2", "image_3"), ("image_02", "image_03")
"""The colour cameras of its benchmarks and odometry, and of its raw data; it has no dense depth."""
RECORDINGS = tuple(suffix for layout in LAYOUTS.values() for suffix in layout.files)
"""Endings of all files that are data sets by themselves."""


class DatasetOptions(TypedDict, total=False):
    """How a data set is read; a layout refuses what it has no use for, but for `scenes` and `limit`."""

    depth_range: float | None
    """Metres (easysynth)."""
    depth_scale: float | None
    """Units per metre in depth files of posed frames, in place of the layout's."""
    max_depth: float | None
    """Metres beyond which depth of posed frames is missing, in place of the layout's."""
    resize_depth: Literal["guided", "nearest"] | None
    """Of posed frames: depth is enlarged to the picture's size, as of `read_rgbd`, in place of a picture that is shrunk."""
    removal_object: str | None
    """A semantic class (easysynth)."""
    camera: CameraOption
    """A camera file (tum, 7-scenes, scannet, tsdf-fusion, redwood)."""
    scenes: Sequence[str] | None
    """Only these."""
    limit: int | None
    """At most so many cases of each protocol, the first ones."""


@system_errors(FileError)
def open_dataset(path: Path | str, layout: str | None = None, **options: Unpack[DatasetOptions]) -> Dataset:
    """The data set in a folder, or the frames of a scene.npz; its layout is recognised unless `layout` names it.

    Raises InputError (unknown or ambiguous layout, option or scene), FileError, CameraError.
    """
    root, limit = Path(path), options.get("limit")
    check_count(limit, "limit")
    if is_scene_file(root):
        refuse_unused(SCENE, frozenset(), {"layout": layout, **options})
        found = scene_file(root, limit=limit)
    else:
        found = list_dataset(root, layout_of(root, layout), options)
    return select_cases(found, options.get("scenes"), limit)


def list_dataset(root: Path, name: str, options: Mapping[str, object]) -> Dataset:
    """The data set of that layout, by the options that it knows. InputError: another one, but for `scenes` and `limit`."""
    known = LAYOUTS[name].options
    refuse_unused(name, known, options)
    return LAYOUTS[name].read(root, **{key: one for key, one in options.items() if one is not None and key in known})


def layout_of(root: Path, layout: str | None) -> str:
    """The layout that is given, or that the data set has. InputError: an unknown one; FileError: there is no data set."""
    if layout is not None and layout not in LAYOUTS:
        raise InputError(f"layout '{layout}' is not known; known are {', '.join(LAYOUTS)}")
    if not is_capture_file(root):
        check_folder(root)
    return detect(root) if layout is None else layout


def detect(root: Path, results: bool = False) -> str:
    """The name of the layout a folder has; results of ours inside it count where nothing else is there. Raises
    InputError that lists what was looked for, SeveralLayoutsError what fits."""
    level = [root]
    for _ in range(LEVELS):
        found = [name for name, each in LAYOUTS.items() if any(map(each.looks_like, level))]
        if len(found) > 1:
            raise SeveralLayoutsError(f"{root}: may be {' or '.join(found)}; say which by `layout=NAME`")
        if found:
            return found[0]
        inside = [place for place in level if place.is_dir()]
        level = [each for folder in inside for each in (*folders_in(folder, results), *files_in(folder, RECORDINGS))]
    if not results:
        return detect(root, True)
    raise _unknown_layout(root)


def _unknown_layout(root: Path) -> InputError:
    """What a folder lacks that has parts of one layout, or is a result of ours; else what was looked for."""
    if (root / "meta.json").is_file() and (root / "image.png").is_file():
        scene = root / "scene.npz"
        advice = f"is a result: give {scene}" if scene.is_file() else f"holds no scene.npz; {HOW_WRITTEN}"
        return InputError(f"{root}: {advice}")
    lacks = [name for name, each in LAYOUTS.items() if any((root / part).exists() for part in each.parts)]
    if len(lacks) == 1:
        name = lacks[0]
        there = ", ".join(part for part in LAYOUTS[name].parts if (root / part).exists())
        return InputError(
            f"{root}: holds {there} as layout {name} does, but not all it needs: {LAYOUTS[name].looked_for}"
        )
    pair = next((names for names in KITTI for level in ("", "*/", "*/*/") if any(root.glob(level + names[0]))), None)
    if pair is not None:
        pictures = " ".join(f"{name}/PICTURE" for name in pair)
        return InputError(f"{root}: holds KITTI's pairs: give each to `dlama stereo {pictures} --calib FILE`")
    looked_for = "; ".join(f"{name}: {each.looked_for}" for name, each in LAYOUTS.items())
    return InputError(
        f"{root}: is no data set of a known layout, nor are the folders below. Frames of any other are read by a "
        f"{nerfstudio.NAME} that names picture, depth and pose of each, as nerfstudio has it. Looked for {looked_for}"
    )


def is_capture_file(path: Path) -> bool:
    """Whether a file is a data set by itself."""
    return path.is_file() and path.suffix.lower() in RECORDINGS


def refuse_unused(name: str, known: frozenset[str], options: Mapping[str, object]) -> None:
    """Raises InputError for an option that was given (is not None) and that the layout `name` does not take, but for those that
    are applied afterwards."""
    for option, value in options.items():
        if value is not None and option not in known | APPLIED_AFTERWARDS:
            takers = [each for each, layout in LAYOUTS.items() if option in layout.options]
            for_others = f"; it is for {', '.join(takers)}" if takers else ""
            raise InputError(f"`{option}` does not apply to a data set of layout {name}{for_others}")


def select_cases(dataset: Dataset, scenes: Sequence[str] | None, limit: int | None) -> Dataset:
    """The frames and cases of these scenes, and of those cases the first `limit` of each protocol."""
    names = [*(each.scene for each in dataset.frames), *(each.scene for each in dataset.cases)]
    check_scenes(list(dict.fromkeys(names)), scenes)
    frames = [each for each in dataset.frames if scenes is None or each.scene in scenes]
    cases, counts = [], Counter[Protocol]()
    for case in dataset.cases:
        if (scenes is None or case.scene in scenes) and (limit is None or counts[case.protocol] < limit):
            counts[case.protocol] += 1
            cases.append(case)
    return replace(dataset, frames=tuple(frames), cases=tuple(cases))
