"""Colour pictures and masks: what Pillow, OpenCV and imageio write is read with its plain meaning, all else is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import imageio.v3 as imageio
import numpy as np
import pytest
import tifffile
from PIL import Image

from dlama.errors import FileError, MaskError
from dlama.files.rasters.depth import read_depth, write_depth_png
from dlama.files.rasters.exr_files import write_exr
from dlama.files.rasters.images import has_16_bits, picture_hw, read_stored
from dlama.files.rasters.masks import read_mask, write_mask
from dlama.files.rasters.pictures import read_color, srgb_of, write_codes, write_color, write_grey

COLOR = np.random.default_rng(0).integers(0, 256, (14, 19, 3)).astype(np.uint8)
EXPECTED = np.zeros((6, 8), bool)
EXPECTED[2:4, 3:6] = True
"""What a mask shows."""
SMOOTH = np.clip(np.add.outer(np.arange(90), np.arange(130))[..., None] + [0, 20, 36], 0, 255).astype(np.uint8)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".ppm"])
def test_color_there_and_back(tmp_path: Path, suffix: str) -> None:
    """Oracles: the round trip, and imageio reading our file; what OpenCV writes, bit for bit."""
    path = tmp_path / f"c{suffix}"
    write_color(path, COLOR)
    assert np.array_equal(read_color(path), COLOR) and picture_hw(path) == COLOR.shape[:2]
    assert np.array_equal(imageio.imread(path), COLOR)
    cv2.imwrite(str(path), COLOR)
    assert np.array_equal(read_color(path), COLOR[..., ::-1])


def test_webp_is_read_and_an_animated_one_refused(tmp_path: Path) -> None:
    """Oracles: a lossless one that OpenCV wrote; Pillow's EXIF, by which the picture is turned."""
    cv2.imwrite(str(tmp_path / "a.webp"), COLOR[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 101])
    assert np.array_equal(read_color(tmp_path / "a.webp"), COLOR)
    picture, turned = Image.fromarray(COLOR), Image.Exif()
    turned[0x0112] = 6
    picture.save(tmp_path / "b.webp", lossless=True, exif=turned)
    assert np.array_equal(read_color(tmp_path / "b.webp"), np.rot90(COLOR, -1))
    picture.save(tmp_path / "c.webp", save_all=True, append_images=[Image.fromarray(255 - COLOR)])
    with pytest.raises(FileError, match=r"c\.webp: holds more than one frame"):
        read_color(tmp_path / "c.webp")
    whole = (tmp_path / "a.webp").read_bytes()
    (tmp_path / "d.webp").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileError, match=r"d\.webp: is damaged or truncated"):
        read_color(tmp_path / "d.webp")


