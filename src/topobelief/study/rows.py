"""The columns of a study's table, in order, and what each holds.

A row begins with the task and its combination, then says how the task fared, then what came out. Where a task failed, what
came out is null. Columns in `UNREPEATABLE` say how a run went; all others are the same in every run of the same study.
"""

from __future__ import annotations

from typing import Literal

ColumnType = Literal["text", "whole", "number", "flag", "numbers"]

COLUMNS: dict[str, ColumnType] = {
    "task": "text",  # id
    "world": "text",
    "session": "text",
    "sigma_p": "number",  # m
    "sigma_theta": "number",  # rad
    "xi": "number",  # sigma_theta / sigma_p
    "strategy": "text",
    "objective": "text",
    "seed": "whole",
    "status": "text",  # ok or failed
    "error": "text",  # why it failed
    "num_poses": "whole",  # of the prior of the last decision
    "num_edges": "whole",
    "num_candidates": "whole",
    "chosen": "whole",  # candidate, from 0, shortest first
    "length": "number",  # m, of the chosen path, as the next two
    "num_new_poses": "whole",
    "num_closures": "whole",
    "value": "number",  # objective of the chosen one, in nats or (error) metres, as all down to error_bound
    "best_value": "number",
    "spread": "number",  # largest less least value
    "loss": "number",  # value - best_value: epsilon of Definition 1
    "action_consistent": "flag",  # loss up to 1e-6
    "signature": "number",  # score of the chosen one; -length for shortest
    "lower": "number",
    "upper": "number",
    "error_bound": "number",  # no candidate is better by more
    "num_survivors": "whole",
    "num_evaluations": "whole",  # exact ones, before the answer
    "proven_optimal": "flag",
    "order_consistent": "flag",  # gamma up to 1e-6
    "gamma": "number",  # of Definition 1, as value
    "spearman": "number",
    "kendall": "number",
    "candidate_lengths": "numbers",  # m
    "candidate_values": "numbers",
    "candidate_scores": "numbers",
    "version": "text",  # of topobelief
    "attempts": "whole",  # times that the task was begun
    "candidates_seconds": "number",  # roadmaps, paths and factors, as they took when they were found
    "decision_seconds": "number",
    "scoring_seconds": "number",  # exact values of all candidates, for the judgement
}

KEY = ("world", "session", "sigma_p", "sigma_theta", "strategy", "objective", "seed")
"""Columns that name a combination."""

UNREPEATABLE = ("attempts", "candidates_seconds", "decision_seconds", "scoring_seconds")
