"""Stored results in; results.csv, summary.md and report.html out. Begin with `write`."""
