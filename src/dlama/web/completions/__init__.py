"""What a visitor asks for in; its completion under way, what the page shows of it, and files to take home, out.

Begin with `results` (the actions) and `runs` (what becomes of a completion).
"""
