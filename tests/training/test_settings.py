"""Settings refuse contradictions, and come back from JSON as they went."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest
import torch

from dlama.errors import FileError, InputError
from dlama.nets.generator import Generator
from dlama.training.data.sources import KINDS
from dlama.training.kinds import PLANES, SAMPLES, Planes
from dlama.training.loop.run_files import refuse_changes
from dlama.training.presets import PRESETS, from_json, settings_of, to_json
from dlama.training.settings import DataSettings, LoopSettings, LossSettings, NetworkSettings, TrainSettings


@pytest.mark.parametrize("name", PRESETS)
def test_presets_travel_through_json(name, tmp_path):
    """Oracle: round trip, by name and by file."""
    settings = settings_of(name)
    path = tmp_path / "settings.json"
    path.write_text(to_json(settings))
    assert settings_of(path) == settings and settings.name == name


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"nam": "x"}, "nam is no setting"),
        ({"network": {"widht": 3}}, "network.widht is no setting"),
        ({"network": {"width": "3"}}, "network.width"),
        ({"network": {"width": 3.5}}, "network.width"),
        ({"network": {"planes": "rgbx"}}, "network.planes is 'rgbx'"),
        ({"loop": {"steps": True}}, "loop.steps"),
        ({"loss": []}, "loss is \\[\\]; a table is expected"),
        ({"data": {"mixture": {"world": "much"}}}, "data.mixture"),
        ({"data": {"mixture": 3}}, "data.mixture"),
    ],
)
def test_json_is_read_strictly(change, says):
    """Oracle: law; the message names the field."""
    with pytest.raises(FileError, match=says):
        from_json(json.dumps(change))


@pytest.mark.parametrize("text", ["", "[]", "{", "3"])
def test_json_that_is_no_settings_file(text):
    """Oracle: law."""
    with pytest.raises(FileError, match=r"my\.json"):
        from_json(text, "my.json")


def test_what_a_file_leaves_out_keeps_its_default():
    """Oracle: the defaults; a whole number is a number."""
    assert from_json('{"loss": {"perceptual": 3}}') == TrainSettings(loss=LossSettings(perceptual=3.0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: LossSettings(adversarial=-1),
        lambda: LossSettings(perceptual=float("nan")),
        lambda: LossSettings(trunk="resnet50-dilated"),
        lambda: LoopSettings(batch=0),
        lambda: LoopSettings(precision="fp16"),
        lambda: DataSettings(mixture={}),
        lambda: DataSettings(mixture={"world": 0.0}),
        lambda: DataSettings(mixture={"wrold": 1.0}),
        lambda: TrainSettings(data=DataSettings(size=100)),
        lambda: TrainSettings(name="a/b"),
        lambda: TrainSettings(network=NetworkSettings("stereo")),
        lambda: TrainSettings(data=DataSettings(mixture={"stereo": 1.0, "world": 1.0})),
    ],
)
def test_contradictions_are_refused(make):
    """Oracle: law."""
    with pytest.raises(InputError):
        make()


def test_an_unknown_name_lists_the_presets():
    """Oracle: law."""
    with pytest.raises(InputError, match="mini-stereo"):
        settings_of("medium-rgbd")


def test_kinds_are_whole():
    """Oracle: the other places that know a kind by its name; a kind that is missing in one of them is seen here."""
    assert set(get_args(Planes)) == set(PLANES) and list(KINDS) == list(SAMPLES)
    for planes in PLANES.values():
        assert f"({planes.inputs} planes in" in planes.description and f" {planes.outputs} out)" in planes.description
    assert set(SAMPLES.values()) == {planes.views for planes in PLANES.values()}


def test_old_settings_files_still_load():
    """Oracle: the files of published runs, and the kinds and settings that the first edition wrote."""
    folder = Path(__file__).parents[2] / "benchmarks" / "training_settings"
    assert len([settings_of(path) for path in folder.glob("*.json")]) >= 3
    first = {"data": {"mixture": dict.fromkeys(("world", "frame", "removal"), 1.0), "cases": 0.25}}
    found = from_json(json.dumps(first | {"loop": {"validate_every": 5, "sheet_every": 7}}))
    assert found.data.cases == 0.25 and set(found.data.mixture) == set(first["data"]["mixture"])


def test_budgets_of_the_presets():
    """Oracle: the sizes the presets were asked to have, and torch's own count of parameters."""
    small = PRESETS["small-rgbd"].settings.network
    assert 4.5e6 < small.parameters < 5.5e6
    assert all(PRESETS[name].settings.network.parameters < 1e6 for name in ("tiny", "mini-rgbd", "mini-stereo"))
    assert 50e6 < PRESETS["big-rgbd"].settings.network.parameters < 52e6
    for preset in PRESETS.values():
        with torch.device("meta"):
            net = Generator(preset.settings.network.generator)
        assert preset.settings.network.parameters == sum(parameter.numel() for parameter in net.parameters())


def test_resuming_with_other_settings_is_refused():
    """Oracle: law; the loop's rhythm may change, the loss may not."""
    had = TrainSettings()
    refuse_changes(had, replace(had, loop=replace(had.loop, steps=7, log_every=1)))
    with pytest.raises(InputError, match=r"loss.perceptual is 1.0, the run to resume has 30.0"):
        refuse_changes(had, replace(had, loss=LossSettings(perceptual=1.0)))
