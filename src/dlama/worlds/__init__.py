"""Procedural scenes: a seed in; frames with exact truth, and the data set they make, out.

Begin with `dataset`; `layouts` set a stage with `props` in `materials`, `raycast` turns it into pictures.
"""
