"""The settings of `dlama train`: what the command line says and what a run to resume was begun with (oracle: a round trip)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlama.errors import InputError
from dlama.training.loop.run_files import SETTINGS, choose_settings, prepare
from dlama.training.presets import to_json


def test_a_resumed_run_knows_what_it_was_started_from(tmp_path: Path) -> None:
    """Begun with --start, it is resumed without it; other weights are refused as another run."""
    begun = choose_settings("tiny", Path("a.ckpt"), steps=3)
    (tmp_path / SETTINGS).write_text(to_json(begun))
    assert choose_settings("tiny", None, tmp_path, steps=3) == begun
    prepare(tmp_path, choose_settings("tiny", None, tmp_path), resume=True)
    with pytest.raises(InputError, match=r"network\.start is 'b\.ckpt', the run to resume has 'a\.ckpt'"):
        prepare(tmp_path, choose_settings("tiny", Path("b.ckpt"), tmp_path), resume=True)


def test_a_new_run_takes_nothing_from_the_directory(tmp_path: Path) -> None:
    (tmp_path / SETTINGS).write_text(to_json(choose_settings("tiny", Path("a.ckpt"))))
    assert choose_settings("tiny", None).network.start is None
    assert choose_settings("tiny", None, tmp_path / "none").network.start is None


def test_a_resumed_preset_keeps_what_the_command_line_said(tmp_path: Path) -> None:
    """--steps, --batch and --mixture hold for a run, not for one command; what is said again wins, another preset is refused."""
    begun = choose_settings("tiny", None, mixture=("world=1", "removal=3"), steps=7, batch=2)
    assert begun.data.mixture == {"world": 1.0, "removal": 3.0}
    (tmp_path / SETTINGS).write_text(to_json(begun))
    assert choose_settings("tiny", None, tmp_path) == begun
    assert choose_settings("tiny", None, tmp_path, steps=9).loop.steps == 9
    with pytest.raises(InputError, match="the run to resume has"):
        prepare(tmp_path, choose_settings("mini-rgbd", None, tmp_path), resume=True)


@pytest.mark.parametrize(
    ("word", "says"),
    [
        ("frame", "'frame'; KIND=SHARE"),
        ("frame=x", "'frame=x'"),
        ("=1", "data.mixture"),
        ("cube=1", "'cube'"),
        ("world=0", "0"),
    ],
)
def test_mixtures_that_are_none(word: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        choose_settings("tiny", None, mixture=(word,))
