"""The wall: cell complex, grading, offset control nets, their areas and their self-intersection."""
