"""Clouds, meshes and scenes in; PLY, GLB and NPZ files out, and clouds and scenes back."""
