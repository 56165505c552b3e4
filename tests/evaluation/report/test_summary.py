"""Means, intervals and tables (oracles: numbers worked out by hand, closed forms of the bootstrap)."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dlama.evaluation.report.columns import (
    METRICS,
    MODALITIES,
    PAPER_COLOR,
    PAPER_DEPTH,
    PAPER_MASK_RATIO,
    PAPER_SHAPE,
    WHOLE,
    better_direction,
    column_title,
    format_value,
    paper_value,
)
from dlama.evaluation.report.paired_comparison import paired_comparison
from dlama.evaluation.report.sections import Section, sections
from dlama.evaluation.report.summary import (
    Key,
    Mean,
    Place,
    Summary,
    draws,
    summarise,
    write_summary,
    yaw_order,
)
from dlama.evaluation.report.tables import (
    by_yaw,
    runtimes,
    side_by_side,
    variant_of,
    variants,
)
from dlama.evaluation.report.write import headlines, render
from dlama.evaluation.runner.store import Row


def row(
    scene: str, yaw: float | None, value: float, metric: str = "mse", method: str = "dlama/telea", **other: str
) -> Row:
    """A row of results.csv."""
    recipe, filler = method.split("/")
    region, modality = other.get("region", "whole"), other.get("modality", "rgb")
    return Row(
        other.get("protocol", "vpi"), "toy", scene, f"{yaw}", yaw, recipe, filler, region, modality, metric, value
    )


def mean(summary: Summary, yaw: str, metric: str = "mse", method: str = "dlama/telea") -> Mean:
    """One mean of colour over the whole picture."""
    return summary.means[Key("vpi", "toy", yaw, method, "whole", "rgb", metric)]


def test_means_by_hand() -> None:
    """± over both signs, each sign by itself, all over everything; frames and scenes counted; nan does not count."""
    rows = [row("a", 10, 1), row("a", -10, 3), row("b", 10, 5), row("b", -10, 11), row("b", 20, 100)]
    found = summarise([*rows, row("c", 10, math.nan)])
    assert {key.yaw for key in found.means} == {"all", "±10", "+10", "-10", "±20", "+20"}
    assert mean(found, "±10")[0] == 5 and mean(found, "±10")[3:] == (4, 2)
    assert mean(found, "+10")[0] == 3 and mean(found, "-10")[0] == 7
    assert mean(found, "all")[0] == 24 and mean(found, "all").frames == 5
    assert found.values("yaw") == ["±10", "+10", "-10", "±20", "+20", "all"]


def test_pairs_are_binned_by_their_angle() -> None:
    """Real pairs about 10, 20 and 30 degrees apart."""
    found = summarise([row("a", 9.5, 1), row("a", 10.4, 3), row("a", 20.7, 5), row("a", 29.4, 7)])
    assert found.values("yaw") == ["≈10", "≈20", "≈30", "all"]
    assert mean(found, "≈10").value == 2


def test_one_scene_has_no_interval_and_equal_scenes_a_point() -> None:
    """Closed form: nothing to resample; all resamples alike."""
    assert mean(summarise([row("a", 10, 1), row("a", -10, 3)]), "all")[:3] == (2, None, None)
    alike = mean(summarise([row(scene, 10, 0.3) for scene in "abcd"]), "all")
    assert alike[:3] == pytest.approx((0.3, 0.3, 0.3))


def test_a_scene_counts_by_its_frames() -> None:
    """Closed form: three frames of 0 and one of 4; resamples are aa (0), ab (1), bb (4)."""
    found = mean(summarise([row("a", yaw, 0) for yaw in (1, 2, 3)] + [row("b", 1, 4)]), "all")
    assert found[:3] == (1, 0, 4)


def test_interval_of_many_scenes_is_the_normal_one() -> None:
    """Closed form: the bootstrap's standard error is the deviation (divided by n) over the root of n."""
    values = np.random.default_rng(1).normal(10, 2, 400)
    found = mean(summarise([row(f"s{n}", 10, value) for n, value in enumerate(values)]), "all")
    half = 1.96 * values.std() / 20
    assert found.low is not None and found.high is not None
    assert (found.value - found.low, found.high - found.value) == pytest.approx((half, half), rel=0.12)


def test_infinite_values_have_no_interval() -> None:
    """The PSNR of equal pictures."""
    assert mean(summarise([row("a", 10, math.inf, "psnr"), row("b", 10, 30, "psnr")]), "all", "psnr")[:3] == (
        math.inf,
        None,
        None,
    )


