"""Masks found by depth and clicks, against the true pixels of closed-form worlds (boxes and poles on a ground before a wall) and
of a generated one."""

from __future__ import annotations

import numpy as np
import pytest

import dlama
from dlama import DlamaError, InputError, MaskError, MaskSession, ObjectMask, find_mask
from dlama.geometry.camera import Camera
from dlama.geometry.holes import iou
from dlama.geometry.rgbd import RGBD
from dlama.perception.masks import small
from dlama.perception.masks.prompt import Prompt
from dlama.perception.masks.small import SmallPicture
from dlama.perception.object_masks import TOO_MUCH
from dlama.worlds.dataset import world
from worlds import Box, Plane, World, box_round, innermost_pixel

CAMERA = Camera.from_fov(160, 120, 70)
GROUND, WALL = Plane((0, 1, 0), (0, -1, 0)), Plane((0, 0, 6), (0, 0, -1))
BOX = Box((-0.6, 0.2, 2.6), (0.2, 1.0, 3.2))
SHADE = Box((0.55, -0.6, 2.3), (1.05, -0.3, 2.7))
POLE = Box((0.78, -0.3, 2.48), (0.82, 1.0, 2.52))
FAR_BOX = Box((-1.8, 0.3, 4.0), (-1.0, 1.0, 4.6))
WORLD = World((GROUND, WALL, BOX, SHADE, POLE, FAR_BOX))


@pytest.fixture(scope="module")
def scene() -> tuple[RGBD, np.ndarray]:
    """The picture, and which shape each pixel shows."""
    return WORLD.rgbd(CAMERA), WORLD.trace(CAMERA)[1]


@pytest.mark.parametrize("number", [2, 5])
def test_a_click_finds_the_box(scene: tuple[RGBD, np.ndarray], number: int) -> None:
    """A box that stands on the ground, from one click on it: the ground is taken away, its neighbours stay out."""
    rgbd, shown = scene
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == number)]).mask, shown == number) > 0.95


def test_a_lamp_is_its_shade_and_its_pole(scene: tuple[RGBD, np.ndarray]) -> None:
    """The pole is two pixels wide and is connected with the shade through a step in depth; `part` is the shade alone."""
    rgbd, shown = scene
    found = find_mask(rgbd, clicks=[innermost_pixel(shown == 3)])
    assert iou(found.mask, (shown == 3) | (shown == 4)) > 0.95


@pytest.mark.parametrize("number", [2, 3])
def test_an_object_ends_at_the_object_that_it_stands_on(number: int) -> None:
    """A crate on a wider block: the crate alone, as `group` both; the block is all of the block, the crate does not count."""
    table, crate = Box((-0.9, 0.5, 2.2), (0.9, 1.0, 3.2)), Box((-0.2, 0.1, 2.5), (0.2, 0.5, 2.8))
    world = World((GROUND, WALL, crate, table))
    rgbd, shown = world.rgbd(CAMERA), world.trace(CAMERA)[1]
    if number == 3:
        assert iou(find_mask(rgbd, clicks=[innermost_pixel(shown == 3)]).mask & (shown != 2), shown == 3) > 0.97
        return
    found = find_mask(rgbd, clicks=[innermost_pixel(shown == 2)])
    assert iou(found.mask, shown == 2) > 0.95
    assert iou(found.candidates["group"], shown >= 2) > 0.95


def test_the_back_of_a_chair_keeps_its_seat() -> None:
    """The seat is level and below the back, but no wider."""
    seat, back = Box((-0.5, 0.5, 2.0), (0.5, 1.0, 2.8)), Box((-0.5, -0.3, 2.7), (0.5, 0.5, 2.8))
    world = World((GROUND, WALL, seat, back))
    shown = world.trace(CAMERA)[1]
    found = find_mask(world.rgbd(CAMERA), clicks=[innermost_pixel(shown == 3)]).mask
    assert iou(found, shown >= 2) > 0.95


