"""Verbs on one picture or pair (view, remove, stereo, depth, mask): files and options in; the job of that name, done, out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import (
    CompletingOptions,
    Depth,
    DepthAndMask,
    Estimating,
    Image,
    Lens,
    Matching,
    Metres,
    Move,
    ObjectOptions,
    Output,
    PictureOptions,
    Pointing,
    Report,
    check_of_object,
    given_options,
    option,
    split_depth_and_mask,
)
from dlama.apps.places import check_file_apart
from dlama.errors import InputError
from dlama.jobs.parameters import is_pointed


def view(
    image: Positional[Image],
    depth: Positional[Depth] = None,
    /,
    *,
    output: Output,
    move: Move,
    picture: PictureOptions,
    completing: CompletingOptions,
    report: Report,
) -> None:
    """The scene from another viewpoint, with what was hidden filled in.

    Args:
        image: The colour picture: PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC. Or a scene.npz: the camera moves from its
            middle frame.
        depth: Its depth, same size: 16-bit PNG, TIFF or PGM (millimetres), EXR, PFM, NPY or NPZ; without it, it is estimated.
        output: Directory for the results, made if need be; files of the same names are replaced.
    """
    with command("view", report) as this:
        files = {"image": image, "depth": depth}
        this.run("view", output, files, move, picture, completing)


def remove(
    image: Positional[Image],
    depth_and_mask: Positional[DepthAndMask] = (),
    /,
    *,
    mask: Annotated[Path | None, option("MASK")] = None,
    output: Output,
    move: Move,
    picture: PictureOptions,
    chosen: ObjectOptions,
    completing: CompletingOptions,
    report: Report,
) -> None:
    """The scene without an object: what it hid is restored, seen from the same place or from elsewhere.

    Args:
        image: The colour picture: PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC. Or the scene.npz of a result: masks and
            clicks are of its middle frame.
        depth_and_mask: Its depth, same size (16-bit PNG, TIFF or PGM, EXR, PFM, NPY or NPZ; without it, it is estimated), and the
            object in the picture: black and white, 255 = remove; --click or --box say it in place of that file.
        mask: The mask, where its file does not follow the others.
        output: Directory for the results, made if need be; files of the same names are replaced.
    """
    with command("remove", report) as this:
        files = {"image": image} | split_depth_and_mask(depth_and_mask, vars(chosen.pointing), mask)
        check_of_object(given_options(chosen), files["mask"])
        this.run("remove", output, files, move, picture, chosen, completing)


def stereo(
    left: Positional[Annotated[Path, option("LEFT", None)]],
    right: Positional[Annotated[Path | None, option("RIGHT", None)]] = None,
    /,
    *,
    calib: Annotated[Path | None, option("CALIB", None)] = None,
    output: Output,
    move: Move,
    chosen: ObjectOptions,
    matching: Matching,
    completing: CompletingOptions,
    report: Report,
    mask: Annotated[Path | None, option("MASK")] = None,
    mask_right: Annotated[Path | None, option("MASK", "--mask carried over by disparity")] = None,
    disparity: Annotated[Path | None, option("FILE", "found")] = None,
    far: Metres = None,
) -> None:
    """Depth from a rectified stereo pair; with --mask or --click both pictures without an object; with --yaw another viewpoint.

    Args:
        left: The left picture.
        right: The right picture, rectified: same size, same rows.
        calib: calib.txt of Middlebury or KITTI, JSON with left_K, right_K, baseline_m, doffs, pixel_center, or YAML: that of
            ROS's right camera, or OpenCV's P1 and P2 (also as XML).
        output: Directory for the results, made if need be: the left view at the top, the right one in right/; with
            --yaw and the like the view from there alone.
        mask: The object in the left picture: black and white, 255 = remove; --click or --box say it in place of that file.
        mask_right: The object in the right picture.
        disparity: The left picture's disparity, in pixels: PFM, NPY, NPZ, EXR or PNG; 0, -1 and infinity are missing.
        far: What is measured at or beyond this is far (sky).
    """
    with command("stereo", report) as this:
        files = {"left": left, "right": right, "calib": calib}
        files |= {"mask": mask, "mask_right": mask_right, "disparity": disparity}
        check_of_object(given_options(chosen), mask, mask_right)
        this.run("stereo", output, files, move, chosen, matching, completing, far=far)


def depth(
    image: Positional[Image],
    /,
    output: Output,
    lens: Lens,
    estimating: Estimating,
    report: Report,
    far: Metres = None,
) -> None:
    """The depth of a single picture, the photo's own or estimated by a network: depth files, a preview, camera and points.

    Args:
        image: The colour picture: PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC.
        output: Directory for the results, made if need be; files of the same names are replaced.
        far: Depth at or beyond this is far (sky).
    """
    with command("depth", report) as this:
        this.run("depth", output, {"image": image}, lens, estimating, far=far)


def mask(
    image: Positional[Image],
    depth: Positional[Depth] = None,
    /,
    *,
    output: Annotated[Path, option("MASK.png", None, aliases=["-o"])],
    pointing: Pointing,
    picture: PictureOptions,
    report: Report,
) -> None:
    """The mask of an object that you point at: click on it, or draw a box around it.

    Args:
        image: The colour picture: PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC. Or a scene.npz: its middle frame.
        depth: Its depth, same size: 16-bit PNG, TIFF or PGM (millimetres), EXR, PFM, NPY or NPZ; without it, it is estimated
            where the masker needs it.
        output: The mask, 255 = the object; next to it MASK_overlay.png shows it in the picture.
    """
    with command("mask", report) as this:
        files, given, overlay = {"image": image, "depth": depth}, given_options(pointing, picture), overlay_of(output)
        semantic = None
        if "object_class" in given:
            from dlama.files.semantic_classes import semantic_picture

            semantic = semantic_picture(image)
        for file in (output, overlay):
            check_file_apart(file, {**files, "semantic picture": semantic})
        if not is_pointed(given):
            raise InputError(
                "no object is pointed at: give --click X,Y on it, --box X,Y,W,H round it, --salient or --class NAME"
            )
        this.write_mask(*this.find_mask(files, given), output, overlay)


def overlay_of(output: Path) -> Path:
    """Where the overlay of a mask goes. InputError: the mask's name does not end in .png."""
    if output.suffix.lower() != ".png":
        raise InputError(f"`output` is {output}; a name that ends in .png is expected")
    return output.with_name(f"{output.stem}_overlay.png")
