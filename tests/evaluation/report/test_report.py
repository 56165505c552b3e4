"""The report of made-up results (oracles: parsers of others, pictures' pixels, numbers by hand)."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from shutil import which

import made_up
import numpy as np
import pytest
from made_up import METHODS, made_up_dataset

from dlama.datasets.frames import Dataset
from dlama.evaluation.protocols.methods import Method, ProtocolSettings
from dlama.evaluation.protocols.strips import CELL, GAP, color_error, depth_error, heat_map
from dlama.evaluation.report import panels
from dlama.evaluation.report.panels import Chosen, as_data_urls, choose
from dlama.evaluation.report.sections import EXPLAINED, Section
from dlama.evaluation.report.summary import Summary
from dlama.evaluation.report.tables import Cell, Table
from dlama.evaluation.report.templates import PARTS
from dlama.evaluation.report.write import FILES, render, settings_hash, write_report
from dlama.evaluation.runner.run import Results, run
from dlama.geometry.figures.html import shrink

SETTINGS = ProtocolSettings()
VOID = {"meta", "link", "img", "input", "br", "hr", "path", "use", "rect", "wbr"}


def mixed(scenes: int) -> Dataset:
    """View changes of so many scenes, and one removal each."""
    views, removals = made_up_dataset(scenes), made_up_dataset(scenes, [None], "ori")
    return dataclasses.replace(views, cases=views.cases + removals.cases)


def evaluated(folder: Path, dataset: Dataset, methods: tuple[Method, ...] = METHODS) -> Results:
    """All of it run with the made-up protocol."""
    return run(dataset.cases, methods, {"vpi": made_up.protocol, "ori": made_up.protocol}, SETTINGS, folder)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished report."""
    folder, dataset = tmp_path_factory.mktemp("report"), mixed(2)
    write_report(folder, dataset, evaluated(folder, dataset), SETTINGS, command="dlama evaluate toy -o out")
    return folder


class Outline(HTMLParser):
    """Tags opened and closed, what would be loaded, ids and links inside the page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Remember it."""
        known = dict(attrs)
        self.tags.append(tag)
        self.ids += [str(known["id"])] if "id" in known else []
        self.loads += [str(known[name]) for name in ("src", "srcset", "data", "action", "poster") if name in known]
        (self.links if tag in ("a", "use") else self.loads).extend(str(known[n]) for n in ("href",) if n in known)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Closes itself."""
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        """The innermost one must be it."""
        if tag not in VOID:
            assert self.open.pop() == tag


def test_the_page_is_well_formed_and_needs_nothing_else(report: Path) -> None:
    """Oracles: every tag closes in order, ids are unique, links lead somewhere, nothing is loaded but data: URLs;
    nothing lies next to it but the other files of a report."""
    assert set(FILES) | {"cases", "panels"} == {path.name for path in report.iterdir()}
    text = (report / "report.html").read_text("utf-8")
    outline = Outline(text)
    assert outline.open == []
    parts = {"panels", "all-panels", "runtime", "settings", "vpi-whole", "vpi-unseen", "vpi-more"}
    assert len(outline.ids) == len(set(outline.ids)) and set(outline.ids) == parts | {"ori-regions", "ori-more"}
    assert {link[1:] for link in outline.links} <= set(outline.ids) and all(
        link.startswith("#") for link in outline.links
    )
    assert outline.loads and all(one.startswith("data:image/jpeg;base64,") for one in outline.loads)
    assert not re.search(r"@import|https?://|url\((?!#)|src=\"(?!data:)", text)
    assert outline.tags.count("script") == 1


def test_pictures_come_first_and_abbreviations_are_explained(report: Path) -> None:
    """Oracles: the order of headings; each sentence stands before the first heading, in markdown before the first table."""
    text = (report / "report.html").read_text("utf-8")
    headings = re.findall(r"<h2>(.*?)</h2>", text)
    assert headings[0].startswith("Pictures") and headings[1] == "View change (VPI) on toy"
    assert text.index("<figure") < text.index("<table")
    before, summary = text[: text.index("<h2>")], (report / "summary.md").read_text("utf-8")
    for name in ("vpi", "ori"):
        assert EXPLAINED[name] in before and EXPLAINED[name] in summary[: summary.index("|")]
    assert EXPLAINED["sii"] not in text  # it did not run


def test_names_are_escaped() -> None:
    """Law: whatever a folder, a command or an error holds stands in the page as text."""
    bad = '<b onclick="x">&'
    table = Table(bad, (bad,), ((Cell(bad, interval=bad),),), bad)
    chosen = Chosen("vpi", bad, bad, "best", bad, bad, bad, 0.5, "")
    shown = [(chosen, "data:image/jpeg;base64,")]
    section = Section("a", bad, bad, (table, dataclasses.replace(table, minor=True)))
    summary = Summary({}, (), {"lead": bad, "settings_hash": bad, "command": bad, "x": {bad: bad}})
    text = render(bad, summary, [section], shown, [bad])["report.html"]
    assert "<b onclick" not in text and text.count("&lt;b onclick=") > 20


def test_narrow_tables_carry_their_headings(report: Path) -> None:
    """Law: every number of every table names its column, for screens on which the head is not shown."""
    text = (report / "report.html").read_text("utf-8")
    for table in re.findall(r"<table.*?</table>", text, re.DOTALL):
        heads = [re.sub(r"<.*?>", "", one) for one in re.findall(r"<th.*?</th>", table)]
        for line in re.findall(r"<tr><td.*?</tr>", table):
            fields = re.findall(r"<td(.*?)>", line)
            assert len(fields) == len(heads)
            for head, field in zip(heads, fields):
                named = re.search(r'data-head="(.*?)"', field)
                assert (named is None) == ("word" in field) and (named is None or named[1] == head)


def test_the_script_is_a_script() -> None:
    """Oracle: node's parser, where there is one."""
    if not which("node"):
        pytest.skip("node is not installed; it parses the page's script")
    assert subprocess.run(["node", "--check", str(PARTS / "script.js")], timeout=600).returncode == 0


