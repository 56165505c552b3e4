"""What a visitor asks for in; its completion under way, what the page shows of it, and files to take home, out.

Begin with `request` (what is asked for) and `runs` (what becomes of it).
"""
