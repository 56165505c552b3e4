"""What is pointed at in a picture (options of `mask`, `remove` and `stereo`) in; keyword arguments of find_mask out."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from dlama.apps.options import as_flags
from dlama.jobs import options as groups
from dlama.jobs.parameters import is_pointed, mask_settings


@as_flags
class Pointing(groups.Pointing):
    """Points at the object, in place of a mask file."""

    @property
    def given(self) -> bool:
        """Whether anything is pointed at. InputError, before anything is read, for words that are no pixels."""
        self.settings()
        return is_pointed(dataclasses.asdict(self))

    @property
    def needs_depth(self) -> bool:
        """Whether the object is found in depth."""
        by_color = self.salient or self.object_class is not None or self.masker not in (None, "rgbd")
        return self.with_shadow or not by_color

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of find_mask; raises InputError."""
        options = super().settings()
        del options["object_class"]
        return mask_settings(**options)


def mask_notes(chosen: str, candidates: Iterable[str], notes: Iterable[str]) -> str:
    """For the last line: which other readings of the clicks there are, and what to know of the mask; "" where nothing is."""
    others = [name for name in candidates if name != chosen]
    differs = [f"--candidate {' or '.join(others)} gives another mask"] if others else []
    return "".join(f"; {one}" for one in [*differs, *notes])
