"""How the ray caster's arrays are laid out: columns of a shape's row, numbers of the light, codes and sizes of textures.

`SceneBuilder` writes rows of shapes, `World` the numbers of the light; the kernels read both.
"""

from __future__ import annotations

KIND, CENTRE, TURN, HALF, LAYER, TILE, MODE, TINT, STAIN, GROUP, CASTS, CUT, OFFSET, CONTACT, COLUMNS = (
    0, 1, 4, 13, 16, 17, 19, 20, 23, 24, 25, 26, 27, 29, 30,
)  # fmt: skip
"""First column of each field; TURN has nine, CENTRE, HALF and TINT three, TILE and OFFSET two."""
PANEL, BOX, BALL, TUBE = 0, 1, 2, 3
"""Kinds: rectangle in local x, z; box; ellipsoid; frustum about local y. HALF of a TUBE: radius below, half height,
radius above."""
WRAP, MIRROR, FIT = 0, 1, 2
"""Texture modes: TILE metres a repeat, the same mirrored (photos do not tile), or TILE repeats over the face."""
TO_LIGHT, SUN, AMBIENT_SKY, AMBIENT_GROUND, HORIZON, ZENITH, CLOUD, COVER, HAZE, SHADOWS, GRID_X, GRID_Y, GRID = (
    0, 3, 6, 9, 12, 15, 18, 21, 26, 27, 28, 31, 34,
)  # fmt: skip
"""The light's numbers; COVER: cloud cover, softness, scale, offset u, v; GRID: first x, first y, cells per metre, cells a
side of the grid across the light, which lists what may stand in its way."""
SIDE = 256
"""Texels along a layer of the finest level; layer 0 is grey noise (stains), layer 1 the clouds."""
LEVELS = 9
TEXELS = sum((SIDE >> level) ** 2 for level in range(LEVELS))
"""Of a layer, all levels together."""
TILE_PX = 16
NEAR = 1e-9
LIFT = 1e-4
"""Metres off the surface at which a ray towards the light starts."""
GROUND_GROUP, OBJECT_GROUP = 0, 1
"""Values of GROUP: the ground, and the object of interest; everything else has a number of its own from 2."""
UNLIT, LIT, BLOCKED = 0, 1, 2
"""Light at a pixel's centre: the surface faces away (or is sky), it is lit, something stands before the light."""