@pytest.mark.parametrize("largest", [65535, 4095])
def test_a_pgm_of_16_bits_keeps_its_numbers(tmp_path: Path, largest: int) -> None:
    """Netpbm: big-endian words, whatever the largest value; Pillow would stretch them to 65535. As depth they keep their unit."""
    values = np.arange(20, dtype=np.uint16).reshape(4, 5) * (largest // 20)
    path = tmp_path / "d.pgm"
    path.write_bytes(b"P5\n# a camera's\n5 4\n%d\n" % largest + values.astype(">u2").tobytes())
    assert np.array_equal(read_stored(path).values, values) and has_16_bits(path)
    assert np.allclose(read_depth(path, depth_scale=1000)[1:], values[1:] / 1000)


@pytest.mark.parametrize("suffix", [".jpg", ".avif"])
def test_lossy_pictures_are_read_and_turned_by_their_tag(tmp_path: Path, suffix: str) -> None:
    """Oracle: what was saved, but for what its compression loses; orientation 6 shows the stored picture turned to the right."""
    path = tmp_path / f"c{suffix}"
    exif = Image.Exif()
    exif[274] = 6
    Image.fromarray(SMOOTH).save(path, quality=95, exif=exif)
    turned = np.rot90(SMOOTH, -1)
    assert picture_hw(path) == turned.shape[:2]
    assert np.abs(read_color(path).astype(int) - turned).mean() < 3


@pytest.mark.parametrize(("suffix", "channels"), [(".png", 1), (".png", 4), (".tif", 3), (".tif", 4)])
def test_16_bit_keeps_the_high_byte(tmp_path: Path, suffix: str, channels: int) -> None:
    """Oracle: numpy's shift of what OpenCV wrote; grey is repeated, alpha dropped."""
    values = np.random.default_rng(channels).integers(0, 65536, (9, 11, channels)).astype(np.uint16)
    values[..., 3:] = 65535
    cv2.imwrite(str(tmp_path / f"c{suffix}"), values)
    expected = (values >> 8).astype(np.uint8)
    expected = np.repeat(expected, 3, axis=2) if channels == 1 else expected[..., 2::-1]
    with pytest.warns(UserWarning, match="has 16 bits a channel"):
        assert np.array_equal(read_color(tmp_path / f"c{suffix}"), expected)


@pytest.mark.parametrize("bits", [10, 12, 14, 15])
def test_pictures_of_fewer_bits_in_16_are_warned_of(
    tmp_path: Path, bits: int, recwarn: pytest.WarningsRecorder
) -> None:
    """Closed form: the bits that the largest value takes, up to a quarter of the range."""
    values = np.linspace(0, (1 << bits) - 1, 60).reshape(6, 10).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "infrared.png"), values)
    read_color(tmp_path / "infrared.png")
    dark = [one for one in recwarn if f"as of a camera of {bits} bits" in str(one.message)]
    assert len(dark) == len(recwarn) - 1 == (bits < 15)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "palette"])
def test_transparent_pixels_are_warned_of(tmp_path: Path, kind: str) -> None:
    """Oracle: the share of the alpha that was written, or of one of two colours of a palette; they count as measured."""
    path = tmp_path / "cut.png"
    if kind == "palette":
        picture = Image.fromarray((np.indices((10, 20))[0] < 4).astype(np.uint8))
        picture.putpalette([9, 8, 7, 200, 100, 50])
        picture.save(path, transparency=1)
    else:
        values = np.full((10, 20, 4), np.iinfo(kind).max, kind)
        values[:4, :, 3] //= 2
        cv2.imwrite(str(path), values)
    with pytest.warns(UserWarning) as caught:
        shown = read_color(path)[0, 0].tolist()
    assert shown == ([200, 100, 50] if kind == "palette" else [255] * 3)
    words = f"{path}: alpha is dropped; the colours of its transparent pixels (40 %) count as measured"
    assert [str(one.message) for one in caught if "16 bits" not in str(one.message)] == [words]


@pytest.mark.parametrize("mode", ["L", "LA", "RGBA", "P", "1"])
def test_plain_modes_are_accepted(tmp_path: Path, mode: str) -> None:
    """Oracle: Pillow's own conversion to RGB."""
    picture = Image.fromarray(COLOR).convert(mode)
    picture.save(tmp_path / "c.png")
    assert np.array_equal(read_color(tmp_path / "c.png"), np.array(picture.convert("RGB")))


def test_missing_and_wrong_files(tmp_path: Path) -> None:
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("no picture")
    Image.fromarray(COLOR[..., 0].astype(np.float32)).save(tmp_path / "float.tif")
    pages = [Image.fromarray(COLOR), Image.fromarray(COLOR)]
    pages[0].save(tmp_path / "pages.tif", save_all=True, append_images=pages[1:])
    for name, words in (
        ("none.png", "no such file"), ("empty.png", "0 bytes"), ("text.png", "no readable"), ("float.tif", "float32"),
        ("pages.tif", "one page"),
    ):  # fmt: skip
        path = tmp_path / name
        with pytest.raises(FileError, match=words) as caught:
            read_color(path)
        assert str(path) in str(caught.value)
    with pytest.raises(FileError, match="directory"):
        read_color(tmp_path)


