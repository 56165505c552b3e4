"""What the page shows of a result (oracles: the result itself, and the last line of the command)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from handing_in import completed, open_frame

from dlama.apps.reading import remaining_shadow
from dlama.geometry.figures.false_color import ORIGIN_PALETTE
from dlama.web import api, pictures
from dlama.web.completions import results
from dlama.web.visits import Visit


@pytest.mark.parametrize(
    ("marks", "with_shadow", "hint"),
    [
        ({"kind": "click", "at": [256, 345]}, False, "“with its shadow” removes it, too"),
        ({"kind": "click", "at": [256, 345]}, True, None),
        ({"kind": "add", "points": [[256, 300], [256, 360]], "radius": 26}, False, "stay"),
    ],
)
def test_a_shadow_that_stays_is_hinted_at(
    visit: Visit, marks: dict[str, object], with_shadow: bool, hint: str | None
) -> None:
    """Oracle: the command's last line, which the page did not have. A painted mask has no shadow that could be added."""
    api.example(visit, {"name": "street"})
    api.mark(visit, {"marks": [marks], "with_shadow": with_shadow})
    result = completed(visit)
    shown = [line for line in results.describe_result(result)["warnings"] if "look like its shadow" in line]
    assert [line.endswith(hint or "") for line in shown] == [True] * (hint is not None)
    assert all(line.split(":")[0] in remaining_shadow(result.done.meta, with_shadow) for line in shown)


def test_maps_are_no_larger_than_they_are_shown(frame: Path, visit: Visit, monkeypatch: pytest.MonkeyPatch) -> None:
    """Laws: the picture keeps its size, maps keep the codes of pixels; of 12 megapixels each map had as many."""
    monkeypatch.setattr(pictures, "MAP_PX", 32)
    open_frame(visit, frame)
    api.mark(visit, {"marks": [{"kind": "click", "at": [30, 24]}]})
    done = completed(visit, yaw=5).done
    for kind in ("hole_type", "origin", "confidence", "depth", "depth_known"):
        assert pictures.result_picture(done, kind).shape == (24, 32, 3)
    for kind in ("image", "known", "source"):
        assert pictures.result_picture(done, kind).shape == (48, 64, 3)
    origins = np.array(ORIGIN_PALETTE, np.uint8)[done.view.origin[::2, ::2]]
    np.testing.assert_array_equal(pictures.result_picture(done, "origin"), origins)
    source = cv2.imdecode(np.frombuffer(api.source_picture(visit, {"kind": "depth"}).data, np.uint8), cv2.IMREAD_COLOR)
    assert source.shape == (24, 32, 3)
