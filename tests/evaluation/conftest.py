"""This folder is on the import path, so that `made_up` and `square_world` import from any test below."""

from square_world import constant_filler

__all__ = ["constant_filler"]