def test_the_page_shows_the_numbers(report: Path) -> None:
    """Oracles: summary.json's own mean in a sortable cell; settings and paper next to it; panels for best and worst."""
    text = (report / "report.html").read_text("utf-8")
    content = json.loads((report / "summary.json").read_text("utf-8"))
    key = ["vpi", "toy", "±10", "dlama/layered", "whole", "rgb", "ssim"]
    mean = next(line[7] for line in content["means"] if line[:7] == key)
    assert f'data-value="{mean:.10g}">{mean:.4f}<small>' in text
    assert text.count(settings_hash(SETTINGS)) > text.count("<table") - 1
    assert "paper, other data" in text and "522.05" in text and "window" in text
    assert "best: dlama/telea, ±10° scene" in text and "worst: dlama/telea, ±10° scene" in text
    assert "View change (VPI) on toy" in text and "Object removal (ORI) on toy" in text


def test_markdown_has_the_tables(report: Path) -> None:
    """Oracle: every table has rows as wide as its head; hash next to each; all of the sections."""
    text = (report / "summary.md").read_text("utf-8")
    blocks = re.findall(r"(?:^\|.*\|\n)+", text, re.MULTILINE)
    assert len(blocks) >= 15
    for block in blocks:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}) == 1
    assert text.count(f"Settings `{settings_hash(SETTINGS)}`") == len(blocks)
    for expected in (
        "| ±60 |",
        "**Whole pictures**",
        "Hidden regions",
        "object,dilate=3",
        "Runtime and memory",
        "dlama evaluate toy",
    ):
        assert expected in text


