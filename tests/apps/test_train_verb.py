"""The settings of `dlama train`: what the command line says and what a run to resume was begun with (oracle: a round trip)."""

from __future__ import annotations

from pathlib import Path

import pytest

from dlama.errors import InputError
from dlama.training.loop.run_files import choose_settings, prepare, write_settings


def test_a_resumed_run_knows_what_it_was_started_from(tmp_path: Path) -> None:
    """Begun with --start and --trunk, it is resumed without them; other weights are refused as another run."""
    begun = choose_settings("tiny", Path("a.ckpt"), Path("trunk.pth"), steps=3)
    write_settings(tmp_path, begun)
    assert choose_settings("tiny", None, None, tmp_path, steps=3) == begun
    prepare(tmp_path, choose_settings("tiny", None, None, tmp_path), resume=True)
    with pytest.raises(InputError, match=r"network\.start is 'b\.ckpt', the run to resume has 'a\.ckpt'"):
        prepare(tmp_path, choose_settings("tiny", Path("b.ckpt"), None, tmp_path), resume=True)


def test_a_new_run_takes_nothing_from_the_directory(tmp_path: Path) -> None:
    write_settings(tmp_path, choose_settings("tiny", Path("a.ckpt"), None))
    assert choose_settings("tiny", None, None).network.start is None
    assert choose_settings("tiny", None, None, tmp_path / "none").network.start is None
