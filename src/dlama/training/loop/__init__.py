"""Settings and samples in -> a trained network in a run directory out.

Begin with `train`; `step` is one step, `reporting` what is written between steps, `run_files` and `checkpointing` how.
"""
