"""Photos that carry their depth, written as phones write them: HEIC, Apple's JPEG, GDepth, Dynamic Depth, MPO."""

from __future__ import annotations

import base64
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

APPLE_TYPE = "urn:mpeg:hevc:2015:auxid:2"
"""Of a depth image (ISO/IEC 23008-12, table B.1)."""
RDF = 'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"'


def picture(values: np.ndarray, kind: str = "JPEG", exif: Image.Exif | None = None) -> bytes:
    """The bytes of a picture file."""
    out = io.BytesIO()
    options: dict[str, Any] = {"quality": 95} if kind == "JPEG" else {}
    Image.fromarray(values).save(out, kind, **options, **({"exif": exif.tobytes()} if exif else {}))
    return out.getvalue()


def packet(body: str) -> bytes:
    """An XMP packet round some RDF."""
    return f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF {RDF}>{body}</rdf:RDF></x:xmpmeta>'.encode()


def segment(marker: int, content: bytes) -> bytes:
    """A segment of a JPEG."""
    return b"\xff" + bytes([marker]) + struct.pack(">H", len(content) + 2) + content


def with_segments(jpeg: bytes, *segments: bytes) -> bytes:
    """A JPEG with segments right after its first two bytes."""
    return jpeg[:2] + b"".join(segments) + jpeg[2:]


def standard(xmp: bytes) -> bytes:
    """The segment of an XMP packet."""
    return segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + xmp)


def apple_xmp(
    low: float, high: float, K: np.ndarray, wh: tuple[int, int], kind: str = "disparity", accuracy: str = "relative"
) -> bytes:
    """What stands next to Apple's depth pictures (as an iPhone 13 Pro writes it, shortened); K lists its columns."""
    columns = "".join(f"<rdf:li>{value}</rdf:li>" for value in K.T.ravel())
    return packet(
        '<rdf:Description rdf:about="" xmlns:apdi="http://ns.apple.com/pixeldatainfo/1.0/" '
        'xmlns:depthData="http://ns.apple.com/depthData/1.0/"><apdi:IntMinValue>0</apdi:IntMinValue>'
        f"<apdi:IntMaxValue>255</apdi:IntMaxValue><apdi:FloatMinValue>{low}</apdi:FloatMinValue>"
        f"<apdi:FloatMaxValue>{high}</apdi:FloatMaxValue><apdi:AuxiliaryImageType>{kind}</apdi:AuxiliaryImageType>"
        f"<depthData:IntrinsicMatrixReferenceWidth>{wh[0]}</depthData:IntrinsicMatrixReferenceWidth>"
        f"<depthData:IntrinsicMatrixReferenceHeight>{wh[1]}</depthData:IntrinsicMatrixReferenceHeight>"
        f"<depthData:IntrinsicMatrix><rdf:Seq>{columns}</rdf:Seq></depthData:IntrinsicMatrix>"
        f"<depthData:Accuracy>{accuracy}</depthData:Accuracy></rdf:Description>"
    )


def matte_xmp() -> bytes:
    """Of a portrait matte, which Apple calls a depth picture too."""
    return packet(
        '<rdf:Description xmlns:apdi="http://ns.apple.com/pixeldatainfo/1.0/" apdi:AuxiliaryImageType="depth" '
        'apdi:AuxiliaryImageSubType="portraiteffectsmatte"/>'
    )


def multi_picture(first: bytes, others: list[tuple[int, bytes]]) -> bytes:
    """A JPEG and further ones (type code, bytes) behind it, with their index (CIPA DC-007)."""
    listed = [(0x030000, first), *others]
    tags = struct.pack(">HHI4s", 0xB000, 7, 4, b"0100") + struct.pack(">HHII", 0xB001, 4, 1, len(listed))
    start = 8 + 2 + 3 * 12 + 4
    tags += struct.pack(">HHII", 0xB002, 7, 16 * len(listed), start)
    size = len(segment(0xE2, b"MPF\0" + b"\0" * (start + 16 * len(listed))))
    at, entries = len(first) + size, b""
    for number, (kind, data) in enumerate(listed):
        offset = 0 if number == 0 else at - (2 + 4 + 4)  # from the byte order mark, 10 bytes into the file
        entries += struct.pack(">IIIHH", kind, len(data) + (size if number == 0 else 0), offset, 0, 0)
        at += len(data) if number else 0
    index = b"MM\0*" + struct.pack(">IH", 8, 3) + tags + struct.pack(">I", 0) + entries
    return with_segments(first, segment(0xE2, b"MPF\0" + index)) + b"".join(data for _, data in others)


