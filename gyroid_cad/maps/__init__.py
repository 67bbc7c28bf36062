"""Maps of space that carry a block of cells."""

from gyroid_cad.maps.block import Bend, Cylinder, Sphere, Twist
from gyroid_cad.maps.space import SpaceMap

__all__ = ["Bend", "Cylinder", "SpaceMap", "Sphere", "Twist"]
