"""Header, products, units, assembly and colours of a STEP file: all that is round its solids."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gyroid_cad.common.choices import Schema
from gyroid_cad.step.bodies import LEAST_GAP, WritableBody
from gyroid_cad.step.geometry import AxisPlacement
from gyroid_cad.step.header import StepHeader, header_section
from gyroid_cad.step.text import StepText, quoted, real, refs
from gyroid_cad.wall.areas import ShapeSize, joint_size

__all__ = ["UNLABELLED", "BodyLabels", "Occurrence", "StepPart", "parts_apart", "write_products"]

_HOME: AxisPlacement = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
# Of a schema: name and version, and of its application: name, year and purpose.
_SCHEMAS: Mapping[Schema, tuple[str, str, int, str]] = {
    "ap214": (
        "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
        "automotive_design",
        2000,
        "core data for automotive mechanical design processes",
    ),
    "ap242": (
        "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {1 0 10303 442 1 1 4 }",
        "ap242_managed_model_based_3d_engineering",
        2013,
        "Managed model based 3d engineering",
    ),
}
_LINES = 0.1
_PLAIN = StepHeader()
# Of a property that receivers compare with what they find (recommended practices of the CAx Implementor Forum for
# geometric validation properties): its name, that of its item, its measure, and the power of the millimetre.
_VALIDATED = (("volume", "volume measure", "VOLUME", 3), ("surface area", "surface area measure", "AREA", 2))
# Of its value: far more than any receiver compares.
_DIGITS = 12


@dataclass(frozen=True, slots=True, eq=False)
class StepPart:
    """A part of one or several bodies, all of one kind.

    Attributes
    ----------
    name : str
    bodies : sequence of WritableBody
    colour : str
        By which STEP knows it; that of the file's reader if left out.
    body_names : sequence of str
        One a body, or none.
    body_sizes : sequence of ShapeSize
        One a body, or none; of a single body that of the product is enough.
    body_colours : sequence of str
        Likewise, instead of the part's.
    face_names, face_colours : sequence of str
        One a face, as the kernel counts them, or none.
    size : ShapeSize, optional
    """

    name: str
    bodies: Sequence[WritableBody]
    colour: str = ""
    body_names: Sequence[str] = ()
    body_sizes: Sequence[ShapeSize] = ()
    body_colours: Sequence[str] = ()
    face_names: Sequence[str] = ()
    face_colours: Sequence[str] = ()
    size: ShapeSize | None = None


@dataclass(frozen=True, slots=True)
class BodyLabels:
    """Names and colours that bodies have in a file; each may be left out.

    Attributes
    ----------
    names, colours : sequence of str
        One a body; colours by which STEP knows them.
    face_names : sequence of str
        One a face, body by body.
    """

    names: Sequence[str] = ()
    colours: Sequence[str] = ()
    face_names: Sequence[str] = ()


UNLABELLED = BodyLabels()


@dataclass(frozen=True, slots=True)
class Occurrence:
    """A place where an assembly has a part.

    Attributes
    ----------
    part : int
    name : str
    frame : AxisPlacement
    """

    part: int
    name: str
    frame: AxisPlacement


def parts_apart(part: StepPart, face_counts: Sequence[int]) -> tuple[list[StepPart], list[Occurrence]]:
    """Return the bodies of a part as parts of an assembly: of one name together, those that have none each by itself.

    Each stands where it is.

    Parameters
    ----------
    part : StepPart
    face_counts : sequence of int
        Numbers of faces, one a body.
    """
    names = list(part.body_names) or [f"{part.name} {number}" for number in range(1, len(part.bodies) + 1)]
    ends = np.cumsum([0, *face_counts]).tolist()
    parts = []
    for name in dict.fromkeys(names):
        own = [number for number, called in enumerate(names) if called == name]
        sizes = [part.body_sizes[number] for number in own] if part.body_sizes else []
        parts.append(
            StepPart(
                name,
                [part.bodies[number] for number in own],
                part.colour,
                body_names=[name] * len(own),
                body_sizes=sizes,
                body_colours=[part.body_colours[number] for number in own] if part.body_colours else [],
                face_names=[called for number in own for called in part.face_names[ends[number] : ends[number + 1]]],
                size=joint_size(sizes) if sizes else None,
            )
        )
    return parts, [Occurrence(number, one.name, _HOME) for number, one in enumerate(parts)]


def write_products(
    path: Path,
    name: str,
    parts: Sequence[StepPart],
    occurrences: Sequence[Occurrence] = (),
    header: StepHeader = _PLAIN,
    size: ShapeSize | None = None,
) -> None:
    """Write a file of parts.

    Parameters
    ----------
    path : Path
    name : str
        Of the product; of the assembly, if there are occurrences.
    parts : sequence of StepPart
        One, if there are no occurrences.
    occurrences : sequence of Occurrence
    header : StepHeader
    size : ShapeSize, optional
        Of all of it, for receivers to compare what they find with.
    """
    extent = max(body.extent for part in parts for body in part.bodies)
    with path.open("wb") as out:
        out.write((header_section(name, header, _SCHEMAS[header.schema][0]) + "DATA;\n").encode("ascii"))
        text = StepText(out, extent)
        products = _Products(text, header.schema)
        whole = products.assembly(name, parts, occurrences) if occurrences else products.part(parts[0], name)
        if size is not None:
            products.validate(whole.shape, whole.context, size)
        out.write(b"ENDSEC;\nEND-ISO-10303-21;\n")


@dataclass(slots=True)
class _Product:
    """Numbers of a product's entities."""

    definition: int
    shape: int
    representation: int = 0
    context: int = 0
    styled: list[int] = field(default_factory=list)


