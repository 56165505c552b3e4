"""Protocols: a case's truth and a method in; scores out, each in the same regions for every method.

Begin with `vpi` (another view); `ori` removes an object, `sii` does it in a stereo pair.
"""

from __future__ import annotations

from collections.abc import Callable

from dlama.datasets.frames import Protocol, Truth
from dlama.evaluation.protocols import ori, sii, vpi
from dlama.evaluation.protocols.methods import Method, ProtocolSettings, Scored

Score = Callable[[Truth, Method, ProtocolSettings], list[Scored]]
"""The first is the plain run and has the panel; the others have a variant. Raises InputError and its kin."""

PROTOCOLS: dict[Protocol, Score] = {"vpi": vpi.score, "ori": ori.score, "sii": sii.score}
