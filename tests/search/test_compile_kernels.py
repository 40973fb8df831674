"""Kernels of searches are compiled before the first search needs them."""

from topobelief.search import compile_kernels, layers, longest_paths, record_kernels, windows

CALLED_BY_OTHERS = ("_log_det", "_invert")


def test_the_kernels_of_bounds_are_met():
    compile_kernels.compile_kernels()
    modules = (layers, longest_paths, record_kernels, windows)
    kernels = {name: each for module in modules for name, each in vars(module).items() if hasattr(each, "signatures")}
    assert {name for name, kernel in kernels.items() if not kernel.signatures} <= set(CALLED_BY_OTHERS)
