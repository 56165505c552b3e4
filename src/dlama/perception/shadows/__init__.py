"""A picture with depth and an object's mask in; the mask of the shadow that it casts on its supporting surface out.

Begin with `find`. `ground` finds the surface, `lit_surface` its darkness and the ambient occlusion, `search` the direction of
light and the shape that the object casts. `planes` collects all of it in a crop, for its network; `features` and `classifier`
classify the pixels.
"""
