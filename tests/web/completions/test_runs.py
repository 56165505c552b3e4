"""Runs: progress, cancelling, failing, one at a time (oracle: what the work itself notes down)."""

from __future__ import annotations

import gc
import threading
import time
import warnings
import weakref
from pathlib import Path

import pytest
from handing_in import completed, open_frame

from dlama.errors import InputError
from dlama.progress import begin_stage
from dlama.web import api
from dlama.web.answers import PageError
from dlama.web.completions import results
from dlama.web.completions.runs import ONE_AT_A_TIME, Run, warnings_by_thread, warnings_of_thread
from dlama.web.visits import Visit, Visits


def test_stages_and_warnings_of_its_own_thread_are_heard() -> None:
    """Those of another thread are not."""
    with warnings_by_thread():

        def work() -> str:
            begin_stage("fill")
            other = threading.Thread(target=lambda: begin_stage("another"))
            other.start()
            other.join()
            warnings.warn("a doubt", UserWarning, stacklevel=1)
            return "result"

        run = Run(work, 1)
        run.start()
        run.join()
    assert (run.state, run.result, run.stages, run.stage, run.warnings) == ("done", "result", 1, "fill", ["a doubt"])
    assert run.progress()["share"] == 1.0


def test_warnings_go_elsewhere_where_nobody_listens() -> None:
    """As before: to whoever caught them."""
    with warnings.catch_warnings(record=True) as caught, warnings_by_thread():
        warnings.warn("one", UserWarning, stacklevel=1)
        with warnings_of_thread() as heard:
            warnings.warn("two", UserWarning, stacklevel=1)
    assert [str(one.message) for one in caught] == ["one"] and heard == ["two"]


def test_a_run_is_cancelled_at_its_next_stage() -> None:
    """Work that would continue for ever ends, no handler of errors catches it, and the next run gets its turn."""
    began, steps = threading.Event(), []

    def work() -> None:
        while True:
            try:
                began.set()
                time.sleep(0.01)
                begin_stage("a stage")
            except Exception:
                steps.append(-1)

    with warnings_by_thread():
        run = Run(work, 1)
        run.start()
        assert began.wait(600)
        run.cancel()
        assert run.state == "cancelled" and not run.active
        run.join()
        assert run.state == "cancelled" and run.result is None and steps == []
        after = Run(lambda: 7, 1)
        after.start()
        after.join()
    assert after.result == 7


def test_what_a_cancelled_run_gives_is_dropped() -> None:
    """Where no stage comes any more, it ends by itself, and its result is nobody's."""
    go = threading.Event()
    run = Run(lambda: go.wait(600), 1)
    run.start()
    run.cancel()
    go.set()
    run.join()
    assert (run.state, run.result) == ("cancelled", None)


def test_one_at_a_time_and_who_waits_can_be_cancelled() -> None:
    """A second run waits for the first; cancelled while it waits, it never begins."""
    go, order = threading.Event(), []
    first = Run(lambda: (go.wait(600), order.append("first")), 1)
    second, third = Run(lambda: order.append("second"), 1), Run(lambda: order.append("third"), 1)
    first.start()
    while first.state == "waiting":
        time.sleep(0.01)
    for run in (second, third):
        run.start()
    assert (first.state, second.state) == ("running", "waiting")
    third.cancel()
    go.set()
    for run in (first, second, third):
        run.join()
    assert order == ["first", "second"] and third.state == "cancelled"


def test_a_page_loaded_again_hears_of_a_run_that_ended_meanwhile(visit: Visit, frame: Path) -> None:
    """Its state says so, and asking for the run gives the result."""
    open_frame(visit, frame)
    results.complete(visit, {"yaw": 3, "filler": "telea"})
    assert visit.run is not None
    visit.run.join()
    assert api.state(visit, {})["run"]["state"] == "done"
    assert results.run(visit, {})["result"]["moved"]
    assert "run" not in api.state(visit, {}) and "result" in api.state(visit, {})


def test_a_result_stays_until_the_next_one_is_there(visit: Visit, frame: Path) -> None:
    """Cancelled or failed, the second run leaves the first result (oracle: the same object), which can be taken home. Its
    error is reported once, as the library says it."""
    open_frame(visit, frame)
    first = completed(visit, yaw=1)
    with ONE_AT_A_TIME:  # it cannot end before it is cancelled
        results.complete(visit, {"yaw": 2, "filler": "telea"})
        results.cancel(visit, {})
    assert results.run(visit, {})["state"] == "cancelled" and visit.result is first
    visit.run = Run(lambda: (_ for _ in ()).throw(InputError("pivot is 3; more is expected")), 1)
    visit.run.start()
    visit.run.join()
    with pytest.raises(InputError, match="pivot is 3"):
        results.run(visit, {})
    assert results.run(visit, {})["state"] == "none"
    assert visit.result is first and results.package(visit, {}).data[:2] == b"PK"
    assert completed(visit, yaw=3) is not first


def test_filling_from_all_sides_is_a_run_of_its_own(visit: Visit, frame: Path) -> None:
    """Cancelled it leaves the completion as it was (oracle: the same object); asked for twice it is one run."""
    open_frame(visit, frame)
    with pytest.raises(PageError, match="nothing has been completed yet"):
        results.turn(visit, {})
    result = completed(visit, yaw=1)
    results.turn(visit, {})
    first = visit.run
    results.turn(visit, {})
    assert first is not None and visit.run is first
    with pytest.raises(PageError, match="under way"):
        results.complete(visit, {"yaw": 2})
    results.cancel(visit, {})
    assert results.run(visit, {})["state"] == "cancelled" and visit.result is result
    first.join()
    results.turn(visit, {})
    assert visit.run is not None and visit.run is not first
    visit.run.join()
    assert results.run(visit, {})["state"] == "done" and visit.result is result and "photo" in vars(result)
    assert results.scene(visit, {}).data[:4] == b"glTF"


@pytest.mark.slow
def test_nothing_of_earlier_results_is_kept(visits: Visits, frame: Path) -> None:
    """Oracle: weak references to the results of earlier runs, and of a visit that ended."""
    visit = visits.begin()
    open_frame(visit, frame)
    results = [weakref.ref(completed(visit, yaw=turn).done) for turn in (1, 2, 3)]
    gc.collect()
    assert [ref() is None for ref in results] == [True, True, False]
    visits.end(visit.id)
    gc.collect()
    assert results[-1]() is None and not visit.folder.exists()
