"""Forms: the quadratic forms of the theory after an action, of which engines supply the log-determinants."""
