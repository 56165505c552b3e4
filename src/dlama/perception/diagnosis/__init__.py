"""Inputs as given in; findings out: faults, their probability, and the option that fixes each.

Each file holds the checks of one family, pure functions on arrays and cameras. Begin with `finding.py` and `rgbd_checks.py`;
`frames/` compares posed frames. `dlama.datasets.diagnosis.diagnose` reads the files and calls them.
"""