def gdepth(
    color: np.ndarray, codes: np.ndarray, near: float, far: float, how: str, extended: bool, **more: str
) -> bytes:
    """A JPEG with GDepth in its XMP, the picture of depth in extension segments where asked for."""
    data = base64.b64encode(picture(codes, "PNG")).decode()
    space = 'xmlns:GDepth="http://ns.google.com/photos/1.0/depthmap/"'
    named = "".join(f' GDepth:{name}="{value}"' for name, value in more.items())
    fields = f'GDepth:Format="{how}" GDepth:Near="{near}" GDepth:Far="{far}" GDepth:Mime="image/png"{named}'
    if not extended:
        return with_segments(
            picture(color), standard(packet(f'<rdf:Description {space} {fields} GDepth:Data="{data}"/>'))
        )
    whole = packet(f'<rdf:Description {space} GDepth:Data="{data}"/>')
    guid, chunk = b"0123456789ABCDEF" * 2, 997
    parts = [
        segment(
            0xE1,
            b"http://ns.adobe.com/xmp/extension/\0"
            + guid
            + struct.pack(">II", len(whole), at)
            + whole[at : at + chunk],
        )
        for at in range(0, len(whole), chunk)
    ]
    return with_segments(picture(color), standard(packet(f"<rdf:Description {space} {fields}/>")), *parts[::-1])


def dynamic_depth(color: np.ndarray, codes: np.ndarray, near: float, far: float, units: str = "Meters") -> bytes:
    """A JPEG of Dynamic Depth 1.0: a gain map and the depth behind it, listed in its container."""
    depth, other = picture(codes, "PNG"), picture(codes[:8, :8].astype(np.uint8))
    names = ("container", "item", "device", "camera", "depthmap")
    titles = {"depthmap": "DepthMap"}
    spaces = " ".join(f'xmlns:{titles.get(n, n.title())}="http://ns.google.com/photos/dd/1.0/{n}/"' for n in names)
    items = [
        ("image/jpeg", 0, "primary_image"),
        ("image/jpeg", len(other), "android/gainmap"),
        ("image/png", len(depth), "android/depthmap"),
    ]
    listed = "".join(
        f'<rdf:li rdf:parseType="Resource"><Container:Item Item:Mime="{mime}" Item:Length="{size}" '
        f'Item:DataURI="{uri}"/></rdf:li>'
        for mime, size, uri in items
    )
    body = (
        f'<rdf:Description {spaces}><Device:Container rdf:parseType="Resource"><Container:Directory><rdf:Seq>{listed}</rdf:Seq>'
        '</Container:Directory></Device:Container><Device:Cameras><rdf:Seq><rdf:li rdf:parseType="Resource">'
        '<Device:Camera rdf:parseType="Resource"><Camera:DepthMap rdf:parseType="Resource">'
        f"<DepthMap:Format>RangeInverse</DepthMap:Format><DepthMap:Near>{near}</DepthMap:Near><DepthMap:Far>{far}</DepthMap:Far>"
        f"<DepthMap:Units>{units}</DepthMap:Units><DepthMap:DepthURI>android/depthmap</DepthMap:DepthURI>"
        "<DepthMap:ItemSemantic>Depth</DepthMap:ItemSemantic></Camera:DepthMap></Device:Camera></rdf:li></rdf:Seq>"
        "</Device:Cameras></rdf:Description>"
    )
    return with_segments(picture(color), standard(packet(body))) + other + depth


def heic_with_depth(path: Path, color: np.ndarray, codes: np.ndarray, xmp: bytes, orientation: int = 1) -> Path:
    """A HEIC file whose second picture is made the depth image of the first, by its boxes (ISO/IEC 14496-12); XMP behind them."""
    import pillow_heif

    file = pillow_heif.from_pillow(Image.fromarray(color))
    file.add_from_pillow(Image.fromarray(codes))
    exif = Image.Exif()
    exif[0x0112] = orientation
    out = io.BytesIO()
    file.save(out, quality=-1, chroma=444, matrix_coefficients=0, exif=exif.tobytes() if orientation != 1 else None)
    path.write_bytes(_second_as_depth(out.getvalue()) + struct.pack(">I4s", 8 + len(xmp), b"free") + xmp)
    return path


