"""Every option of every verb reaches what it is for: words in; the keyword that arrives in the library out.

Oracle: `options_table`, written by hand; a verb's signature says which options it must name. What each keyword does to a
result is the matter of the tests of the functions that take it.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from options_table import BASE, TABLE, commands

import dlama
import dlama.jobs.verbs
from dlama.apps.cli import main
from dlama.datasets.frames import Case, Dataset
from verb_options import fields_of

CASES = (
    Case("vpi", "toy", "room", "one", lambda: None, 10.0),  # type: ignore[arg-type,return-value]
    Case("vpi", "toy", "room", "two", lambda: None, 20.0),  # type: ignore[arg-type,return-value]
    Case("ori", "toy", "hall", "one", lambda: None),  # type: ignore[arg-type,return-value]
)
Calls = dict[str, list[dict[str, Any]]]


def test_every_option_of_every_verb_stands_in_the_table() -> None:
    """Oracle: the signatures. A new option has no line in the table, and this fails."""
    expected = {(verb, name) for verb, taker in commands().items() for name, *_ in fields_of(taker)}
    assert {(verb, name) for verb, rows in TABLE.items() for name in rows} == expected


def test_the_list_of_options_sees_a_new_one() -> None:
    """Guard: an option added to a verb, or to a dataclass of one, is listed."""

    @dataclasses.dataclass
    class Group:
        inner: int = 0

    def verb(place: Path, group: Group, outer: int = 0) -> None: ...

    verb.__annotations__ = {"place": Path, "group": Group, "outer": int}
    assert [name for name, *_ in fields_of(verb)] == ["place", "inner", "outer"]


@pytest.fixture(scope="module")
def loaded() -> None:
    """Everything but training, before any stand-in is there: a module loaded next to one would keep it for later tests."""
    for module in pkgutil.walk_packages(dlama.__path__, "dlama."):
        if module.name.split(".")[1] not in ("nets", "training", "__main__"):
            importlib.import_module(module.name)


@pytest.fixture
def calls(loaded: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Calls:
    """What the library's functions were called with, by the functions' names; none of them computes anything."""
    made: Calls = {}

    def spy(place: str, answer: Any = None, through: bool = False) -> None:
        module, _, name = place.rpartition(".")
        owner = dlama if module == "dlama" else pkgutil.resolve_name(module)
        original = getattr(owner, name)
        signature = inspect.signature(original)

        @functools.wraps(original)
        def stand_in(*args: Any, **kwargs: Any) -> Any:
            bound = signature.bind(*args, **kwargs)
            bound.apply_defaults()
            given = dict(bound.arguments)
            extra = given.pop("more", {}) | given.pop("options", {})
            made.setdefault(name, []).append(given | extra)
            if through:
                return original(*args, **kwargs)
            return answer(**given) if callable(answer) else answer

        monkeypatch.setattr(owner, name, stand_in)

    verbs = (
        *(f"measuring.{verb}" for verb in ("doctor", "evaluating", "worlds")), "networks.train", "networks.model_verbs",
        "sequence", "batch", "show", "video", "serve",
    )  # fmt: skip
    for module in ("command", "cli", *(f"verbs.{verb}" for verb in verbs)):
        spy(f"dlama.apps.{module}.report_result", through=True)
    _spy_on_jobs(spy)
    _spy_on_the_rest(spy)
    spy("dlama.web.server.open_server", lambda **_: nullcontext(SimpleNamespace(port=1, serve_forever=lambda: None)))
    monkeypatch.chdir(tmp_path)
    return made


def _spy_on_jobs(spy: Callable[..., None]) -> None:
    """view, remove, stereo and demo: reading, the three functions, writing."""
    shares = ("hole_share", "depth_only_share", "hole_share_by_type")
    meta: dict[str, Any] = dict.fromkeys((*shares, "filler", "nothing_visible", "law_violations"))
    meta |= {"seconds": {}, "stereo": {}, "recipe": {"name": "dlama"}}
    done = dlama.Completion((), (), None, None, meta)  # type: ignore[arg-type]
    about = {"field_of_view": {"from": "fov"}, "estimator": "a network", "scale": {"rule": "assumed"}}
    spy("dlama.jobs.verbs.write_depth")
    rgbd = dlama.RGBD(
        np.zeros((3, 4, 3), np.uint8), np.ones((3, 4), np.float32), dlama.Camera.from_fov(4, 3, 60), estimate=about
    )
    spy("dlama.jobs.inputs.read_rgbd", rgbd)
    for module in ("early", "inputs"):
        spy(f"dlama.jobs.{module}.picture_hw", (300, 400))
    spy("dlama.jobs.inputs.camera_for", ("camera", "words"))
    spy("dlama.jobs.verbs.read_camera", "target")
    spy("dlama.jobs.inputs.read_stereo_calib", "rig")
    spy("dlama.jobs.inputs.read_disparity", lambda path, **_: Path(path).name)
    for place in ("dlama.jobs.inputs", "dlama"):
        spy(f"{place}.read_mask", lambda path, **_: Path(path).name)
    spy("dlama.jobs.inputs.check_mask_fits")
    spy("dlama.jobs.inputs.read_color", lambda path: SimpleNamespace(shape=(3, 4, 3), name=Path(path).name))
    for place in ("options", "verbs.measuring.evaluating"):
        spy(f"dlama.apps.{place}.model_for", lambda model: Path("cache", str(model)))
    for place in ("jobs.verbs.view", "jobs.verbs.remove", "completion.verbs.view"):
        spy(f"dlama.{place}", done)
    spy("dlama.jobs.verbs.stereo", lambda mask, **_: (mask("left") if callable(mask) else None, done)[1])
    # as it does: the scene of a pair is seen by `view`
    spy("dlama.jobs.verbs.view_pair", lambda target, method, **_: dlama.jobs.verbs.view(done, **target, **method))
    spy("dlama.jobs.inputs.write")
    spy("dlama.apps.reading.file_names", [])
    found = SimpleNamespace(mask="mask", masker="rgbd", chosen="object", notes=(), about={})
    spy("dlama.perception.object_masks.find_mask", found)
    spy("dlama.perception.object_masks.complete_mask", found)
    for place in ("jobs.inputs", "files.semantic_classes"):
        spy(f"dlama.{place}.semantic_picture", Path("semantic.png"))
    spy("dlama.apps.reading.Command.write_mask")
    spy("dlama.apps.reading.summary_line", "")
    spy("dlama.apps.verbs.demo.new_directory", through=True)
    spy("dlama.apps.verbs.demo.demo_panels", [])
    spy("dlama.apps.verbs.demo.demo_legend", [])
    spy("dlama.apps.verbs.demo.demo_video")
    spy("dlama.apps.verbs.demo.write_contact_sheet")


def _spy_on_the_rest(spy: Callable[..., None]) -> None:
    """evaluate, worlds, models; `train` stands for itself, as it needs torch."""
    spy("dlama.apps.verbs.measuring.evaluating.open_dataset_or_worlds", Dataset("toy", "made-up", None, (), CASES))
    spy("dlama.apps.verbs.measuring.evaluating.run", SimpleNamespace(stored=(), reused=0, stale=0, failures=()))
    spy("dlama.apps.verbs.measuring.evaluating.write_report")
    spy("dlama.apps.verbs.measuring.evaluating.headlines", [])
    spy("dlama.apps.verbs.measuring.evaluating.reliability_lines", [])
    spy("dlama.worlds.writer.write_worlds", [])
    spy("dlama.diagnose", ())
    spy("dlama.sequence", object.__new__(dlama.SequenceCompletion))
    spy("dlama.SequenceCompletion.write", {})
    spy(
        "dlama.datasets.sequences.loading.read_scene_of",
        SimpleNamespace(scene=SimpleNamespace(frames=(), has_estimated_depth=False)),
    )
    spy("dlama.completion.start.choose_filler", lambda **given: SimpleNamespace(name=given["filler"]))
    spy("dlama.datasets.sequences.camera_paths.path_for", [SimpleNamespace(hw=(48, 64))])
    spy("dlama.render_path", [])
    box = SimpleNamespace(angle=3.0, distance=0.1, pivot=2.0)
    reported = {"photo3d": {"filled_cameras": [], "open_share": 0.0}, "filler": "telea"}
    spy("dlama.photo3d", dlama.Photo3D(None, box, reported))  # type: ignore[arg-type]
    spy("dlama.write_photo3d")
    spy("dlama.files.results.video.write_video", 1)
    spy("dlama.apps.verbs.sequence.mask_files", {"3": Path("a.png")})
    spy("dlama.apps.verbs.sequence.summary_line", "")
    spy("dlama.apps.verbs.sequence.summary_values", {})
    spy("dlama.batch", ())
    spy("dlama.apps.verbs.batch.plan_lines", ())
    point = dlama.PointCloud(np.zeros((1, 3)), np.zeros((1, 3), np.uint8), np.ones(1, np.uint8), np.ones(1, np.float32))
    spy("dlama.datasets.points.points_in", (point, None, ""))
    spy("dlama.geometry.figures.points.point_viewer", "")
    spy("dlama.apps.verbs.show.show_page", Path("page.html"))
    spy("dlama.geometry.kernels.ahead.start_compiling", [])
    spy("dlama.models.pull.pull", Path("pulled"))
    spy("dlama.apps.verbs.networks.model_verbs.record", through=True)
    spy("dlama.apps.verbs.networks.model_verbs.verify", SimpleNamespace(state="verified", path="", detail=""))
    spy("dlama.apps.verbs.networks.model_verbs.convert", [])
    spy("dlama.apps.verbs.networks.model_verbs.source_of", lambda model: Path(model))
    spy("dlama.apps.verbs.networks.model_verbs.sha256_of", "abc")


@pytest.fixture
def training(monkeypatch: pytest.MonkeyPatch, calls: Calls) -> None:
    """`dlama train` without a run."""
    pytest.importorskip("pytorch_lightning")
    from dlama.training.loop import train

    def no_run(*given: Any, **more: Any) -> Any:
        arguments = inspect.signature(original).bind(*given, **more).arguments
        calls.setdefault("train", []).append(dict(arguments))
        return SimpleNamespace(first=False)

    original = train.train
    monkeypatch.setattr(train, "train", no_run)


NEED_TORCH = ("train",)
"""Verbs whose modules take longer to import than all other rows take together."""
ROWS = [
    pytest.param(verb, name, id=f"{verb} {name}", marks=[pytest.mark.slow] if verb in NEED_TORCH else [])
    for verb in TABLE
    for name in TABLE[verb]
]


WITHOUT_OPTIONS: dict[str, Calls] = {}
"""What each verb's words without the option called, once for all of its rows."""