@pytest.mark.parametrize(
    "name", ["a.png", "a16.png", "a.jpg", "a.tif", "lzw.tif", "a16.tif", "a.bmp", "a.ppm", "a.avif"]
)
def test_truncated_pictures_raise_or_are_whole(tmp_path: Path, name: str) -> None:
    """Oracle: the whole picture; cut anywhere, a file gives that (only an end mark is gone) or an error, never half."""
    path = tmp_path / name
    if "16" in name:
        cv2.imwrite(str(path), SMOOTH.astype(np.uint16) * 257)
    else:
        Image.fromarray(SMOOTH).save(path, **({"compression": "tiff_lzw"} if "lzw" in name else {}))
    data, whole = path.read_bytes(), srgb_of(read_stored(path), path)
    refused = 0
    for kept in [*np.linspace(1, len(data) - 40, 20).astype(int), *range(len(data) - 30, len(data), 5)]:
        path.write_bytes(data[:kept])
        try:
            assert np.array_equal(srgb_of(read_stored(path), path), whole), f"{name} cut to {kept} of {len(data)} bytes"
        except FileError as error:
            refused += 1
            assert str(path) in str(error)
    assert refused >= 20


def mask_of(path: Path, values: list[list[int]]) -> Path:
    Image.fromarray(np.array(values, np.uint8)).save(path)
    return path


def test_mask_polarity_and_tolerance(tmp_path: Path) -> None:
    """Oracle: the rule in HOUSE.md, <= 8 is black, >= 247 is white."""
    for values, words in (([0, 0], "is empty"), ([255, 255], "is full"), ([0, 1], "is empty.*largest value is 1")):
        with pytest.raises(MaskError, match=words):
            read_mask(mask_of(tmp_path / "m.png", [values]))
    for largest, words in ((1, "largest value is 1"), (600, "is it the depth, and the mask not given")):
        cv2.imwrite(str(tmp_path / "m.png"), np.array([[0, largest]], np.uint16))
        with pytest.raises(MaskError, match=words):
            read_mask(tmp_path / "m.png")
    path = mask_of(tmp_path / "m.png", [[0, 8, 247, 255]])
    assert read_mask(path).tolist() == [[False, False, True, True]]
    assert read_mask(path, mask_polarity="known").tolist() == [[True, True, False, False]]


def test_grey_mask_is_refused_unless_soft(tmp_path: Path) -> None:
    path = mask_of(tmp_path / "m.png", [[0, 9, 127, 128, 246, 255]])
    with pytest.raises(MaskError, match=r"4 of 6 pixels.*values 9, 127, 128, 246.*soft_mask"):
        read_mask(path)
    assert read_mask(path, soft_mask=True).tolist() == [[False, False, False, True, True, True]]
    write_depth_png(tmp_path / "depth.png", np.full((2, 3), 5.0, np.float32))
    with pytest.raises(MaskError, match=r"depth\.png: 6 of 6 pixels.* the mask not given, or given before it\?"):
        read_mask(tmp_path / "depth.png")


def test_masks_of_other_kinds(tmp_path: Path) -> None:
    """Bilevel, 16-bit, grey RGB and opaque RGBA mean what they show; colour and transparency do not."""
    grey = EXPECTED.astype(np.uint8) * 255
    Image.fromarray(grey).convert("1").save(tmp_path / "1.png")
    cv2.imwrite(str(tmp_path / "16.png"), grey.astype(np.uint16) * 257)
    cv2.imwrite(str(tmp_path / "8 in 16.png"), grey.astype(np.uint16))  # was called empty, and left out of sequences
    for mode in ("RGB", "RGBA", "P"):
        Image.fromarray(grey).convert(mode).save(tmp_path / f"{mode}.png")
    for name in ("1", "16", "8 in 16", "RGB", "RGBA", "P"):
        assert np.array_equal(read_mask(tmp_path / f"{name}.png"), EXPECTED), name
    half = np.where(np.indices(grey.shape)[0] < 3, 255, 0).astype(np.uint8)
    Image.fromarray(np.dstack([grey] * 3 + [half])).save(tmp_path / "clear.png")
    with pytest.raises(MaskError, match="transparent"):
        read_mask(tmp_path / "clear.png")
    Image.fromarray(COLOR).save(tmp_path / "color.png")
    with pytest.raises(MaskError, match="mask_class"):
        read_mask(tmp_path / "color.png")
    with pytest.raises(MaskError, match="polarity"):
        read_mask(tmp_path / "1.png", mask_polarity="white")  # type: ignore[arg-type]