def test_variants_come_last_and_are_named() -> None:
    """`dlama+mask+3/telea` is a variant of dlama/telea."""
    names = ("dlama+object,dilate=0", "dlama", "paper")
    found = summarise([row("a", 10, 1, method=f"{name}/telea") for name in names])
    assert found.methods == ("dlama/telea", "paper/telea", "dlama+object,dilate=0/telea")
    assert variant_of("dlama+mask+3/telea") == ("dlama/telea", "mask+3")
    assert variant_of("dlama/layered-patches") == ("dlama/layered-patches", "")
    table = variants(Place(found, "vpi", "toy"), PAPER_SHAPE, "Variants")
    assert table and [tuple(cell.text for cell in line) for line in table.rows] == [
        ("dlama/telea", "as named", "1.00"),
        ("dlama/telea", "object,dilate=0", "1.00"),
        ("paper/telea", "as named", "1.00"),
    ]


def test_summary_file(tmp_path: Path) -> None:
    """Oracle: json reads what was meant; the same rows give the same bytes."""
    rows = [row("a", 10, 1 / 3), row("b", 10, 2 / 3), row("a", 10, math.inf, "psnr")]
    for name in ("a.json", "b.json"):
        write_summary(tmp_path / name, summarise(rows, about={"settings_hash": "abc", "settings": {"x": [1]}}))
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["settings_hash"] == "abc" and content["settings"] == {"x": [1]}
    lines = [dict(zip(content["columns"], line)) for line in content["means"]]
    whole = {
        "protocol": "vpi",
        "dataset": "toy",
        "yaw": "all",
        "method": "dlama/telea",
        "region": "whole",
        "modality": "rgb",
    }
    numbers = {"metric": "mse", "mean": 0.5, "low": 0.3333333333, "high": 0.6666666667, "frames": 2, "scenes": 2}
    assert lines[0] == whole | numbers
    assert lines[-1]["mean"] == "inf"
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def paper_rows() -> list[Row]:
    """Two methods, two yaws, two scenes; telea is better in mse and worse in ssim."""
    return [
        row(scene, yaw, value * factor, metric, method, modality=modality)
        for scene, factor in (("a", 1.0), ("b", 1.1))
        for yaw in (10.0, -10.0, 20.0, -20.0)
        for method, good in (("dlama/telea", 0), ("dlama/layered", 1))
        for modality in ("rgb", "depth")
        for metric, value in {"mse": 300 + 50 * good, "ssim": 0.5 + 0.1 * good, "lpips": 0.2}.items()
    ] + [row("a", 10, 33.333, "mask_ratio")]


def written(summary: Summary, section: Section) -> list[str]:
    """The lines of the section's tables in summary.md."""
    about = {"lead": "", "settings_hash": "abc", "command": ""}
    text = render("toy", replace(summary, about=about), [section], [])["summary.md"]
    return [line for line in text.splitlines() if line.startswith("|")]


def test_side_by_side_marks_the_best() -> None:
    """By hand: alike is nobody's win; what was not measured has no row."""
    found, both = summarise(paper_rows()), ("dlama/telea", "dlama/layered")
    lpips = side_by_side(Place(found, "vpi", "toy"), [("whole", "rgb", "lpips"), ("mask", "rgb", "ssim")], both, "All")
    assert lpips and [cell.text for cell in lpips.rows[0]] == ["whole", "colour LPIPS", "0.2100", "0.2100"]
    assert len(lpips.rows) == 1 and not any(cell.best for cell in lpips.rows[0])


