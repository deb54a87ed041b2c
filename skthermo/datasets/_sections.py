"""Cross-sections of steel members, upright: area, second moments and torsion constant.

Dimensions in m; ``I_yy`` resists vertical bending of a level member, ``I_zz`` lateral bending.
"""

import math

import numpy as np

Section = dict[str, float]


def box(depth: float, width: float, thickness: float) -> Section:
    """Closed box of one wall thickness; torsion by Bredt."""
    d, w, t = depth, width, thickness
    hole = (2 * t - w, d - 2 * t, 0.0, 0.0)
    return of_rectangles((w, d, 0.0, 0.0), hole) | {"J": 2 * t * ((d - t) * (w - t)) ** 2 / (d + w - 2 * t)}


def tee(stem: float, flange: float, thickness: float) -> Section:
    """Tee of overall depth ``stem``; open, thin-walled torsion."""
    t, web = thickness, stem - thickness
    return of_rectangles((flange, t, 0.0, stem - t / 2), (t, web, 0.0, web / 2)) | {"J": (flange + web) * t**3 / 3}


def channel(depth: float, width: float, thickness: float) -> Section:
    """Channel with its web upright; open, thin-walled torsion."""
    d, t, flange = depth, thickness, width - thickness
    flanges = [(flange, t, t + flange / 2, z) for z in ((t - d) / 2, (d - t) / 2)]
    return of_rectangles((t, d, t / 2, 0.0), *flanges) | {"J": (d + 2 * flange) * t**3 / 3}


def rectangle(depth: float, width: float) -> Section:
    """Solid rectangle, deeper than wide; torsion by Roark's formula."""
    ratio = width / depth
    return of_rectangles((width, depth, 0.0, 0.0)) | {
        "J": depth * width**3 * (1 / 3 - 0.21 * ratio * (1 - ratio**4 / 12))
    }


def pipe(diameter: float, thickness: float) -> Section:
    """Round pipe."""
    outer, inner = diameter / 2, diameter / 2 - thickness
    inertia = math.pi * (outer**4 - inner**4) / 4
    return {"A": math.pi * (outer**2 - inner**2), "I_yy": inertia, "I_zz": inertia, "J": 2 * inertia}


def of_rectangles(*rectangles: tuple[float, float, float, float]) -> Section:
    """Area and second moments of rectangles (width, depth, y and z of the centre); holes have a negative width."""
    width, depth, y, z = np.transpose(rectangles)
    area = width * depth
    y, z = y - area @ y / area.sum(), z - area @ z / area.sum()
    return {
        "A": float(area.sum()),
        "I_yy": float((area * (depth**2 / 12 + z**2)).sum()),
        "I_zz": float((area * (width**2 / 12 + y**2)).sum()),
    }


def times(number: float, section: Section) -> Section:
    """Several members side by side that bend independently."""
    return {name: number * value for name, value in section.items()}
