"""Arrays in; pictures in colour, and small self-contained HTML for notebooks, out. The nouns draw themselves by it.

Begin with `false_color` (depth, hole types, origins), then `html` (captioned pictures) and `points` (a cloud that turns).
"""
