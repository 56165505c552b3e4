"""Protocols: a case's truth and a method in; scores out, each in the same regions for every method.

Begin with `vpi` (another view); `ori` removes an object, `sii` does it in a stereo pair.
"""

from __future__ import annotations

from dlama.datasets.frames import Protocol
from dlama.evaluation.protocols import ori, sii, vpi
from dlama.evaluation.protocols.methods import Score

PROTOCOLS: dict[Protocol, Score] = {"vpi": vpi.score, "ori": ori.score, "sii": sii.score}