@pytest.mark.parametrize("what", ["plate", "white", "black", "red"])
def test_alpha_is_the_mask_where_pixels_are_transparent(tmp_path: Path, what: str) -> None:
    """Oracle: the matte that was written as alpha, of a cut-out, a white, a black or a red silhouette."""
    red = np.full((6, 8, 3), (255, 0, 0))
    white = np.full((6, 8, 3), 255)
    rgb = {"plate": np.arange(144).reshape(6, 8, 3), "white": white, "black": white * 0, "red": red}[what]
    Image.fromarray(np.dstack([rgb, EXPECTED * 255]).astype(np.uint8)).save(tmp_path / "cut.png")
    with pytest.warns(UserWarning, match="its alpha is the mask: what is opaque is removed"):
        assert np.array_equal(read_mask(tmp_path / "cut.png"), EXPECTED)
    with pytest.warns(UserWarning, match="alpha"):
        assert np.array_equal(read_mask(tmp_path / "cut.png", mask_polarity="known"), ~EXPECTED)


def test_mattes_in_floats(tmp_path: Path) -> None:
    """Oracle: the matte as written, by OpenEXR as alpha or grey, by OpenCV as TIFF; a soft edge is refused, or cut at a half."""
    matte = EXPECTED.astype(np.float32)
    soft = matte * np.float32(0.6)
    picture = {name: np.arange(48, dtype=np.float32).reshape(6, 8) + shift for shift, name in enumerate("RGB")}
    grey = dict.fromkeys("RGB", matte)
    files = {
        "alpha": {**picture, "A": matte},
        "one": {"A": matte},
        "grey": {**grey, "A": matte * 0 + 1},
        "Y": {"Y": matte},
    }
    for name, channels in files.items():
        write_exr(tmp_path / f"{name}.exr", channels)
        assert np.array_equal(read_mask(tmp_path / f"{name}.exr"), EXPECTED), name
    cv2.imwrite(str(tmp_path / "float.tif"), matte * 1.05)
    assert np.array_equal(read_mask(tmp_path / "float.tif"), EXPECTED)
    write_exr(tmp_path / "soft.exr", {"A": soft})
    with pytest.raises(MaskError, match="soft_mask"):
        read_mask(tmp_path / "soft.exr")
    assert np.array_equal(read_mask(tmp_path / "soft.exr", soft_mask=True), EXPECTED)
    write_exr(tmp_path / "depth.exr", {"Z": matte * 7})
    with pytest.raises(MaskError, match="holds 0 to 7; a mask of floats is 0 to 1"):
        read_mask(tmp_path / "depth.exr")
    write_exr(tmp_path / "picture.exr", picture)
    with pytest.raises(FileError, match=r"R and G differ\); matte in one channel"):
        read_mask(tmp_path / "picture.exr")


