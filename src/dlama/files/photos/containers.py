"""The bytes of a photo in; its XMP properties and the further pictures in the file out.

XMP in JPEG: XMP specification part 3 (ISO 16684-1), 1.1.3: an APP1 segment, and what does not fit it in extension segments. In
HEIC a packet is stored in one piece, so it is looked for. Further pictures of a JPEG: CIPA DC-007 (Multi-Picture Format).
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from PIL.JpegImagePlugin import JpegImageFile
from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2

JPEG_BEGINS = b"\xff\xd8\xff"
STANDARD, EXTENSION = b"http://ns.adobe.com/xap/1.0/\0", b"http://ns.adobe.com/xmp/extension/\0"
STEREO = 0x020002
"""Type code of a picture of a stereo pair ("disparity")."""
PACKET = re.compile(rb"<x:xmpmeta.*?</x:xmpmeta>", re.DOTALL)
RDF = "{http://www.w3.org/1999/02/22-rdf-syntax-ns#}"


@dataclass(frozen=True)
class Xmp:
    """The properties of XMP packets, by `{namespace}name`, wherever in the structure they stand."""

    found: dict[str, list[str]]

    def text(self, name: str) -> str | None:
        """The first value of a property; None where there is none."""
        return next(iter(self.found.get(name, ())), None)

    def number(self, name: str) -> float | None:
        """The first value as a number; None where there is none, or one is no number."""
        return next(iter(self.numbers(name)), None)

    def numbers(self, name: str) -> list[float]:
        """The values of a list property as numbers; empty where one is no number."""
        try:
            return [float(value) for value in self.found.get(name, ())]
        except ValueError:
            return []


def find_xmp(data: bytes) -> list[Xmp]:
    """The XMP packets of a JPEG, the extension as one of them, or of a HEIC file; damaged ones are left out."""
    return [Xmp(_properties(root.iter())) for root in _roots(data)]


def merge_xmp(data: bytes) -> Xmp:
    """All packets of `find_xmp` as one."""
    return Xmp(_properties(element for root in _roots(data) for element in root.iter()))


def list_container_items(data: bytes) -> list[dict[str, str]]:
    """The entries of `Container:Directory` (Google's container), in order: Mime, Length, DataURI, Semantic, ... as they stand."""
    for root in _roots(data):
        for element in root.iter():
            if element.tag.endswith("}Directory") and "container" in element.tag:
                lists = (_properties(each.iter()) for each in element.iter(f"{RDF}li"))
                return [{name.partition("}")[2]: values[0] for name, values in one.items() if values} for one in lists]
    return []


def list_further_pictures(data: bytes) -> list[tuple[int, bytes]]:
    """Type code (CIPA DC-007: STEREO, ...) and bytes of the pictures after the first of a Multi-Picture JPEG; empty for other
    files. struct.error: its index is damaged."""
    base, order, tags = _multi_picture(data)
    entries = tags.get(0xB002, b"")  # MP Entry
    entry = struct.Struct(order + "IIIHH")  # attribute, size, offset, two numbers of dependent pictures
    listed = entry.iter_unpack(entries[: len(entries) // entry.size * entry.size])
    places = [(kind & 0xFFFFFF, base + offset, size) for kind, size, offset, *_ in listed if offset]
    return [(kind, data[at : at + size]) for kind, at, size in places]


def find_baseline(data: bytes) -> float | None:
    """Metres between the cameras of a stereo pair, as one of its two pictures says; None where it does not."""
    ratio = _multi_picture(data)[2].get(0xB206, IFDRational(0, 0))
    known = 0 < ratio.denominator < 0xFFFFFFFF and 0 < ratio.numerator < 0xFFFFFFFF
    return float(ratio) if known else None


def _multi_picture(data: bytes) -> tuple[int, str, dict[int, Any]]:
    """Where the byte order mark of a JPEG's Multi-Picture index lies, from which offsets count, the order, and its tags."""
    about, tags = JpegImageFile(io.BytesIO(data)).info, dict[int, Any]()
    stream = io.BytesIO(about.get("mp", b""))
    if head := stream.read(8):
        directory = ImageFileDirectory_v2(head)
        for _ in range(2):  # of the whole file, and of its first picture
            stream.seek(directory.next)
            directory.load(stream)
            tags = dict(directory) | tags
            if not directory.next:
                break
    return about.get("mpoffset", 0), ">" if head.startswith(b"MM") else "<", tags


def _jpeg_packets(data: bytes) -> Iterator[bytes]:
    chunks: dict[bytes, dict[int, bytes]] = {}
    for _, segment in JpegImageFile(io.BytesIO(data)).applist:
        if segment.startswith(STANDARD):
            yield segment[len(STANDARD) :]
        elif segment.startswith(EXTENSION):
            part = segment[len(EXTENSION) :]  # GUID (32 bytes), whole length and place (4 each), text
            chunks.setdefault(part[:32], {})[int.from_bytes(part[36:40], "big")] = part[40:]
    for parts in chunks.values():
        yield b"".join(parts[place] for place in sorted(parts))


def _roots(data: bytes) -> Iterator[ElementTree.Element]:
    """Of each packet in a file; not of those that are damaged, or declare entities, which XMP has no use for."""
    for packet in _jpeg_packets(data) if data.startswith(JPEG_BEGINS) else PACKET.findall(data):
        begin, end = packet.find(b"<x:xmpmeta"), packet.rfind(b">")
        if b"<!" not in packet and begin >= 0:
            with suppress(ElementTree.ParseError):
                yield ElementTree.fromstring(packet[begin : packet.find(b"</x:xmpmeta>", begin) + 12 or end + 1])


def _properties(elements: Iterable[ElementTree.Element]) -> dict[str, list[str]]:
    """`{namespace}name` -> values: attributes, texts of elements, and the entries of rdf:Seq, rdf:Bag and rdf:Alt in them."""
    found: dict[str, list[str]] = {}
    for element in elements:
        for name, value in element.attrib.items():
            found.setdefault(name, []).append(value.strip())
        if element.text and element.text.strip() and not element.tag.startswith(RDF):
            found.setdefault(element.tag, []).append(element.text.strip())
        for kind in ("Seq", "Bag", "Alt"):
            for entry in element.findall(f"{RDF}{kind}/{RDF}li"):
                if entry.text and entry.text.strip():
                    found.setdefault(element.tag, []).append(entry.text.strip())
    return found
