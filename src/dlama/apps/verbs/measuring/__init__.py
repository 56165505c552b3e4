"""Verbs that measure: `dlama evaluate`, `worlds`, `doctor`."""
