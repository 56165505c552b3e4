"""What the site says runs, leads somewhere and is written plainly (oracles: the code, the files, HOUSE's table of words)."""

from __future__ import annotations

import io
import json
import re
import shlex
import shutil
import tokenize
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

import dlama
from dlama.apps.cli import main

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
RUN = [
    DOCS / "index.md",
    DOCS / "coming_from.md",
    *sorted((DOCS / "guides").glob("*.md")),
    DOCS / "concepts" / "confidence.md",
]
"""Pages whose blocks `sh` and `python` run, in their order; `console` is for what needs a network, a cluster or own files."""
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```", re.DOTALL | re.MULTILINE)
PICTURE = re.compile(r"!\[[^\]]+\]\([^)]+\)")
WORDS = (
    r"things?",
    r"take[ns]? out|taking out|took out",
    r"(?:is|are|was|were) wanted",
    r"go(?:es|ing)? on|went on",
    r"led in",
    r"lent",
    r"hedged|hedging",
    r"leans?|foot",
    r"sure|surest",
    r"whoever|whatever",
    r"beside",
    r"told|said",
    r"says nothing to|what the sky explains|pictures decided|what is to go",
)
"""Of the house's table: each has a plainer word."""
PLAIN = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "SECURITY.md", ROOT / "SUPPORT.md", *PAGES]
ROOMS = sorted(place for place in (ROOT / "src" / "dlama").iterdir() if place.is_dir() or place.suffix == ".py")
"""Their names, comments, docstrings and texts keep to the same words."""
LONGEST_MEAN = 25
"""Words of a sentence, mean over a page."""
WORDS_BY_HAND = 20_000


SMALLER = {"batch", "coming_from", "frames", "photo3d", "stereo", "view"}
"""Pages whose blocks name no pixel: their pictures have a quarter of the size."""


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory: a copy of what `dlama demo` puts into inputs/."""
    for name in ("street.jpg", "depth.png", "mask.png", "camera.json", "right.jpg", "calib.txt"):
        shutil.copyfile(dlama.example() / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shrink_pictures(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All pictures of the working directory, which is the example of the package, too; with their cameras."""
    for name in ("street.jpg", "depth.png", "mask.png", "right.jpg"):
        picture = cv2.imread(str(folder / name), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(folder / name), picture[::4, ::4])
    camera = json.loads((folder / "camera.json").read_text("utf-8"))
    camera |= {name: camera[name] / 4 for name in ("fx", "fy", "cx", "cy")} | {"width": 128, "height": 128}
    (folder / "camera.json").write_text(json.dumps(camera), "utf-8")
    calib = (folder / "calib.txt").read_text("utf-8")
    for name, smaller in (("256", "64"), ("255.5", "63.5"), ("512", "128"), ("ndisp=64", "ndisp=16")):
        calib = calib.replace(name, smaller)
    (folder / "calib.txt").write_text(calib, "utf-8")
    monkeypatch.setattr(dlama, "example", lambda: folder)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("page", RUN, ids=lambda path: path.stem)
def test_blocks_of_a_guide_run(page: Path, inputs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands and Python as they stand, top to bottom; each command with -o leaves something there."""
    if page.stem in SMALLER:
        shrink_pictures(inputs, monkeypatch)
    space: dict[str, object] = {"__name__": "guide"}
    for language, code in BLOCK.findall(page.read_text("utf-8")):
        if language == "python":
            exec(compile(code, str(page), "exec"), space)
            continue
        for line in code.splitlines():
            words = shlex.split(line)
            assert words[0] == "dlama", line
            try:
                main(words[1:])
            except SystemExit as stop:
                assert not stop.code, line
            if "-o" in words:
                assert (inputs / words[words.index("-o") + 1]).exists(), line


@pytest.mark.parametrize("page", sorted((DOCS / "guides").glob("*.md")), ids=lambda path: path.stem)
def test_a_guide_begins_with_a_picture_and_a_command(page: Path) -> None:
    """Title, picture, then a fenced block within the first thirty lines."""
    lines = page.read_text("utf-8").splitlines()
    assert lines[0].startswith("# ") and PICTURE.match(lines[2])
    assert any(line.startswith("```") for line in lines[:30])


