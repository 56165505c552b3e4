"""What only the benchmarks use (worlds for clicks, crops for shadows, the network that learns them) lies beside them."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