@pytest.mark.slow
def test_the_same_results_give_the_same_report(tmp_path: Path) -> None:
    """Oracle: bytes, in two folders; runtimes left out by one fixed number of the protocol's own."""
    dataset = made_up_dataset(2, (10.0, 20.0))
    for name in "ab":
        done = evaluated(tmp_path / name, dataset, METHODS[:2])
        fixed = tuple(dataclasses.replace(one, timings=()) for one in done.stored)
        write_report(tmp_path / name, dataset, Results(fixed, (), 0), SETTINGS)
    for name in FILES:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_failures_are_listed(tmp_path: Path) -> None:
    """On the page, in markdown, and in the first line."""
    dataset = made_up_dataset(1, (10.0,))
    methods = (Method("dlama", "telea"), Method("paper", "bad"))
    write_report(tmp_path, dataset, evaluated(tmp_path, dataset, methods), SETTINGS)
    for name in ("report.html", "summary.md"):
        text = (tmp_path / name).read_text("utf-8")
        assert "vpi s0 +10, paper/bad: RuntimeError: no such luck with paper" in text
        assert "1 failed and count nowhere" in text


def test_best_median_and_worst_by_hand(tmp_path: Path) -> None:
    """Oracle: the unseen LPIPS of each frame, sorted here."""
    dataset = made_up_dataset(5, (10.0, -10.0))
    done = evaluated(tmp_path, dataset, (Method("dlama", "telea"),))
    scores = sorted(
        (row.value, row.scene, row.frame)
        for one in done.stored
        for row in one.rows
        if (row.region, row.modality, row.metric, row.recipe) == ("unseen", "rgb", "lpips", "dlama")
    )
    chosen = choose(done.stored)
    assert [one.rank for one in chosen] == ["best", "median", "worst"]
    assert [(one.score, one.scene, one.frame) for one in chosen] == [scores[0], scores[4], scores[-1]]
    assert {(one.yaw, one.ranked_by) for one in chosen} == {("±10", "unseen lpips")}


def test_panels_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the files' own bytes; and the length of all URLs against a small budget. Missing panels are left out."""
    done = evaluated(tmp_path, made_up_dataset(3, (10.0, 20.0)), METHODS[:2])
    chosen = choose(done.stored)
    free = as_data_urls(tmp_path / "panels", chosen)
    assert [one for one, _ in free] == chosen
    for one, url in free:
        assert base64.b64decode(url.partition(",")[2]) == (tmp_path / "panels" / one.file).read_bytes()
    monkeypatch.setattr(panels, "BUDGET", sum(len(url) for _, url in free) // 2)
    assert 0 < len(as_data_urls(tmp_path / "panels", chosen)) < len(free)
    monkeypatch.undo()
    (tmp_path / "panels" / chosen[0].file).unlink()
    shown = as_data_urls(tmp_path / "panels", chosen)
    assert [one for one, _ in shown] == [one for one in chosen if one.file != chosen[0].file]


def test_errors_in_panels_by_hand() -> None:
    """Colour: mean over channels of 64 levels is full. Depth: a quarter off is full, a tenth 0.4; far for near is full."""
    color = np.array([[[200, 9, 0], [90, 130, 9], [7, 7, 7]]], np.uint8)
    filled = np.array([[[104, 105, 96], [122, 98, 41], [7, 7, 7]]], np.uint8)
    assert color_error(filled, color)[0] == pytest.approx([1, 0.5, 0])
    depth, truth = (np.float32([row]) for row in ((2.2, 2.5, 3.0, np.inf, np.inf, 2), (2, 2, 2, 2, np.inf, 0)))
    assert depth_error(depth, truth)[0, :5] == pytest.approx([0.4, 1, 1, 1, 0]) and np.isnan(
        depth_error(depth, truth)[0, 5]
    )
    black, bright = heat_map(np.array([[0, 1]], np.float32))[0]
    assert black.max() < 10 and bright.min() > 150


def test_a_strip_is_two_rows_of_five() -> None:
    """Oracles: the input's own pixels at the top left, the truth's in the fourth column; large pictures shrink."""
    source = made_up.truth(0, 24).source.color
    sheet = made_up.panel(made_up.truth(0, 24), 50)
    assert sheet.shape == (2 * 24 + GAP, 5 * 24 + 4 * GAP, 3)
    assert (sheet[:24, :24] == source).all() and (sheet[:24, 3 * (24 + GAP) :][:, :24] == source).all()
    assert (sheet[24 : 24 + GAP] == 0).all()
    assert shrink(np.zeros((300, 600, 3), np.uint8), CELL).shape == (CELL // 2, CELL, 3)
