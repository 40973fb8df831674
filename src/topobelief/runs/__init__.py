"""Long runs of many tasks that can be interrupted and continued: of studies, comparisons and the reproduction.

`run` holds a run together. An executor has the tasks worked on: `in_process`, `local_workers` or `cluster`. A store keeps what
is finished: `journal`, or the Parquet dataset of a study. `attempt` says what becomes of one task.
"""
