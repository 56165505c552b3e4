"""Nouns (Camera, StereoRig, RGBD, View, PointCloud, Mesh, Scene) and pure functions on them; no files, no learning, no state.

In go pictures with depth and cameras; out come points, rendered views with typed holes, scenes and meshes. Begin with `camera`
and `view`, which state all conventions; then the flow: `projection` (lift), `motion/` (orbit), `rendering` (which draws with
`drawing/`), `holes`, `visibility` (the law) and `fusion`. Nouns, `projection` and `motion/` need numpy alone; compiled loops
are in `kernels/`.
"""