def test_a_box_round_the_object(scene: tuple[RGBD, np.ndarray]) -> None:
    """The box of the true mask, a little larger: what reaches beyond it (ground, wall) is no part. The same where it has no
    depth."""
    rgbd, shown = scene
    true = shown == 2
    assert iou(find_mask(rgbd, box=box_round(true, 2)).mask, true) > 0.97
    color = np.where(true[..., None], np.uint8([70, 130, 90]), np.uint8(160))
    holed = RGBD(color, np.where(true, np.float32(0), rgbd.depth), CAMERA)
    assert iou(find_mask(holed, box=box_round(true, 2)).mask, true) > 0.9
    row, column = np.argwhere(true)[0]
    trimmed = find_mask(rgbd, box=box_round(true, 2), not_clicks=[(int(column), int(row))]).mask
    assert not trimmed[row, column] and iou(trimmed, true) > 0.6, "a negative click on the object takes a part of it"


def test_a_negative_click_amid_the_only_object_of_a_box_leaves_nothing() -> None:
    """Law: what is close to the outline of such an object is its rim, no object of its own."""
    made = world(942)
    camera = made.camera(0, 320)
    with_object, without = (made.frame(camera, object=shown) for shown in (True, False))
    true = with_object.depth != without.depth
    with pytest.raises(MaskError, match="nothing is left in box but what not_clicks are on"):
        find_mask(with_object, box=box_round(true, 4), not_clicks=[innermost_pixel(true)])


LEAVES = Box((-0.9, -0.4, 2.6), (-0.02, 1.0, 2.65)), Box((0.02, -0.4, 2.6), (0.9, 1.0, 2.65))
"""Two boxes 4 cm apart, through which the wall shows."""
STOOL = Box((-0.4, 0.5, 2.0), (0.4, 1.0, 2.1))
BED = Box((-0.9, 0.8, 2.25), (0.9, 1.0, 3.1)), Box((-0.9, 0.1, 3.0), (0.9, 1.0, 3.1))
"""Only the low end of the bed is near the stool; what shows above it is not."""


@pytest.mark.parametrize("shapes", [LEAVES, (STOOL, *BED)], ids=["two leaves", "a stool before a bed"])
def test_what_is_close_to_another_object_is_not_that_object(shapes: tuple[Box, ...]) -> None:
    """The first shape in green, the others in brown; of the leaves also a box round both, and a negative click on the other."""
    camera, made = Camera.from_fov(320, 240, 70), World((GROUND, WALL, *shapes))
    shown = made.trace(camera)[1]
    color = np.select([(shown == 2)[..., None], (shown > 2)[..., None]], [(70, 130, 90), (130, 90, 60)], 160)
    rgbd, true = RGBD(color.astype(np.uint8), made.rgbd(camera).depth, camera), shown == 2
    assert iou(find_mask(rgbd, clicks=[innermost_pixel(true)]).mask, true) > 0.97
    if shapes is LEAVES:
        found = find_mask(rgbd, box=box_round(shown >= 2), not_clicks=[innermost_pixel(shown == 3)]).mask
        assert iou(found, true) > 0.9


def test_a_stool_before_a_bed_of_a_generated_world() -> None:
    """One click finds all of the object and no other: what stays of it would stand before the background that is restored."""
    made = world(3009)
    camera = made.camera(0, 256)
    seen = made.raycast(camera)
    true = seen.group == made.object_index
    found = find_mask(RGBD(seen.color, seen.depth, camera), clicks=[innermost_pixel(true)]).mask
    assert iou(found, true) > 0.9


def test_a_click_next_to_it_takes_a_piece_away(scene: tuple[RGBD, np.ndarray]) -> None:
    """With `group` both boxes may come; not_clicks never lie in the mask, clicks always do."""
    rgbd, shown = scene
    click, next_to = innermost_pixel(shown == 2), innermost_pixel(shown == 5)
    mask = find_mask(rgbd, clicks=[click], not_clicks=[next_to], candidate="group").mask
    assert mask[click[1], click[0]]
    assert not mask[next_to[1], next_to[0]]


