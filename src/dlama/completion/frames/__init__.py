"""One picture or many frames in; the scene they make, without what is removed, and what each frame lacks filled, out.

`sources` (what is given becomes a scene), `removal` (a mask carried to all frames), `filling` (frames filled one by one).
"""
