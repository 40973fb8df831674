"""Pictures and tables of results; they compute nothing that a decision does not already hold."""
