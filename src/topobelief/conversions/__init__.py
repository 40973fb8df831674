"""Pose graphs to and from the objects of other libraries, one file per library."""