def test_a_reading_that_there_is_not_is_named() -> None:
    """Law: of a lone box, which has no other reading; the object itself is no reason for a note."""
    rgbd, click = LONE_BOX.rgbd(CAMERA), innermost_pixel(LONE_BOX.trace(CAMERA)[1] == 2)
    for candidate in ("part", "object", "group"):
        found = find_mask(rgbd, clicks=[click], candidate=candidate)
        missing = f"there is no other reading as a {candidate}, so the mask is the object"
        assert (found.chosen, list(found.candidates)) == ("object", ["object"])
        assert (missing in found.notes) == (candidate != "object")


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"clicks": [(160, 5)]}, InputError, "clicks holds 160,5, which lies outside the picture; x in 0..159"),
        ({"clicks": [(3, 5)], "not_clicks": [(3, -1)]}, InputError, "not_clicks holds 3,-1"),
        ({"clicks": [(3, 5)], "not_clicks": [(3, 5)]}, InputError, "both hold pixel 3,5"),
        ({"box": (10, 10, 0, 5)}, InputError, "box is 0 x 5 pixels"),
        ({"box": (10, 10, 170, 20)}, InputError, "box is 10,10,170,20, which is no part of the picture of 160x120"),
        ({"box": (200, 10, 5, 5)}, InputError, "which is no part of the picture of 160x120"),
        (
            {"box": (10, 10, 5, 5), "clicks": [(12, 30)]},
            InputError,
            "clicks holds 12,30, which lies outside box 10,10,5,5",
        ),
        ({"box": (1, 2, 3)}, InputError, "4 numbers"),
        ({}, InputError, "clicks and box are both missing"),
        ({"clicks": [(80, 118)]}, MaskError, "clicks holds 80,118, which lies on a plain surface"),
        ({"clicks": [(3, 5)], "masker": "magic"}, InputError, "one of rgbd, salient"),
        ({"clicks": [(3, 5)], "candidate": "all"}, InputError, "one of part, object, group"),
    ],
)
def test_bad_input_is_one_line(
    scene: tuple[RGBD, np.ndarray], options: dict, kind: type[DlamaError], words: str
) -> None:
    with pytest.raises(kind) as error:
        find_mask(scene[0], **options)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_the_sky_is_no_object() -> None:
    depth = np.full((40, 50), np.inf, np.float32)
    depth[20:] = 3
    rgbd = RGBD(np.zeros((40, 50, 3), np.uint8), depth, Camera.from_fov(50, 40, 60))
    with pytest.raises(MaskError, match="lies on the sky"):
        find_mask(rgbd, clicks=[(25, 3)])


def test_what_is_more_than_half_of_the_picture_is_reported(scene: tuple[RGBD, np.ndarray]) -> None:
    """Law: a click on an object that fills most of the picture gives it, with a note; the small box has none."""
    large = World((Plane((0, 0, 5), (0, 0, -1)), Box((-1.2, -1.0, 2.6), (1.4, 1.0, 3.2))))
    assert find_mask(large.rgbd(CAMERA), clicks=[(60, 45)]).notes == (TOO_MUCH,)
    assert find_mask(scene[0], clicks=[innermost_pixel(scene[1] == 2)]).notes == ()


def test_a_click_on_the_road_is_refused() -> None:
    """Oracle: the street's picture. Amid the road nothing stands apart; the barrel is found, also by further clicks on it."""
    folder = dlama.example()
    session = MaskSession(dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90))
    road, barrel = [(120, 450), (420, 430), (256, 480)], (256, 345)
    for click in road:
        with pytest.raises(MaskError, match="nothing stands apart"):
            session.find(clicks=[click])
    alone = session.find(clicks=[barrel], not_clicks=road).mask
    assert 4000 < alone.sum() < 8000 and alone[315, 256] and not any(alone[y, x] for x, y in road)
    assert session.find(clicks=[road[0], barrel]).mask[345, 256]


def test_a_mask_prints_as_a_line() -> None:
    """Oracle: by hand."""
    found = ObjectMask(np.eye(4, 5, dtype=bool), {}, "object", "rgbd")
    assert repr(found) == "ObjectMask(object by rgbd, 20 % of 5x4)"