@pytest.mark.parametrize(("verb", "name"), ROWS)
def test_it_reaches_what_it_is_for(
    verb: str, name: str, calls: Calls, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the words the keyword has the stated value in every call, and without them it has not (oracle: the table)."""
    if verb in NEED_TORCH:
        request.getfixturevalue("training")
    reach = TABLE[verb][name]
    if verb not in WITHOUT_OPTIONS:
        main([*verb.split(), *BASE[verb].split()])
        WITHOUT_OPTIONS[verb] = dict(calls)
        calls.clear()
    assert not any(map(reach.fits, reach.arrived(WITHOUT_OPTIONS[verb])))
    main([*verb.split(), *reach.command(BASE[verb])])
    assert reach.arrived(calls) and all(map(reach.fits, reach.arrived(calls)))
    capsys.readouterr()


@pytest.mark.parametrize("unit", ["depth_range", "depth_scale"])
def test_a_photo3d_of_a_data_set_takes_its_camera_and_unit(
    unit: str, calls: Calls, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They were left out without a word (oracle: the call)."""
    words = ["--camera", "c.json", f"--{unit.replace('_', '-')}", "10", "-o", str(tmp_path / "out")]
    main(["photo3d", str(tmp_path), *words])
    (call,) = calls["read_scene_of"]
    assert (call["camera"], call[unit]) == ("c.json", 10.0)
    capsys.readouterr()
