"""Tasks in; what became of each out, whatever happens to single processes: worker processes, their threads, memory, progress.

Begin with `pool`; `dlama.evaluation.runner` and `dlama.jobs` run on these.
"""