LARGE_CAMERA = Camera.from_fov(640, 480, 70)
LONE_BOX = World((GROUND, WALL, BOX))


@pytest.fixture
def large_scene(monkeypatch: pytest.MonkeyPatch) -> tuple[RGBD, np.ndarray]:
    """A picture of 307,200 pixels that counts as large, and which of them show its box."""
    monkeypatch.setattr(small, "LARGEST", 100_000)
    monkeypatch.setattr(small, "SMALL", 30_000)
    return LONE_BOX.rgbd(LARGE_CAMERA), LONE_BOX.trace(LARGE_CAMERA)[1] == 2


def test_a_small_picture_is_its_own(large_scene: tuple[RGBD, np.ndarray], monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: up to LARGEST pixels nothing is shrunk; a larger one has SMALL of them, to a row and a column."""
    found = SmallPicture.of(large_scene[0])
    assert found is not None and found.rgbd.depth.size == pytest.approx(30_000, rel=0.01)
    monkeypatch.setattr(small, "LARGEST", large_scene[0].depth.size)
    assert SmallPicture.of(large_scene[0]) is None


def test_the_outline_is_that_of_the_large_picture(large_scene: tuple[RGBD, np.ndarray]) -> None:
    """Oracle: the true pixels. The way there and back keeps all but a few of the foot, where depth has no step."""
    picture = SmallPicture.of(large_scene[0])
    assert picture is not None
    back = picture.enlarge(picture.shrink(large_scene[1]))
    blocky = small.nearest_pixels(picture.shrink(large_scene[1]), large_scene[1].shape)
    assert (back ^ large_scene[1]).sum() < 0.3 * (blocky ^ large_scene[1]).sum() and iou(back, large_scene[1]) > 0.99


def test_a_click_in_a_large_picture(large_scene: tuple[RGBD, np.ndarray]) -> None:
    """Oracle: the true pixels. Laws: clicks are right to the pixel, also two that share one of the small picture; a click on
    nothing is named by its place in the large one."""
    rgbd, true = large_scene
    at = innermost_pixel(true)
    assert iou(find_mask(rgbd, clicks=[at]).mask, true) > 0.97
    next_to = at[0] + 1, at[1]
    found = find_mask(rgbd, clicks=[at], not_clicks=[next_to]).mask
    assert found[int(at[1]), int(at[0])] and not found[int(next_to[1]), int(next_to[0])]
    assert iou(find_mask(rgbd, box=box_round(true, 6)).mask, true) > 0.97
    with pytest.raises(MaskError, match=r"`?clicks`? holds 600,40,"):
        find_mask(rgbd, clicks=[(600, 40)])


def test_clicks_at_the_border_stay_in_the_picture(large_scene: tuple[RGBD, np.ndarray]) -> None:
    """Law: of clicks anywhere in the large picture the small one has a pixel, and of a thin box one, too."""
    picture = SmallPicture.of(large_scene[0])
    assert picture is not None
    smaller = picture.prompt(Prompt((480, 640), ((639.9, 479.9), (0, 0)), ((639.9, 0),)))
    height, width = picture.rgbd.depth.shape
    assert smaller.on == [(height - 1, width - 1), (0, 0)] and smaller.away == [(0, width - 1)]
    assert picture.prompt(Prompt((480, 640), ((100.9, 100.9),), box=(100, 100, 1, 1))).inside.sum() == 1


@pytest.mark.usefixtures("large_scene")
def test_a_box_as_wide_as_a_large_picture_is_as_wide_as_the_small_one() -> None:
    """Law, at sizes of which some have no exact ratio in floating point."""
    for width in range(340, 380):
        hw = (300, width)
        rgbd = RGBD(np.zeros((*hw, 3), np.uint8), np.ones(hw, np.float32), Camera.from_fov(width, 300, 70))
        picture = SmallPicture.of(rgbd)
        assert picture is not None
        assert picture.prompt(Prompt(hw, box=(0, 0, width, 300))).inside.all()