def boxes(data: bytes, start: int, end: int) -> dict[bytes, tuple[int, int]]:
    """Kind -> begin and end of the boxes between two places."""
    found = {}
    while start < end:
        size, kind = struct.unpack_from(">I4s", data, start)
        found[kind] = (start, start + size)
        start += size
    return found


def _second_as_depth(data: bytes) -> bytes:
    meta = boxes(data, 0, len(data))[b"meta"]
    inside = boxes(data, meta[0] + 12, meta[1])
    primary = struct.unpack_from(">H", data, inside[b"pitm"][0] + 12)[0]
    listed = data[inside[b"iinf"][0] : inside[b"iinf"][1]]
    items = [
        struct.unpack_from(">H", listed, at + 8)[0]
        for at in range(len(listed))
        if listed[at : at + 4] == b"infe" and b"hvc1" in listed[at + 8 : at + 18]
    ]
    depth = next(item for item in items if item != primary)
    props = boxes(data, inside[b"iprp"][0] + 8, inside[b"iprp"][1])
    (start, end), (ipma_start, ipma_end) = props[b"ipco"], props[b"ipma"]
    count, at = 0, start + 8
    while at < end:
        at, count = at + struct.unpack_from(">I", data, at)[0], count + 1
    text = APPLE_TYPE.encode() + b"\0"
    auxc = struct.pack(">I4sI", 12 + len(text), b"auxC", 0) + text
    ipco = struct.pack(">I", end - start + len(auxc)) + data[start + 4 : end] + auxc
    ipma = bytearray(data[ipma_start:ipma_end])
    entries = struct.unpack_from(">I", ipma, 12)[0]
    at = 16
    for _ in range(entries):
        item, many = struct.unpack_from(">HB", ipma, at)
        if item == depth:
            ipma[at + 2] = many + 1
            ipma[at + 3 + many : at + 3 + many] = bytes([count + 1])
            many += 1
        at += 3 + many
    struct.pack_into(">I", ipma, 0, len(ipma))
    iprp = struct.pack(">I4s", 8 + len(ipco) + len(ipma), b"iprp") + ipco + bytes(ipma)
    reference = struct.pack(">I4sHHH", 14, b"auxl", depth, 1, primary)
    old = data[slice(*inside[b"iref"])] if b"iref" in inside else struct.pack(">I4sI", 12, b"iref", 0)
    iref = struct.pack(">I", len(old) + 14) + old[4:] + reference
    parts = [data[slice(*place)] for kind, place in inside.items() if kind not in (b"iprp", b"iref")]
    grown = struct.pack(">I", 12 + sum(map(len, parts)) + len(iprp) + len(iref)) + data[meta[0] + 4 : meta[0] + 12]
    grown += b"".join(parts) + iprp + iref
    return _moved(data[: meta[0]] + grown + data[meta[1] :], len(grown) - (meta[1] - meta[0]))


def _moved(data: bytes, by: int) -> bytes:
    """The places of items, which count from the file's begin, after the boxes before them grew."""
    meta = boxes(data, 0, len(data))[b"meta"]
    at = boxes(data, meta[0] + 12, meta[1])[b"iloc"][0]
    out = bytearray(data)
    version, sizes, base = data[at + 8], data[at + 12], data[at + 13]
    assert version in (0, 1) and sizes == 0x44 and base >> 4 in (0, 4), (version, sizes, base)
    (count,), place = struct.unpack_from(">H", data, at + 14), at + 16
    for _ in range(count):
        method = struct.unpack_from(">H", data, place + 2)[0] if version else 0
        place += 4 + (2 if version else 0) + (base >> 4)
        (extents,) = struct.unpack_from(">H", data, place)
        place += 2
        for _ in range(extents):
            if method == 0:
                struct.pack_into(">I", out, place, struct.unpack_from(">I", data, place)[0] + by)
            place += 8
    return bytes(out)
