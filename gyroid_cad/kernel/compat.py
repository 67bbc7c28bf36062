"""One name for whatever OCP 7.9 and OCP 8 name differently: the kernel's collections, and the casts of a shape.

CadQuery 2.8 brings OCP 7.9, build123d 0.13 brings OCP 8. No other module knows which of the two is there.
"""

from __future__ import annotations

import OCP
from OCP.TopoDS import TopoDS

try:
    from OCP.collections import Array1_double as RealArray
    from OCP.collections import Array1_gp_Pnt as PointArray
    from OCP.collections import Array1_gp_Pnt2d as Point2dArray
    from OCP.collections import Array1_int as IntegerArray
    from OCP.collections import Array2_double as RealGrid
    from OCP.collections import Array2_gp_Pnt as PointGrid
    from OCP.collections import (
        IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as ShapesOfShape,
    )
    from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as NumberedShapes
    from OCP.collections import List_TopoDS_Shape as ShapeList
    from OCP.collections import Map_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeSet
    from OCP.collections import Sequence_TDF_Label as LabelSequence

    as_compound, as_edge, as_face = TopoDS.Compound, TopoDS.Edge, TopoDS.Face
    as_shell, as_solid, as_vertex, as_wire = TopoDS.Shell, TopoDS.Solid, TopoDS.Vertex, TopoDS.Wire
except ImportError:
    from OCP.TColgp import TColgp_Array1OfPnt as PointArray
    from OCP.TColgp import TColgp_Array1OfPnt2d as Point2dArray
    from OCP.TColgp import TColgp_Array2OfPnt as PointGrid
    from OCP.TColStd import TColStd_Array1OfInteger as IntegerArray
    from OCP.TColStd import TColStd_Array1OfReal as RealArray
    from OCP.TColStd import TColStd_Array2OfReal as RealGrid
    from OCP.TDF import TDF_LabelSequence as LabelSequence
    from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape as ShapesOfShape
    from OCP.TopTools import TopTools_IndexedMapOfShape as NumberedShapes
    from OCP.TopTools import TopTools_ListOfShape as ShapeList
    from OCP.TopTools import TopTools_MapOfShape as ShapeSet

    as_compound, as_edge, as_face = TopoDS.Compound_s, TopoDS.Edge_s, TopoDS.Face_s
    as_shell, as_solid, as_vertex, as_wire = TopoDS.Shell_s, TopoDS.Solid_s, TopoDS.Vertex_s, TopoDS.Wire_s

__all__ = [
    "IntegerArray",
    "LabelSequence",
    "NumberedShapes",
    "Point2dArray",
    "PointArray",
    "PointGrid",
    "RealArray",
    "RealGrid",
    "ShapeList",
    "ShapeSet",
    "ShapesOfShape",
    "as_compound",
    "as_edge",
    "as_face",
    "as_shell",
    "as_solid",
    "as_vertex",
    "as_wire",
    "kernel_origin",
]


def kernel_origin() -> str:
    """The version that the kernel itself says it has, and the file it was loaded from."""
    return f"OCP {OCP.__version__}, {OCP.__file__}"
