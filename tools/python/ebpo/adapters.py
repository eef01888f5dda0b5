"""Adapters for trimesh and PyVista. They are imported when they are needed."""
from __future__ import annotations

from typing import Any

import numpy as np

from .model import Model


def to_trimesh(model: Model, **options: Any) -> Any:
    """Return the mesh as a trimesh.Trimesh; options are those of trimesh. Unprocessed by default."""
    import trimesh
    mesh = model.mesh(order="source" if "maps" in model.info.parts else "file")
    return trimesh.Trimesh(vertices=np.array(mesh.vertices), faces=np.array(mesh.faces, dtype=np.int64),
                           **{"process": False, **options})


def from_trimesh(mesh: Any, output: Any, **options: Any) -> Model:
    """Convert a trimesh.Trimesh, or another object with vertices and faces, as `convert` does."""
    from .build import convert
    return convert((mesh.vertices, mesh.faces), output, **options)


def to_pyvista(model: Model, level: int | None = None) -> Any:
    """Return the mesh as a pyvista.PolyData, or a level's envelopes with octcode, type and volume of cells."""
    import pyvista
    if level is None:
        mesh = model.mesh(order="source" if "maps" in model.info.parts else "file")
        return pyvista.PolyData(np.array(mesh.vertices), faces_of_vtk(mesh.faces))
    given = model.level(level)
    data = pyvista.PolyData(np.array(given.vertices), faces_of_vtk(given.faces))
    for name in ("octcode", "type", "volume"):
        data.cell_data[name] = getattr(given, name)[given.node]
    return data


def faces_of_vtk(faces: np.ndarray) -> np.ndarray:
    """Return VTK's flat array of faces: for each face a 3 and its three indices."""
    out = np.empty((len(faces), 4), np.int64)
    out[:, 0], out[:, 1:] = 3, faces
    return out.ravel()


class TrimeshLike:
    """A model with the queries of a trimesh.Trimesh: the same array shapes and signs, but exact results.

    contains, ray.intersects_any, intersects_first, intersects_id, intersects_location, contains_points;
    nearest.on_surface, signed_distance; bounds, extents, area, volume, center_mass, is_watertight,
    vertices, faces.

    Points on faces are contained. Face indices are those of `faces`, which is in the source's order if the
    file has maps.

    >>> mesh = cube.as_trimesh()
    >>> mesh.contains([[.5, .5, .5], [2, 0, 0]])
    array([ True, False])
    >>> mesh.nearest.signed_distance([[.5, .25, .5]])
    array([0.25])
    >>> mesh.is_watertight, mesh.volume
    (True, 1.0)
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self._mesh: Any = None
        self._mass: Any = None
        self.ray = TrimeshRays(model)
        self.nearest = TrimeshNearest(model)

    def contains(self, points: Any) -> np.ndarray:
        """Return True for points inside: (n,) bool."""
        return self.model.inside(points)

    def signed_distance(self, points: Any) -> np.ndarray:
        """Return distances: (n,) float64, positive inside as in trimesh."""
        return self.nearest.signed_distance(points)

    def _read(self) -> Any:
        if self._mesh is None:
            self._mesh = self.model.mesh(order="source" if "maps" in self.model.info.parts else "file")
        return self._mesh

    def _measured(self) -> Any:
        if self._mass is None:
            self._mass = self.model.measure()
        return self._mass

    vertices = property(lambda self: self._read().vertices)
    faces = property(lambda self: self._read().faces)
    bounds = property(lambda self: np.array([self._read().vertices.min(axis=0), self._read().vertices.max(axis=0)],
                                            dtype=np.float64))
    extents = property(lambda self: np.diff(self.bounds, axis=0)[0])
    area = property(lambda self: self._measured().area)
    volume = property(lambda self: self._measured().volume)
    center_mass = property(lambda self: self._measured().centroid)
    is_watertight = property(lambda self: bool(self.model.info.solid))


class TrimeshNearest:
    """The queries of trimesh.proximity.ProximityQuery."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def on_surface(self, points: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the nearest points (n, 3), distances (n,), which are not negative, and faces (n,)."""
        distance, point, _, face = self._model.distance(points, signed=False)
        return point, distance, face

    def signed_distance(self, points: Any) -> np.ndarray:
        """Return distances: (n,) float64, positive inside."""
        return -self._model.distance(points).distance + 0.0


class TrimeshRays:
    """The queries of trimesh.ray. Directions have any length."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def intersects_any(self, ray_origins: Any, ray_directions: Any) -> np.ndarray:
        """Return True for rays that hit a face: (n,) bool."""
        return self._model.ray_any(ray_origins, ray_directions)

    def intersects_first(self, ray_origins: Any, ray_directions: Any) -> np.ndarray:
        """Return the first face of each ray: (n,) int64, -1: none."""
        return self._model.ray(ray_origins, ray_directions).face

    def intersects_id(self, ray_origins: Any, ray_directions: Any, return_locations: bool = False,
                      multiple_hits: bool = True) -> tuple:
        """Return the faces (k,) and rays (k,) of hits and, with return_locations, the points (k, 3)."""
        locations, rays, faces = self.intersects_location(ray_origins, ray_directions, multiple_hits)
        return (faces, rays, locations) if return_locations else (faces, rays)

    def intersects_location(self, ray_origins: Any, ray_directions: Any, multiple_hits: bool = True
                            ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the points (k, 3), rays (k,) and faces (k,) of hits."""
        if multiple_hits:
            hits = self._model.ray_all(ray_origins, ray_directions)
            t, rays, faces = hits.t, hits.ray, hits.face
        else:
            first = self._model.ray(ray_origins, ray_directions)
            rays = np.flatnonzero(first.face >= 0)
            t, faces = first.t[rays], first.face[rays]
        o = np.asarray(ray_origins, dtype=np.float64)[rays]
        with np.errstate(invalid="ignore"):  # an infinite t gives the point nan
            return o + t[:, None] * np.asarray(ray_directions, dtype=np.float64)[rays], rays, faces

    def contains_points(self, points: Any) -> np.ndarray:
        """Return True for points inside: (n,) bool."""
        return self._model.inside(points)
