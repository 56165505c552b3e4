"""What README and docs say is so (oracles: their own code, the files they name, the command line's parser)."""

from __future__ import annotations

import functools
import re
import shlex
from pathlib import Path

import pytest

from dlama.apps.cli import EXAMPLES, VERBS, main
from dlama.apps.terminal.flags import flags_of

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
GENERATED = {"cli.md"}
"""Pages of the site that are made when it is built."""
NOTES = sorted((ROOT / "src").rglob("*.md"))
"""Of what ships."""
FIGURE = ROOT / "docs" / "images" / "method.svg"
ROOMS = {path.name for path in (ROOT / "src" / "dlama").iterdir() if path.is_dir()}


def blocks(language: str, page: str = "README.md") -> list[str]:
    """The fenced blocks of one language in a page."""
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text("utf-8"), re.DOTALL)


@pytest.mark.slow
def test_python_lines_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The six lines, as they stand, from an empty folder (oracle: what they write)."""
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 6
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), space)
    assert (tmp_path / "out" / "meta.json").is_file()
    assert (tmp_path / "out" / "scene.glb").is_file()
    (comment,) = re.findall(r"# or (.*)", code)
    assert [eval(word, space) is None for word in re.findall(r"done[.\w]+", comment)] == [False] * 5


def test_first_commands() -> None:
    """README begins with the demo, CONTRIBUTING with the tests."""
    assert [block.strip() for block in blocks("sh")] == ["pip install . && dlama demo"]
    install, run = blocks("sh", "CONTRIBUTING.md")[0].splitlines()[:2]
    assert install == "pip install torch==2.13.0 && pip install -e '.[test,lint]'"
    assert run.startswith("python -m pytest")


def commands(page: Path) -> list[str]:
    """The lines of its sh and console blocks that begin with dlama, those after && too, without their comments."""
    fenced = re.findall(r"^```(?:sh|console)\n(.*?)^```", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    parts = [part.split(" #")[0].strip() for block in fenced for part in re.split(r"\n|&&", block)]
    return [part for part in parts if part.startswith("dlama ")]


SHOWN = sorted({line for page in PAGES for line in commands(page)})
HELPED = [line for lines in EXAMPLES.values() for line in lines]


READING = ("view", "remove", "stereo")
"""Verbs that begin with a file that is not there."""


@pytest.mark.parametrize("line", [*SHOWN, *HELPED])
def test_shown_commands_are_understood(
    line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every command in README, docs and --help gets past the parser: it then misses its files, or, where it would start a long
    run or fetch something, does nothing because its verb does nothing here."""
    words = shlex.split(line)[1:]
    assert words[0] in VERBS
    if words[0] not in READING:
        called: list[str] = []
        verb = VERBS[words[0]]
        monkeypatch.setitem(VERBS, words[0], functools.wraps(verb)(lambda *_, **__: called.append(words[0])))
        main(words)
        assert called == words[:1]
        return
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == 2
    assert re.search("no such file|`dlama models pull", capsys.readouterr().err)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_options_named_in_sentences_exist(page: Path) -> None:
    """`dlama VERB ... --option` in a sentence (without files): the verb has that option; `--option`: some verb has it."""
    text = page.read_text("utf-8")
    known = {verb: {*flags_of(taker).values(), "--help"} for verb, taker in VERBS.items()}
    spans = [span.split() for span in re.findall(r"`dlama ([^`]+)`", text)]
    named = [(words[0], flag) for words in spans for flag in words if words[0] in VERBS and re.match(r"--[a-z]", flag)]
    assert [(verb, flag) for verb, flag in named if flag not in known[verb]] == []
    if page.name not in ("benchmarks.md", "CONTRIBUTING.md"):  # these name options of scripts
        assert set(re.findall(r"`(--[a-z][a-z0-9-]+)", text)) <= set().union(*known.values())


@pytest.mark.parametrize("page", [*PAGES, *NOTES], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_named_files_exist(page: Path) -> None:
    """Links, and paths that begin with a folder of the repository, lead somewhere."""
    text = page.read_text("utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    missing = [link for link in links if not (page.parent / link).exists() and Path(link).name not in GENERATED]
    paths = re.findall(r"(?<![\w/.])((?:src|tests|benchmarks|examples|docs)/[\w/.-]+\.\w+)", text)
    assert missing + [path for path in paths if "NAME" not in path and not (ROOT / path).exists()] == []
    parts = [link for link in re.findall(r"\]\(([^)]+#[^)]+)\)", text) if "://" not in link]
    for file, anchor in (link.split("#") for link in parts):
        headings = re.findall(r"^#+ (.*)$", (page.parent / file).read_text("utf-8"), re.MULTILINE)
        missing += [] if anchor in [heading.lower().replace(" ", "-") for heading in headings] else [f"{file}#{anchor}"]
    assert missing == []


def test_the_map_of_the_package_leads_somewhere() -> None:
    """Files and folders of CONTRIBUTING.md's tables are there, seen from src/dlama."""
    rows = [line for line in (ROOT / "CONTRIBUTING.md").read_text("utf-8").splitlines() if line.startswith("|")]
    named = [path for row in rows for path in re.findall(r"`([\w/]+(?:\.\w+|/))`", row)]
    assert len(named) > 40
    assert [path for path in named if not (ROOT / "src" / "dlama" / path).exists() and path != "meta.json"] == []


def test_figure_names_files_that_exist() -> None:
    """The monospaced words of method.svg are files of the package; a folder above a file is its folder."""
    words = [word.strip(" …") for word in re.findall(r">([\w/]+(?:\.py|/)[ …]*)<", FIGURE.read_text("utf-8"))]
    names, folder = [], ""
    for word in words:
        if word.endswith("/"):
            folder = word
        else:
            names.append(word if word.split("/")[0] in ROOMS else folder + word)
    assert len(names) >= 10
    assert [name for name in names if not (ROOT / "src" / "dlama" / name).is_file()] == []


def test_codes_in_conventions_are_those_of_the_code() -> None:
    """The tables of hole types and origins (oracle: the enums)."""
    from dlama.geometry.codes import HoleType, Origin

    text = (ROOT / "docs" / "concepts" / "conventions.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d) \| (\w+) \|", text, re.MULTILINE)
    expected = [(str(int(code)), code.name.lower()) for kind in (HoleType, Origin) for code in kind]
    assert rows == expected


def test_the_conda_recipe_has_the_versions_of_the_package() -> None:
    """Oracle: pyproject.toml; three packages have another name there."""
    names = {"opencv-python-headless": "py-opencv", "openexr": "openexr-python", "python": "python"}
    project = (ROOT / "pyproject.toml").read_text("utf-8").partition("[project.optional")[0]
    core = re.findall(r"""^    ["']([\w-]+)>=([\d.]+)""", project.partition("dependencies = [")[2], re.MULTILINE)
    recipe = (ROOT / "conda" / "meta.yaml").read_text("utf-8").partition("  run:")[2].partition("test:")[0]
    found = set(re.findall(r"- ([\w-]+) >=([\d.]+)", recipe))
    assert found == {(names.get(name.lower(), name), version) for name, version in core} | {("python", "3.10")}
    assert len(core) > 10
