"""A picture with depth and the mask of a thing in; the shadow that it casts on the surface it stands on out.

Begin with `find`: `ground` finds the surface, `search` the direction of light, `thrown` throws the thing's shape, `planes` lays
all of it out as a crop, `network`, `features` and `classifier` say which pixels are shadow.
"""