@pytest.mark.parametrize("kind", ["bool", "uint8", "int64", "float32"])
def test_masks_of_numpy(tmp_path: Path, kind: str) -> None:
    """Oracle: the mask as NumPy saved it, 0 and 1, alone and in an NPZ; 0 and 255; three of Segment Anything are refused."""
    ones = EXPECTED.astype(kind)
    np.save(tmp_path / "m.npy", ones)
    np.savez(tmp_path / "m.npz", mask=ones, score=0.5)
    np.save(tmp_path / "255.npy", EXPECTED.astype(np.int64) * 255)
    for name in ("m.npy", "m.npz", "255.npy"):
        assert np.array_equal(read_mask(tmp_path / name), EXPECTED)
    np.save(tmp_path / "three.npy", [ones] * 3)
    with pytest.raises(FileError, match=r"shape \(3, 6, 8\); H x W is expected"):
        read_mask(tmp_path / "three.npy")
    (tmp_path / "rle.json").write_text('{"size": [6, 8], "counts": "0"}')
    with pytest.raises(FileError, match=r"save a mask \(RLE, polygons\) as a black and white PNG"):
        read_mask(tmp_path / "rle.json")


@pytest.mark.parametrize("label", [7, 300, 26001])
def test_a_label_of_a_map_by_its_number(tmp_path: Path, label: int) -> None:
    """Oracle: the pixels that OpenCV, and NumPy, wrote with that label; a map that is given as a mask says how."""
    labels = np.where(EXPECTED, label, 0).astype(np.uint16)
    labels[0, 0] = 3
    cv2.imwrite(str(tmp_path / "ids.png"), labels)
    np.save(tmp_path / "ids.npy", labels.astype(np.int32))
    for name in ("ids.png", "ids.npy"):
        assert np.array_equal(read_mask(tmp_path / name, mask_class=str(label)), EXPECTED & (labels == label))
    with pytest.raises(MaskError, match=rf"no pixel shows class 9 \(9\); found: 0 3 {label}"):
        read_mask(tmp_path / "ids.png", mask_class="9")
    with pytest.raises(MaskError, match=r"of a map of labels mask_class=NUMBER removes one"):
        read_mask(tmp_path / "ids.png")


def test_mask_class_by_name_and_by_color(tmp_path: Path) -> None:
    semantic = np.zeros((4, 5, 3), np.uint8)
    semantic[1, 2:4] = (255, 0, 0)
    folder = tmp_path / "with" / "Camera" / "SemanticImage"
    folder.mkdir(parents=True)
    write_color(folder / "s.png", semantic)
    with pytest.raises(MaskError, match=r"no SemanticClasses\.csv"):
        read_mask(folder / "s.png", mask_class="object")
    (tmp_path / "with" / "SemanticClasses.csv").write_text("background,0,0,0\nobject,255,0,0\nsky,70,130,180\n")
    expected = (semantic == (255, 0, 0)).all(axis=2)
    assert np.array_equal(read_mask(folder / "s.png", mask_class="object"), expected)
    assert np.array_equal(read_mask(folder / "s.png", mask_class="255, 0,0"), expected)
    with pytest.raises(MaskError, match="known: background, object, sky"):
        read_mask(folder / "s.png", mask_class="car")
    with pytest.raises(MaskError, match=r"no pixel shows class sky \(70,130,180\); found: 0,0,0 255,0,0"):
        read_mask(folder / "s.png", mask_class="sky")


def test_real_semantic_picture(data_dir: Path) -> None:
    """Oracle: the README's object share of s08 at yaw 0, 8.9 %."""
    (path,) = sorted((data_dir / "street/s08/with/CameraComponent/SemanticImage").glob("*.png"))[:1]
    assert read_mask(path, mask_class="object").mean() == pytest.approx(0.089, abs=0.0006)


def test_written_masks_codes_and_greys(tmp_path: Path) -> None:
    """Oracle: Pillow reading the file back."""
    mask = COLOR[..., 0] > 128
    write_mask(tmp_path / "m.png", mask)
    assert np.array_equal(np.array(Image.open(tmp_path / "m.png")), np.where(mask, 255, 0))
    assert np.array_equal(read_mask(tmp_path / "m.png"), mask)
    codes = (COLOR[..., 0] % 3).astype(np.uint8)
    palette = ((0, 0, 0), (10, 20, 30), (200, 100, 50))
    write_codes(tmp_path / "c.png", codes, palette)
    with Image.open(tmp_path / "c.png") as picture:
        assert picture.mode == "P" and np.array_equal(np.array(picture), codes)
        assert np.array_equal(np.array(picture.convert("RGB")), np.array(palette)[codes])
    write_grey(tmp_path / "g.png", np.array([[0, 0.5, 1, 2, np.nan]], np.float32))
    assert np.array(Image.open(tmp_path / "g.png")).tolist() == [[0, 128, 255, 255, 0]]


