"""Settings, and pictures, data sets or procedural worlds, in -> a trained network in a run directory out (extra `train`).

`data` makes samples, `losses` compares outputs with them, `loop` trains. Begin with `loop.train`; `kinds` says where a new kind
of planes, of samples or of loss goes.
"""
