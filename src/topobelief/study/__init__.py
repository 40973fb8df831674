"""Studies: the same decision in every combination of worlds, sessions, noises, strategies, objectives and seeds.

`specification` reads what to vary, `tasks` makes one task of each combination, `session` plays a task, `local_workers` and
`cluster` have many played at once, `dataset` keeps their rows, `runner` holds it together, and `summary` counts.
"""
