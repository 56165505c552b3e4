"""Evaluation: metrics (pure), regions and protocols (which views, which pixels), runs, and the report."""