HEADS = {
    "OpenEXR": (b"v/1\x01", "convert its linear light to sRGB"),
    "a pointer of Git LFS": (b"version https://git-lfs.github.com/spec/v1", "`git lfs pull`"),
    "a web page": (b"<!DOCTYPE html>", ""),
}
"""How files of other kinds begin, by their specifications, and what is advised."""


def test_files_of_a_result_given_as_a_picture_say_what_goes_where(tmp_path: Path) -> None:
    """Message: the scene itself goes elsewhere; of points and mesh it is the scene next to them; other pictures are named."""
    for name, reported in (("s.npz", "a scene goes into"), ("s.ply", r"the scene\.npz of the result goes into")):
        (tmp_path / name).write_bytes(b"ply\n")
        with pytest.raises(FileError, match=reported):
            read_color(tmp_path / name)
    (tmp_path / "scene.npz").touch()
    with pytest.raises(FileError, match=r"is a directory, a file is expected \(.*scene\.npz\?\)$"):
        read_color(tmp_path)
    picture, words = tmp_path / "picture.png", "no readable PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC picture, but"
    for kind, (head, advice) in HEADS.items():
        picture.write_bytes(head + bytes(99))
        with pytest.raises(FileError, match=f"{words} {kind}: {advice}"):
            read_color(picture)
    for kind in ("GIF", "TGA", "JPEG2000"):
        Image.fromarray(COLOR).save(picture, kind)
        with pytest.raises(FileError, match=f"{words} {kind}: save it as PNG"):
            read_color(picture)
    for path, words in (
        ("https:/somewhere/a.jpg", "no such file; addresses are for `dlama batch` alone"),
        ("~/nowhere/a.jpg", "no such file; ~ is the home directory only where a shell replaces it"),
    ):
        with pytest.raises(FileError, match=words):
            read_color(path)


def test_a_png_with_a_wrong_checksum_is_refused(tmp_path: Path) -> None:
    """Every byte of a chunk is covered by its checksum, that of the pixels too (oracle: PNG 1.2, 3.4)."""
    path = tmp_path / "a.png"
    Image.fromarray(np.arange(192, dtype=np.uint8).reshape(8, 8, 3)).save(path)
    data = path.read_bytes()
    end = data.index(b"IEND") - 8  # in front of its length: the checksum of the pixels
    path.write_bytes(data[:end] + bytes([data[end] ^ 1]) + data[end + 1 :])
    for read in (read_color, read_mask):
        with pytest.raises(FileError, match=r"a\.png: is damaged or truncated \(broken PNG file .*b'IDAT'"):
            read(path)


def test_the_preview_of_a_raw_file_is_not_taken_for_the_picture(tmp_path: Path) -> None:
    """The thumbnail first, the sensor in a SubIFD, as in NEF and DNG. A small TIFF that says so of itself alone is one."""
    sensor = np.random.default_rng(0).integers(0, 16384, (140, 190)).astype(np.uint16)
    with tifffile.TiffWriter(tmp_path / "a.nef") as raw:
        raw.write(COLOR, photometric="rgb", subfiletype=1, subifds=1)
        raw.write(sensor, photometric="minisblack", subfiletype=0)
    for read in (read_color, picture_hw):
        with pytest.raises(FileError, match=r"a\.nef: is a raw file of a camera; develop it"):
            read(tmp_path / "a.nef")
    tifffile.imwrite(tmp_path / "small.tif", COLOR, photometric="rgb", subfiletype=1)
    assert np.array_equal(read_color(tmp_path / "small.tif"), COLOR)
