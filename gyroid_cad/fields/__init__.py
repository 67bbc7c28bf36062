"""Fields of place: numbers, formulas, distances, samples and what is made of them.

The names here are the public ones; they are loaded together, for a field is nothing without numpy.
"""

from gyroid_cad.fields.field import Field
from gyroid_cad.fields.makers import (
    between_planes,
    constant,
    distance_from_axis,
    distance_from_point,
    expression,
    linear,
    radial,
    sampled,
    smooth_maximum,
    smooth_minimum,
)

__all__ = [
    "Field",
    "between_planes",
    "constant",
    "distance_from_axis",
    "distance_from_point",
    "expression",
    "linear",
    "radial",
    "sampled",
    "smooth_maximum",
    "smooth_minimum",
]