def prose(text: str) -> str:
    """A page without code, tables' rules, links' targets and pictures."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"`[^`\n]*`", "CODE", text)
    return re.sub(r"\]\([^)]*\)", "]", text)


def sentences(text: str) -> Iterator[str]:
    """Of paragraphs and lists; not of headings and tables."""
    lines = [line for line in prose(text).splitlines() if not line.startswith(("#", "|", "!", ":::"))]
    for paragraph in re.split(r"\n\s*\n|\n(?=- |\d\. )", "\n".join(lines)):
        yield from (one for one in re.split(r"(?<=[.:;?!])\s+", paragraph.strip()) if len(one.split()) > 2)


@pytest.mark.parametrize("page", PLAIN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_words_that_have_a_plainer_one_are_avoided(page: Path) -> None:
    found = re.findall(rf"\b(?:{'|'.join(WORDS)})\b", prose(page.read_text("utf-8")), re.IGNORECASE)
    assert found == []


def texts_of_code(source: str) -> Iterator[str]:
    """Names, comments and strings of a Python file; `_` and line breaks as blanks."""
    kinds = (tokenize.NAME, tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING))
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in kinds:
            yield re.sub(r"[_\s#]+", " ", token.string)


@pytest.mark.parametrize("room", ROOMS, ids=lambda path: path.stem)
def test_code_keeps_to_the_same_words(room: Path) -> None:
    files = [room] if room.is_file() else sorted(room.rglob("*.py"))
    found = {
        (file.name, word)
        for file in files
        for text in texts_of_code(file.read_text("utf-8"))
        for word in re.findall(rf"\b(?:{'|'.join(WORDS)})\b", text, re.IGNORECASE)
    }
    assert found == set()


@pytest.mark.parametrize("page", PLAIN, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_sentences_are_short(page: Path) -> None:
    lengths = [len(sentence.split()) for sentence in sentences(page.read_text("utf-8"))]
    assert not lengths or sum(lengths) / len(lengths) < LONGEST_MEAN


def test_the_list_of_words_can_fail() -> None:
    assert re.findall(rf"\b(?:{'|'.join(WORDS)})\b", prose("The thing is told, `thing`."), re.IGNORECASE) == [
        "thing",
        "told",
    ]
    assert list(texts_of_code("# a\n#  b\nx_thing = 'c'")) == [" a", " b", "x thing", "'c'"]


def test_the_site_is_short() -> None:
    assert sum(len(page.read_text("utf-8").split()) for page in PAGES) <= WORDS_BY_HAND


def test_every_public_name_has_its_reference() -> None:
    """reference/python.md lists dlama.__all__, each name once."""
    listed = re.findall(r"^::: dlama\.(\w+)$", (DOCS / "reference" / "python.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(dlama.__all__)


def test_code_and_docs_point_to_pages_that_exist() -> None:
    """`docs/...` in any text file of the repository, and every path in the site's navigation."""
    files = [
        path for folder in ("src", "tests", "benchmarks", "examples", ".ci") for path in (ROOT / folder).rglob("*")
    ]
    texts = [
        path for path in [*files, *ROOT.glob("*.md")] if path.suffix in (".py", ".md", ".js", ".html", ".json", "")
    ]
    named = {
        (path.relative_to(ROOT).as_posix(), link)
        for path in texts
        if path.is_file()
        for link in re.findall(r"(?<![\w/.-])docs/[\w/.-]+\.(?:md|jpg|svg)", path.read_text("utf-8", "ignore"))
    }
    menu = re.findall(r": ([\w/]+\.md)$", (ROOT / "mkdocs.yml").read_text("utf-8"), re.MULTILINE)
    assert len(named) > 20 and len(menu) == len(PAGES) + 1  # the command line's page is generated
    assert [(file, link) for file, link in named if not (ROOT / link).exists() and "NAME" not in link] == []
    assert [page for page in menu if page != "reference/cli.md" and not (DOCS / page).exists()] == []
