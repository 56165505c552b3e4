"""Nouns (camera, rgbd, cloud, view, scene) and the pure functions on them; no files, no learning, no state."""
