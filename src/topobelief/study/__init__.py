"""Studies: the same decision in every combination of worlds, sessions, noises, strategies, objectives and seeds.

`specification` reads what to vary, `tasks` makes one task of each combination, `session` plays a task, `dataset` keeps the
rows, `runner` makes a run of them all (`topobelief.runs`), and `summary` counts.
"""
