"""Strategies: how one of several candidates is chosen, a kind a file, and what each answers."""
