"""The page about a batch (oracles: counts by hand, a frequency of chance, the page's own text)."""

from __future__ import annotations

import base64
import io
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from PIL import Image
from small_jobs import FAST, view_rows, write_csv

from box_frame import small_frame
from dlama.errors import FileError
from dlama.jobs.batch import batch
from dlama.jobs.report import BARS, SHOWN, summarise, throughput, without_names, write_report
from dlama.jobs.results.result import JobResult


def made_up(count: int) -> list[JobResult]:
    """Results with rising holes and moves; every tenth failed."""
    rows = []
    for n in range(count):
        about = {"finished": 1000.0 + n, "host": f"h{n % 2}"}
        if n % 10 == 9:
            rows.append(JobResult(f"j{n}", "failed", "view", "FileError", f"/data/{n}.png: no such file", **about))  # type: ignore[arg-type]
        else:
            rows.append(JobResult(f"j{n}", "done", "view", hole_share=n / count, law_moves=n % 7, **about))  # type: ignore[arg-type]
    return rows


def test_failures_of_one_cause_are_one_group() -> None:
    """By hand: names of files and numbers differ, the cause does not; three examples are kept."""
    found = summarise(made_up(100))
    (group,) = found.groups.values()
    assert (found.done, found.failed, group.count, group.kind) == (90, 10, 10, "FileError")
    assert group.message == "FILE: no such file"
    assert [row.id for row in group.examples] == ["j9", "j19", "j29"]
    assert found.hosts == {"h0": 50, "h1": 50}
    line = "/a/b.png is 640x480 and s3://x/c.png 64x48; both must"
    assert without_names(line) == "FILE is NxN and FILE NxN; both must"


def test_the_worst_are_the_worst() -> None:
    """Oracle: sorting all of them."""
    rows = made_up(100)
    done = [row for row in rows if row.status == "done"]
    found = summarise(rows)
    by_holes = sorted(done, key=lambda row: (row.hole_share, row.id), reverse=True)
    assert found.largest_holes == by_holes[:SHOWN]
    by_moves = sorted(done, key=lambda row: (row.law_moves, row.id), reverse=True)
    assert found.most_moves == by_moves[:SHOWN]
    assert found.law_moves == sum(row.law_moves for row in done)


def test_random_ones_are_random() -> None:
    """Frequency: over 400 seeds each of 48 results is drawn in 12 of 48 cases, within 5 standard deviations."""
    rows = [JobResult(f"j{n}", "done") for n in range(48)]
    counts = Counter(row.id for seed in range(400) for row in summarise(rows, seed).at_random)
    assert len(counts) == 48
    assert all(abs(count - 100) < 5 * (400 * 0.25 * 0.75) ** 0.5 for count in counts.values())


def test_throughput_counts_every_result_once() -> None:
    """Law: the bars' sum is the number of results, for a run of any length; a pause has bars of 0."""
    for gap in (1, 3, 60, 4000):
        finished = {1_700_000_000 + n * gap: 2 for n in range(10)} | {1_700_000_000 + 100 * gap: 1}
        width, bars = throughput(finished)
        assert sum(count for _, count in bars) == 21 and len(bars) <= BARS + 1
        assert 0 in [count for _, count in bars]
        assert all(later - sooner == width for (sooner, _), (later, _) in pairwise(bars))
    assert throughput({}) == (1, [])


@pytest.mark.usefixtures("in_this_process")
def test_the_page_has_pictures_and_failures(tmp_path: Path) -> None:
    """Pictures are results' own, errors are escaped, nothing is loaded from elsewhere."""
    pytest.importorskip("jinja2")
    small_frame(tmp_path)
    rows = [*view_rows(3), {**view_rows(1)[0], "id": "bad", "image": "<b>.png"}]
    list(batch(write_csv(tmp_path / "jobs.csv", rows), tmp_path / "out", workers=1, **FAST))
    text = Path(write_report(tmp_path / "out")).read_text(encoding="utf-8")
    assert "1 × FileError" in text and "&lt;b&gt;.png: no such file" in text and "<b>.png" not in text
    assert not re.search(r"(src|href)=\"(?!data:|v/)", text)
    pictures = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', text)
    assert len(pictures) >= 3
    with Image.open(io.BytesIO(base64.b64decode(pictures[0]))) as picture:
        assert picture.size == (64, 48)
    with pytest.raises(FileError, match="holds no results of `dlama batch`"):
        write_report(tmp_path)


def test_an_address_without_results_is_refused() -> None:
    """As a folder without them is, and nothing is written there (oracle: the store)."""
    memory = pytest.importorskip("fsspec").filesystem("memory")
    with pytest.raises(FileError, match=r"^memory://lost/out: holds no results of `dlama batch`"):
        write_report("memory://lost/out")
    assert not memory.exists("/lost")
