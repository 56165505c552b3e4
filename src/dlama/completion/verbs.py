"""The two jobs on one picture: an RGB-D picture and where to look from (and what to remove) in; the completed scene out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

from dlama.arguments import check_arguments
from dlama.completion.completion import Completion, StereoCompletion
from dlama.completion.options import OptionKeywords, Unpack, take_options
from dlama.completion.pipeline import complete
from dlama.errors import InputError, InputTypeError
from dlama.geometry.camera import Camera
from dlama.geometry.motion.trajectories import dolly as dollied
from dlama.geometry.motion.trajectories import orbit
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.geometry.scene import Scene
from dlama.progress import Progress


def target_camera(
    rgbd: RGBD | Scene,
    camera: Camera | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    pivot: float | Literal["auto"] = "auto",
    dolly: float = 0.0,
) -> Camera:
    """The camera to go to: `camera` itself; or the picture's, of a scene the middle frame's, orbited (degrees) about `pivot` (m)
    and dollied (m).

    Positive yaw moves the camera to its right around the pivot, positive pitch up; a positive dolly moves it forward.
    """
    if camera is not None:
        if yaw or pitch or dolly:
            raise InputError("a target camera and an orbit or dolly were both given; one of them is expected")
        return camera
    source = rgbd.middle_frame.load() if isinstance(rgbd, Scene) else rgbd
    return dollied(orbit(source, yaw, pitch, pivot), dolly)


@take_options
def view(
    rgbd: RGBD | Scene,
    camera: Camera | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    pivot: float | Literal["auto"] = "auto",
    dolly: float = 0.0,
    progress: Progress | None = None,
    **options: Unpack[OptionKeywords],
) -> Completion:
    """The scene from another viewpoint, holes filled in colour and depth.

    Args:
        rgbd: The picture with metric depth, and its camera; or a scene, whose middle frame the camera moves from.
        camera: The target camera, instead of an orbit and a dolly.
        yaw: Degrees; positive: the camera moves to its right round the pivot and turns left.
        pitch: Degrees; positive: the camera moves up and looks down.
        pivot: Metres ahead on the optical axis that the orbit turns about; "auto": the median depth.
        dolly: Metres forward, after the orbit.
        progress: Called with the name of each stage as it begins; what it raises ends the work.
        options: How the scene is completed (`Options`).

    Raises:
        InputError: a camera and an orbit, an unknown name, options that contradict each other.

    Examples:
        >>> import dlama
        >>> folder = dlama.example()
        >>> rgbd = dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90)
        >>> done = dlama.view(rgbd, yaw=5, filler="telea")
        >>> done.view.color.shape, bool(done.view.hole.any()), done.meta["filler"]
        ((512, 512, 3), False, 'telea')
    """
    check_arguments(view, locals())
    target = target_camera(rgbd, camera, yaw=yaw, pitch=pitch, pivot=pivot, dolly=dolly)
    return complete(rgbd, [target], progress=progress, **options)


def view_pair(pair: StereoCompletion, target: Mapping[str, Any], method: Mapping[str, Any]) -> Completion:
    """The scene of a pair from another viewpoint. meta also has how the pair was matched, and the seconds of both.

    target: keywords of `view` that say where the camera stands; method: the options of a completion.
    """
    done = view(pair.scene, **target, **method)
    before, after = pair.meta["seconds"], done.meta["seconds"]
    seconds = before | {name: round(before.get(name, 0) + spent, 4) for name, spent in after.items()}
    return replace(done, meta=done.meta | {"stereo": pair.meta["stereo"], "seconds": seconds})


@take_options
def remove(
    rgbd: RGBD | Scene,
    mask: BoolArray | Mapping[int, BoolArray],
    camera: Camera | None = None,
    *,
    yaw: float = 0.0,
    pitch: float = 0.0,
    pivot: float | Literal["auto"] = "auto",
    dolly: float = 0.0,
    progress: Progress | None = None,
    **options: Unpack[OptionKeywords],
) -> Completion:
    """The scene without the object under `mask`, from the source camera or from elsewhere.

    mask: H x W bool, True = remove; of a scene of several frames number of a frame -> its mask.

    All other arguments as in `view`, and what it raises; MaskError for a mask that is empty, full or of another size.

    Examples:
        >>> import dlama
        >>> folder = dlama.example()
        >>> rgbd = dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90)
        >>> mask = dlama.read_mask(folder / "mask.png")
        >>> done = dlama.remove(rgbd, mask, filler="telea")
        >>> bool((done.view.origin[mask] == dlama.Origin.FILLED).all())
        True
    """
    check_arguments(remove, locals())
    if mask is None:  # which `complete` takes
        raise InputTypeError("`mask` is None; a bool array H x W is expected, True = remove (`view` removes nothing)")
    target = target_camera(rgbd, camera, yaw=yaw, pitch=pitch, pivot=pivot, dolly=dolly)
    return complete(rgbd, [target], mask=mask, progress=progress, **options)
