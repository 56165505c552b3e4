"""The filler `layered`: a view with holes in; surfaces continued behind each hole, then painted with their own texture, out.

Begin with `layered` (both steps on one screen), then `surfaces` (depth) and `texture_synthesis` (colour).
"""
