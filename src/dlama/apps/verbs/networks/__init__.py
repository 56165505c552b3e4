"""Verbs about networks: `dlama models`, `train`, `pack`."""
