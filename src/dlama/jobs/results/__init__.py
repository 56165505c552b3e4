"""What came of jobs in; the manifest with one row a job, and tar shards of the results, out.

Begin with `result`, one row.
"""
