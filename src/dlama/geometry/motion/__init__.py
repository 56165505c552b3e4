"""Rotations, poses and cameras in; the same checked, turned into each other or moved out. Same lens, new place.

`poses` has rigid motions and quaternions; `trajectories` moves a camera (orbit, dolly) and makes paths of cameras.
"""
