"""Pose graphs to and from the objects of other libraries, a library a file."""
