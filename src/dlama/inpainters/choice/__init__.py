"""The filler `choice`: several guesses at a view in; their mixture, weighted per pixel by a small network, out.

Begin with `filler`; `guesses` makes them, `judge` runs the network.
"""
