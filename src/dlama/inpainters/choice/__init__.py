"""The filler `choice`: several guesses at a view in; each pixel from the guess that a small network trusts most, out.

Begin with `filler`; `guesses` makes them, `judge` runs the network.
"""
