"""A picture with depth and the mask of an object in; the shadow that it casts on the surface it stands on out.

Begin with `find`: `ground` finds the surface, `occlusion` what the object hides of the sky, `lit_surface` how dark the
surface is, `search` the direction of light, `thrown` throws the object's shape, `planes` lays all of it out as a crop
(`crop`), `network`, `features` and `classifier` say which pixels are shadow, `growing` follows it to where it fades.
"""