def test_a_paired_comparison_by_hand() -> None:
    """Ours 10 % and 50 % less MSE in two scenes of 100 and 300: 40 % less of the mean; cases of one recipe only do not count."""
    ours, theirs = {"a": 90.0, "b": 150.0, "c": 1.0}, {"a": 100.0, "b": 300.0}
    rows = [row(scene, 10, value, method="dlama/telea") for scene, value in ours.items()]
    rows += [row(scene, 10, value, method="paper/telea") for scene, value in theirs.items()]
    rows += [row("a", 10, 5.0, method=f"{name}/none") for name in ("dlama", "paper")]
    table = paired_comparison(rows, "vpi", "toy", [("whole", "rgb", "mse"), ("whole", "rgb", "lpips")])
    assert table and table.head == ("filler", "yaw", "colour MSE")
    assert [line[1].text for line in table.rows] == ["±10"]  # of one yaw `all` would be the same
    further = [one._replace(yaw=20.0, frame="20") for one in rows]
    both = paired_comparison([*rows, *further], "vpi", "toy", [("whole", "rgb", "mse")])
    assert both and [line[1].text for line in both.rows] == ["±10", "±20", "all"]
    cell = table.rows[0][2]
    assert (cell.text, cell.best, cell.interval) == ("-40.0 % (2/2)", True, "-50.0 to -10.0")
    worse = [one._replace(value=-one.value) if one.method == "paper/telea" else one for one in rows]
    lost = paired_comparison(worse, "vpi", "toy", [("whole", "rgb", "mse")])
    assert lost and lost.rows[0][2].text == "–"
    equal = [row("a", 10, 7.0, method=f"{name}/telea") for name in ("dlama", "paper")]
    tied = paired_comparison(equal, "vpi", "toy", [("whole", "rgb", "mse")])
    assert tied and tied.rows[0][2].text == "the same" and not tied.rows[0][2].best
    swapped = [one._replace(recipe={"dlama": "paper", "paper": "dlama"}[one.recipe]) for one in rows]
    beaten = paired_comparison(swapped, "vpi", "toy", [("whole", "rgb", "mse")])
    assert beaten and beaten.rows[0][2].text == "+66.7 % (0/2)" and not beaten.rows[0][2].best
    assert paired_comparison([one for one in rows if one.recipe == "dlama"], "vpi", "toy", PAPER_SHAPE) is None


def test_a_comparison_of_psnr_is_in_decibels() -> None:
    """Closed form: 1 and 3 dB more in two scenes, of 20 and 30 dB: 2 dB more; 10 % of a logarithm would say nothing."""
    values = {"dlama": {"a": 21.0, "b": 33.0}, "paper": {"a": 20.0, "b": 30.0}}
    rows = [
        row(scene, 10, value, method=f"{recipe}/telea")._replace(metric="psnr")
        for recipe, own in values.items()
        for scene, value in own.items()
    ]
    table = paired_comparison(rows, "vpi", "toy", [("whole", "rgb", "psnr")])
    assert table is not None
    cell = table.rows[0][2]
    assert (cell.text, cell.best, cell.interval) == ("+2.00 dB (2/2)", True, "+1.00 to +3.00")


def test_no_two_measures_have_one_title() -> None:
    """Whatever is measured of one region in several modalities can be distinguished; names of code are in no title."""
    metrics = {*METRICS, "law_broken", "law_violations", "coverage", "delta1.05", "fscore_0.05", "bad-1"}
    pairs = {(modality, metric) for modality in MODALITIES for metric in metrics} - {("depth_m", "mask_ratio")}
    titles = [column_title("whole", *pair) for pair in pairs]
    assert len(set(titles)) == len(titles) and not any("_" in title for title in titles)


def test_headlines_have_the_main_numbers() -> None:
    """By hand: a line a method; the mask where something was removed, variants left out."""
    rows = [row("a", 10, 5.25), row("b", 10, 7.25), row("a", 10, 9.0)._replace(recipe="dlama+object,dilate=3")]
    assert headlines(summarise(rows)) == ["vpi on toy, dlama/telea, whole (2 frames): colour MSE 6.25"]
    more = [row("a", 10, 2.5, "psnr"), row("a", 10, 0.5, "mae", modality="depth_m")]
    assert headlines(summarise(more))[0].endswith("(1 frame): colour PSNR 2.50 dB, depth MAE 0.5000 m")
    assert headlines(summarise([one._replace(filler="none") for one in more]))[0].endswith("colour PSNR 2.50 dB")
    removed = [one._replace(protocol="ori", region=region) for one in rows for region in ("whole", "mask")]
    assert headlines(summarise(removed)) == ["ori on toy, dlama/telea, mask (2 frames): colour MSE 6.25"]


def test_intervals_of_a_comparison_are_drawn_with_the_seed() -> None:
    """Oracle: the resamples of each seed, worked out here: the ratio of the drawn sums, its percentiles."""
    values = np.random.default_rng(5).uniform(50, 150, (2, 9))
    rows = [
        row(f"s{scene}", 10, float(values[number, scene]), method=f"{recipe}/telea")
        for number, recipe in enumerate(("dlama", "paper"))
        for scene in range(9)
    ]
    found = []
    for seed in (0, 1):
        table = paired_comparison(rows, "vpi", "toy", [("whole", "rgb", "mse")], seed)
        times = draws(9, seed)
        low, high = np.percentile(times @ values[0] / (times @ values[1]), (2.5, 97.5))
        assert table and table.rows[0][2].interval == f"{100 * (low - 1):+.1f} to {100 * (high - 1):+.1f}"
        found.append(table.rows[0][2].interval)
        own = [one for one in sections(summarise(rows, seed=seed), rows, [], seed)[0].tables if one.head[0] == "filler"]
        assert own[0].rows[0][2].interval == found[-1]
    assert found[0] != found[1]


