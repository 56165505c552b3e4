"""Tasks in; what became of each out, even where single processes die: worker processes, their threads, memory, progress.

Begin with `pool`; `dlama.evaluation.runner` and `dlama.jobs` run on these.
"""
