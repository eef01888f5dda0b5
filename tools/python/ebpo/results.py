"""Results of the queries of a model, as named tuples of arrays."""
from __future__ import annotations

from typing import NamedTuple

from .signatures import Doubles, Int8s, Int32s, Int64s


class Located(NamedTuple):
    """Results of `Model.locate`.

    where: int8, a Where.
    winding: int32, 0 on faces.
    doubt: float64, the greatest possible distance to the surface where `where` is MAYBE; else 0.
    """

    where: Int8s
    winding: Int32s
    doubt: Doubles


class Nearest(NamedTuple):
    """Results of `Model.distance`.

    distance: float64. point, normal: (.., 3) float64. face: int64.
    """

    distance: Doubles
    point: Doubles
    normal: Doubles
    face: Int64s


class Bounds(NamedTuple):
    """Bounds of distances.

    lo, hi: float64, unsigned. The distance is certainly in [lo, hi].
    """

    lo: Doubles
    hi: Doubles


class Hits(NamedTuple):
    """Results of `Model.ray`.

    t: float64. face: int64. side: int32.
    """

    t: Doubles
    face: Int64s
    side: Int32s


class AllHits(NamedTuple):
    """Results of `Model.ray_all`: k hits of n rays, ray after ray.

    t, face, side: (k,), as in `Hits`.
    ray: (k,) int64, the index of the hit's ray.
    begin: (n + 1,) int64, the index of each ray's first hit.
    """

    t: Doubles
    face: Int64s
    side: Int32s
    ray: Int64s
    begin: Int64s