def test_a_row_a_yaw_and_method() -> None:
    """By hand: less MSE is better, more SSIM is; the paper's seven columns, its own row in italics below; none for one sign."""
    found, both = summarise(paper_rows()), ["dlama/telea", "dlama/layered"]
    table = by_yaw(Place(found, "vpi", "toy"), WHOLE, both, ["±10", "+10"], "Whole pictures")
    assert table and table.head[:4] == ("yaw", "method", "mask ratio, %", "colour SSIM") and len(table.head) == 9
    assert [cell.text for cell in table.rows[0][:4]] == ["±10", "dlama/telea", "33.33", "0.5250"]
    assert [cell.best for cell in table.rows[1]] == [False, False, False, True, False, False, True, False, False]
    assert [line[0].text for line in table.rows] == ["±10", "±10", "±10", "+10", "+10"]
    lines = written(found, Section("a", "a", "", (table,)))
    assert lines[2].startswith(
        "| ±10 | dlama/telea | 33.33 | 0.5250 (0.5000 to 0.5500) | 0.2100 (0.2000 to 0.2200) | **315.00**"
    )
    assert lines[4].startswith("| *±10* | *paper, other data* | *27.19* | *0.7617* | *0.1859* | *522.05* | *0.9016* |")
    rows = [one for one in paper_rows() if one.yaw in (10.0, -10.0)]
    whole = sections(summarise(rows), rows, [])[0]
    assert [one.title for one in whole.tables] == ["Whole pictures", "Whole pictures, each sign by itself"]


def test_runtimes_by_hand() -> None:
    """Median and longest seconds, largest memory."""
    rows = [row("a", yaw, value, "seconds", modality="time") for yaw, value in ((1, 1), (2, 2), (3, 9))]
    rows += [row("a", 1, 500, "peak_mib", modality="memory"), row("a", 2, 700, "peak_mib", modality="memory")]
    table = runtimes(rows, ["dlama/telea", "dlama/layered"])
    assert table and [cell.text for cell in table.rows[0]] == ["vpi", "dlama/telea", "2.00", "9.00", "2.00", "700"]
    assert len(table.rows) == 1


def test_the_papers_numbers_are_its_own(data_dir: Path) -> None:
    """Oracle: the text of the paper, tables 1 and 2, read again here."""
    text = (data_dir / "PAPER.md").read_text()
    for marker, table in (("Table 1", PAPER_COLOR), ("Table 2", PAPER_DEPTH)):
        before = text[: text.index(f"{marker}:")].rstrip().splitlines()[-6:]
        for line in before:
            yaw, ratio, ssim, lpips, mse = line.split()
            assert PAPER_MASK_RATIO[yaw] == float(ratio)
            assert [table[name][yaw] for name in ("ssim", "lpips", "mse")] == [float(ssim), float(lpips), float(mse)]
    assert paper_value("±10", "whole", "rgb", "mse") == 522.05
    assert paper_value("±10", "unseen", "rgb", "mse") is None and paper_value("+10", "whole", "rgb", "mse") is None


def test_names_and_sides() -> None:
    """Which side is good, as the metrics' definitions say."""
    for metric in ("ssim", "psnr", "delta1.05", "fscore_0.02", "coverage"):
        assert better_direction(metric) == 1, metric
    for metric in ("lpips", "mse", "absrel", "accuracy", "bad-1", "epe", "leaks", "law_broken", "edge_offset"):
        assert better_direction(metric) == -1, metric
    assert better_direction("mask_ratio") == better_direction("share") == 0
    titles = [column_title("whole", modality, "mae") for modality in ("depth_m", "depth")]
    assert titles == ["depth MAE, m", "depth (8 bit) MAE"]
    shown = ((math.inf, "psnr", "∞"), (0.12345, "ssim", "0.1235"), (12.345, "mse", "12.35"))
    assert all(format_value(value, metric) == text for value, metric, text in shown)
    assert sorted(["all", "-10", "±20", "±10", "+10"], key=yaw_order) == ["±10", "+10", "-10", "±20", "all"]
