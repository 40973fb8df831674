"""The best walk of a whole roadmap: a local search for the value, bounds for the certificate, and the two together."""
