"""Procedural scenes: a seed in; frames with exact truth, and the data set they make, out.

Begin with `dataset`, then `world`; `layouts` set `props` made of `materials` with the `scene_builder`, `raycast` renders them,
`writer` writes them as folders.
"""
