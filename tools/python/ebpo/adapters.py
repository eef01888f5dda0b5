"""Adapters for trimesh, Open3D and PyVista. They are imported when they are needed."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .model import Model
from .parts import Mass, Mesh
from .signatures import ArrayLike, Bools, Doubles, Int64s, Uint32s, Vertices

if TYPE_CHECKING:
    import pyvista  # type: ignore[import-not-found, import-untyped, unused-ignore]
    import trimesh  # type: ignore[import-not-found, import-untyped, unused-ignore]


def arrays_of(mesh: Any) -> tuple[Any, Any]:
    """Return the vertices and faces of a pair of arrays, or of a mesh of trimesh, Open3D or PyVista.

    Polygons of PyVista become triangles. Scenes of trimesh become one mesh. Raises TypeError for other objects.
    """
    if hasattr(mesh, "points") and hasattr(mesh, "triangulate"):  # PyVista
        flat = mesh.triangulate()
        if hasattr(flat, "celltypes") or not hasattr(flat, "faces"):  # cells of volumes; older grids have faces too
            raise TypeError(f"{type(mesh).__name__} of PyVista has no faces; convert its extract_surface()")
        return np.asarray(mesh.points), np.asarray(flat.faces).reshape(-1, 4)[:, 1:]
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):  # tensors of Open3D
        return mesh.vertex.positions.cpu().numpy(), mesh.triangle.indices.cpu().numpy()
    if hasattr(mesh, "geometry") and hasattr(mesh, "to_mesh"):  # trimesh.Scene
        mesh = mesh.to_mesh()
    for name in ("faces", "triangles"):  # trimesh, Open3D
        if hasattr(mesh, "vertices") and hasattr(mesh, name):
            return np.asarray(mesh.vertices), np.asarray(getattr(mesh, name))
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return np.asanyarray(mesh[0]), np.asanyarray(mesh[1])  # of any class, such as masked arrays
    raise TypeError(f"{type(mesh).__name__} is neither a path, (vertices, faces) nor a mesh of trimesh, Open3D or PyVista")


def to_trimesh(model: Model, process: bool) -> trimesh.Trimesh:
    """Return the mesh as a trimesh.Trimesh."""
    import trimesh
    mesh = model.mesh(order="source" if "maps" in model.info.parts else "file")
    return trimesh.Trimesh(vertices=np.array(mesh.vertices), faces=np.array(mesh.faces, dtype=np.int64),
                           process=process)


def to_pyvista(model: Model, level: int | None = None) -> pyvista.PolyData:
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


def faces_of_vtk(faces: Uint32s) -> Int64s:
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
    file has source indices.

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
        self._mesh: Mesh | None = None
        self._mass: Mass | None = None
        self.ray = TrimeshRays(model)
        self.nearest = TrimeshNearest(model)

    def contains(self, points: ArrayLike) -> Bools:
        """Return True for points inside: (n,) bool."""
        return self.model.inside(points)

    def signed_distance(self, points: ArrayLike) -> Doubles:
        """Return distances: (n,) float64, positive inside as in trimesh."""
        return self.nearest.signed_distance(points)

    def _read(self) -> Mesh:
        if self._mesh is None:
            self._mesh = self.model.mesh(order="source" if "maps" in self.model.info.parts else "file")
        return self._mesh

    def _measured(self) -> Mass:
        if self._mass is None:
            self._mass = self.model.measure()
        return self._mass

    @property
    def vertices(self) -> Vertices:
        return self._read().vertices

    @property
    def faces(self) -> Uint32s:
        return self._read().faces

    @property
    def bounds(self) -> Doubles:
        return self.model.bounds

    @property
    def extents(self) -> Doubles:
        low, high = self.bounds
        return np.asarray(high - low)

    @property
    def area(self) -> float:
        return self._measured().area

    @property
    def volume(self) -> float:
        return self._measured().volume

    @property
    def center_mass(self) -> Doubles:
        return self._measured().centroid

    @property
    def is_watertight(self) -> bool:
        return bool(self.model.info.solid)


class TrimeshNearest:
    """The queries of trimesh.proximity.ProximityQuery."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def on_surface(self, points: ArrayLike) -> tuple[Doubles, Doubles, Int64s]:
        """Return the nearest points (n, 3), distances (n,), which are not negative, and faces (n,)."""
        distance, point, _, face = self._model.distance(points, signed=False)
        return point, distance, face

    def signed_distance(self, points: ArrayLike) -> Doubles:
        """Return distances: (n,) float64, positive inside."""
        return np.asarray(-self._model.distance(points).distance + 0.0)


class TrimeshRays:
    """The queries of trimesh.ray. Directions have any length."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> Bools:
        """Return True for rays that hit a face: (n,) bool."""
        return self._model.ray_any(ray_origins, ray_directions)

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> Int64s:
        """Return the first face of each ray: (n,) int64, -1: none."""
        return self._model.ray(ray_origins, ray_directions).face

    def intersects_id(self, ray_origins: ArrayLike, ray_directions: ArrayLike, return_locations: bool = False,
                      multiple_hits: bool = True) -> tuple[Any, ...]:
        """Return the faces (k,) and rays (k,) of hits and, with return_locations, the points (k, 3)."""
        locations, rays, faces = self.intersects_location(ray_origins, ray_directions, multiple_hits)
        return (faces, rays, locations) if return_locations else (faces, rays)

    def intersects_location(self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
                            ) -> tuple[Doubles, Int64s, Int64s]:
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

    def contains_points(self, points: ArrayLike) -> Bools:
        """Return True for points inside: (n,) bool."""
        return self._model.inside(points)
