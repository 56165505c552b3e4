"""A data set and methods in; the results of every method on every case out, stored, so that a later run resumes from there.

Begin with `run`; `store` has the files, `cache_key` says which stored results still hold.
"""
