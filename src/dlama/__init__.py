"""dlama completes what a camera could not see."""

__version__ = "0.1.0"