class _Products:
    def __init__(self, text: StepText, schema: Schema) -> None:
        self.text = text
        _, application, year, purpose = _SCHEMAS[schema]
        self._application = text.add(f"APPLICATION_CONTEXT('{purpose}')")
        text.add(
            f"APPLICATION_PROTOCOL_DEFINITION('international standard','{application}',{year},#{self._application})"
        )

    def assembly(self, name: str, parts: Sequence[StepPart], occurrences: Sequence[Occurrence]) -> _Product:
        assembly = self._product(name)
        places = [self.text.frame(*one.frame) for one in occurrences]
        assembly.context = self._context(max(body.gap for part in parts for body in part.bodies))
        items = refs(dict.fromkeys([self.text.frame(*_HOME), *places]))
        assembly.representation = self.text.add(f"SHAPE_REPRESENTATION('',{items},#{assembly.context})")
        self._define(assembly)
        made = [self.part(part, part.name) for part in parts]
        for number, (one, place) in enumerate(zip(occurrences, places, strict=True), 1):
            self._occurrence(number, one.name, place, assembly, made[one.part])
        return assembly

    def _product(self, name: str) -> _Product:
        add = self.text.add
        context = self.text.once(f"PRODUCT_CONTEXT('',#{self._application},'mechanical')")
        product = add(f"PRODUCT({quoted(name)},{quoted(name)},'',(#{context}))")
        add(f"PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#{product}))")
        formation = add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
        design = self.text.once(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{self._application},'design')")
        definition = add(f"PRODUCT_DEFINITION('design','',#{formation},#{design})")
        return _Product(definition, add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})"))

    def part(self, part: StepPart, name: str) -> _Product:
        product = self._product(name)
        names, face_names = iter(part.body_names), iter(part.face_names)
        numbers = [body.write(self.text, next(names, ""), face_names) for body in part.bodies]
        product.context = self._context(max(body.gap for body in part.bodies))
        items = refs([self.text.frame(*_HOME), *(body for body, _ in numbers)])
        kind = "ADVANCED_BREP" if part.bodies[0].solid else "MANIFOLD_SURFACE"
        product.representation = self.text.add(f"{kind}_SHAPE_REPRESENTATION('',{items},#{product.context})")
        self._define(product)
        if part.colour or part.body_colours:
            self._colour(part, numbers, product.context)
        if part.size is not None:
            self.validate(product.shape, product.context, part.size)
        if len(numbers) > 1 and part.body_sizes:
            for (body, _), size in zip(numbers, part.body_sizes, strict=True):
                self.validate(self._aspect(product, body), product.context, size)
        return product

    def _aspect(self, product: _Product, body: int) -> int:
        """Make a body something that has properties of its own, as the practice does."""
        add = self.text.add
        aspect = add(f"SHAPE_ASPECT('','',#{product.shape},.F.)")
        add(f"GEOMETRIC_ITEM_SPECIFIC_USAGE('','',#{aspect},#{product.representation},#{body})")
        return aspect

    def validate(self, shape: int, context: int, size: ShapeSize) -> None:
        """Say how large a shape is, of a product or an aspect of it, and where its centre is."""
        add, once = self.text.add, self.text.once
        for (name, item, measure, power), value in zip(_VALIDATED, (size.volume, size.area), strict=True):
            if not value:
                continue
            shown = real(float(f"{value:.{_DIGITS}g}"))
            unit = once(f"DERIVED_UNIT({refs([once(f'DERIVED_UNIT_ELEMENT(#{self._millimetre()},{power}.)')])})")
            measured = add(f"MEASURE_REPRESENTATION_ITEM('{item}',{measure}_MEASURE({shown}),#{unit})")
            self._property(shape, context, name, measured)
        if size.centroid is not None:
            place = ",".join(real(float(f"{coordinate:.{_DIGITS}g}")) for coordinate in size.centroid)
            self._property(shape, context, "centroid", add(f"CARTESIAN_POINT('centre point',({place}))"))

    def _property(self, shape: int, context: int, name: str, item: int) -> None:
        representation = self.text.add(f"REPRESENTATION('{name}',(#{item}),#{context})")
        defined = self.text.add(f"PROPERTY_DEFINITION('geometric validation property','{name}',#{shape})")
        self.text.add(f"PROPERTY_DEFINITION_REPRESENTATION(#{defined},#{representation})")

    def _define(self, product: _Product) -> None:
        self.text.add(f"SHAPE_DEFINITION_REPRESENTATION(#{product.shape},#{product.representation})")

    def _context(self, gap: float) -> int:
        """Units, and how far apart may be what belongs together."""
        once = self.text.once
        length = self._millimetre()
        angle = once("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        solid_angle = once("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        distance = real(_rounded_up(max(gap, LEAST_GAP)))
        uncertainty = once(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({distance}),#{length},"
            "'distance_accuracy_value','confusion accuracy')"
        )
        return self.text.add(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)"
            f"GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT({refs((length, angle, solid_angle))})"
            "REPRESENTATION_CONTEXT('','3D'))"
        )

    def _millimetre(self) -> int:
        return self.text.once("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")

    def _occurrence(self, number: int, name: str, place: int, assembly: _Product, part: _Product) -> None:
        add = self.text.add
        usage = add(
            f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{number}',{quoted(name)},'',#{assembly.definition},#{part.definition},$)"
        )
        shape = add(f"PRODUCT_DEFINITION_SHAPE('Placement','Placement of an item',#{usage})")
        move = add(f"ITEM_DEFINED_TRANSFORMATION('','',#{self.text.frame(*_HOME)},#{place})")
        relation = add(
            f"(REPRESENTATION_RELATIONSHIP('','',#{part.representation},#{assembly.representation})"
            f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{move})SHAPE_REPRESENTATION_RELATIONSHIP())"
        )
        add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})")

    def _colour(self, part: StepPart, numbers: list[tuple[int, list[int]]], context: int) -> None:
        colours, styled = iter(part.face_colours), []
        for (solid, faces), own in zip(numbers, part.body_colours or [part.colour] * len(numbers), strict=True):
            whole = self._style(own, with_lines=True)
            of_solid = self.text.add(f"STYLED_ITEM('color',(#{whole}),#{solid})")
            others = ((face, colour) for face, colour in zip(faces, colours, strict=False) if colour != own)
            styled += [
                of_solid,
                *(
                    self.text.add(
                        f"OVER_RIDING_STYLED_ITEM('overriding color',(#{self._style(one)}),#{face},#{of_solid})"
                    )
                    for face, one in others
                ),
            ]
        self.text.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{refs(styled)},#{context})")

    def _style(self, colour: str, with_lines: bool = False) -> int:
        once = self.text.once
        known = once(f"DRAUGHTING_PRE_DEFINED_COLOUR('{colour}')")
        paint = once(f"FILL_AREA_STYLE_COLOUR('',#{known})")
        fill = once(f"FILL_AREA_STYLE('',(#{paint}))")
        area = once(f"SURFACE_STYLE_FILL_AREA(#{fill})")
        side = once(f"SURFACE_SIDE_STYLE('',(#{area}))")
        styles = [once(f"SURFACE_STYLE_USAGE(.BOTH.,#{side})")]
        if with_lines:
            font = once("DRAUGHTING_PRE_DEFINED_CURVE_FONT('continuous')")
            styles.append(once(f"CURVE_STYLE('',#{font},POSITIVE_LENGTH_MEASURE({real(_LINES)}),#{known})"))
        return once(f"PRESENTATION_STYLE_ASSIGNMENT({refs(styles)})")


def _rounded_up(value: float) -> float:
    """The value to one digit, not below it."""
    step: float = 10.0 ** math.floor(math.log10(value))
    # A value that is a step itself, but for rounding, stays.
    return float(f"{math.ceil(value / step - 1e-9) * step:.1g}")
