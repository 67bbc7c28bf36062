"""The wall: cell complex, grading, offset control nets, and whether they meet themselves."""

from gyroid_cad.former import former_names, moved_to

# The module of this name had them before it became a room.
__getattr__ = former_names(__name__, moved_to(["gyroid_cad.wall.offset"]))
