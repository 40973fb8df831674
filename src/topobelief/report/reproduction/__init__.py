"""Figures, tables and the page of `topobelief reproduce`."""
