"""Kernels of searches are compiled before the first search needs them."""

from topobelief.search import compile_kernels, flows, layers


def test_the_kernels_of_flows_and_layers_are_met():
    compile_kernels.compile_kernels()
    kernels = [each for module in (flows, layers) for each in vars(module).values() if hasattr(each, "signatures")]
    assert kernels
    assert all(kernel.signatures for kernel in kernels)
