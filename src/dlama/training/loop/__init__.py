"""Settings and samples in -> a trained network in a run directory out.

Begin with `train`; `module` is one step, `callbacks` what is written between steps, `run_files` and `checkpointing` how.
"""
