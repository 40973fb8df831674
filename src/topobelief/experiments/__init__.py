"""The paper's experiments and ours, a table or figure a file: they compute and return results, and draw nothing."""
