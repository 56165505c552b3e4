"""A list of jobs in; each job's results, and a manifest with one row a job, out, however many jobs, processes and machines.

Begin with `batch` (the run), then `job` (what one is) and `perform` (one job, in any process). `lists/` reads lists, folders and
data sets, `results/` keeps what came of them, `storage` has files that lie elsewhere, `report/` is the page about a run.
"""
