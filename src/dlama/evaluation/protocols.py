"""The three protocols by name: a case's truth, a method and settings in; one `Scored` for each run out."""

from __future__ import annotations

from collections.abc import Callable

from dlama.datasets.frames import Protocol, Truth
from dlama.evaluation import ori, sii, vpi
from dlama.evaluation.methods import Method, ProtocolSettings, Scored

Score = Callable[[Truth, Method, ProtocolSettings], list[Scored]]
"""The first is the plain run and has the panel; the others have a variant. Raises InputError and its kin."""

PROTOCOLS: dict[Protocol, Score] = {"vpi": vpi.score, "ori": ori.score, "sii": sii.score}
