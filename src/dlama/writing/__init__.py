"""A path in; a file or a folder there that is whole or not there at all, out. Every room writes by it.

Begin with `atomic_write`; `drafts` has the hidden names of what is not whole yet, `unchanged` keeps what was read of a file.
Nothing of dlama but its errors is used here.
"""
