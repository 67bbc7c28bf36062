"""The wall: cell complex, grading, offset control nets, and whether they meet themselves."""
