"""One Hypothesis profile for every machine: the same examples each run, and no deadline on a single one."""

from hypothesis import settings

settings.register_profile("topobelief", derandomize=True, deadline=None, max_examples=40)
settings.load_profile("topobelief")
