"""Inputs as they were given in; findings out: what is wrong with them, how sure that is, and the option that mends it.

Each file holds the checks of one family, pure functions on arrays and cameras. Begin with `finding.py` and `rgbd_checks.py`.
`dlama.datasets.diagnosis.diagnose` reads the files and calls them.
"""
