"""A bracket with holes and fillets, light-weighted: its STEP file is filled with gyroid, without and with a skin."""

import cadquery as cq

from gyroid_cad import fill


def bracket() -> cq.Workplane:
    """An angle of two 6 mm plates, with bolt holes and rounded edges."""
    angle = cq.Workplane("XZ").polyline([(0, 0), (26, 0), (26, 6), (6, 6), (6, 20), (0, 20)]).close().extrude(-14)
    angle = angle.edges(cq.selectors.BoxSelector((5, -1, 5), (7, 15, 7))).fillet(3)
    angle = angle.edges("|Z").edges(">X").fillet(3)
    angle = angle.faces(">Z").edges("|X").fillet(3)
    bolts = cq.Workplane().pushPoints([(13, 7), (21, 7)]).circle(1.7).extrude(10)
    pin = cq.Workplane("YZ").center(7, 13).circle(2.2).extrude(10)
    return angle.cut(bolts).cut(pin)


if __name__ == "__main__":
    part = "bracket.step"
    cq.exporters.export(bracket(), part)
    material = {"cell_size": 8, "density": 0.30, "material_density": 2.7}
    light = fill(part, **material)
    light.write("bracket_light.step")
    skinned = fill(part, **material, skin=1.0, openings=[">X"])
    skinned.write("bracket_with_skin.step")
    masses = [light.report.part_mass, light.report.mass, skinned.report.mass]
    print("solid {:.2f} g, filled {:.2f} g, with skin {:.2f} g".format(*masses))
