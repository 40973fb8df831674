"""Strategies: how one of several candidates is chosen, one file per kind, and the form of the answer."""
