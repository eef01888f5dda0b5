"""Runs queries with one Python package: peer_packages.py PACKAGE MODEL.npz MODEL.ebpo.h5, a server for peer_page.py.

Reads one JSON object a line: {"structure": S} builds a structure, {"query": Q, "input": FILE.npz, "save": FILE.npz} runs
a query and saves its results. Prints processor seconds, and for a structure the growth of the resident memory in bytes.
A package is used as its authors intend: one call for all points, in arrays of its type and layout, which are made
before the measurement. The process runs on one core, so each package has one thread.
"""
import importlib
import importlib.metadata
import json
import os
import sys
import time

import numpy as np


def resident():
    with open("/proc/self/statm", encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def single(rows, order="C"):
    return np.array(rows, dtype=np.float32, order=order)


class Ours:
    def __init__(self, vertices, faces, file):
        import ebpo
        self.ebpo, self.file = ebpo, file

    def points(self):
        self.model = self.ebpo.open(self.file)
        self.model.model  # loads the whole model; queries would load parts first

    inside_structure = nearest_structure = rays_structure = points

    def pairs_structure(self):
        self.points()
        self.pair = self.ebpo.Collider(self.model, self.model)

    def inside(self, points):
        return lambda: self.model.inside(points, threads=1), lambda result: {"inside": result}

    def nearest(self, points):
        return (lambda: self.model.distance(points, signed=False, threads=1),
                lambda result: {"distance": result.distance, "face": result.face})

    def rays(self, origins, directions):
        return (lambda: self.model.ray(origins, directions, threads=1),
                lambda result: {"t": result.t, "face": result.face})

    def contact(self, matrices):
        poses = list(map(self.ebpo.collide.pose_of, matrices))
        return (lambda: [self.pair.first(pose_b=pose) for pose in poses],
                lambda result: {"contact": [pair is not None for pair in result]})

    def gap(self, matrices):
        poses = list(map(self.ebpo.collide.pose_of, matrices))
        return (lambda: [self.pair.distance(pose_b=pose).hi for pose in poses], lambda result: {"gap": result})


class Mesh:
    """The mesh in the types that most packages accept. Modules are imported before memory is measured."""

    modules: list = []

    def __init__(self, vertices, faces, _file):
        self.package = [importlib.import_module(name) for name in self.modules]
        self.vertices, self.faces = vertices, faces
        self.triangles = np.array(faces, dtype=np.int64)


class Embree(Mesh):
    """embreex, a binding of Embree 4; a robust scene."""

    modules = ["embreex.rtcore_scene", "embreex.mesh_construction"]

    def rays_structure(self):
        self.scene = self.package[0].EmbreeScene(robust=True)
        self.package[1].TriangleMesh(self.scene, single(self.vertices), self.faces.astype(np.int32))
        self.scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))  # commits the scene

    def rays(self, origins, directions):
        origins, directions = single(origins), single(directions)

        def read(result):
            return {"t": np.where(result["primID"] < 0, np.inf, result["tfar"]), "face": result["primID"]}
        return lambda: self.scene.run(origins, directions, query="INTERSECT", output=1), read


class Fcpw(Mesh):
    """fcpw, 8-wide nodes; the model is scaled by a power of two, because contains() assumes a small model."""

    modules = ["fcpw"]

    def nearest_structure(self):
        fcpw, = self.package
        self.scale = 2.0 ** -np.ceil(np.log2(np.abs(self.vertices).max()))
        self.scene, self.found = fcpw.scene_3D(), fcpw.interaction_3D_list()
        self.scene.set_object_count(1)
        self.scene.set_object_vertices(single(self.vertices * self.scale, "F"), 0)
        self.scene.set_object_triangles(np.array(self.faces, dtype=np.int32, order="F"), 0)
        self.scene.build(fcpw.aggregate_type.bvh_surface_area, True)

    inside_structure = rays_structure = nearest_structure

    def inside(self, points):
        fcpw, = self.package  # contains() does not write into an array
        points, result = fcpw.float_3D_list(list(single(points * self.scale))), fcpw.uint32_list([0] * len(points))
        return lambda: self.scene.contains(points, result), lambda _: {"inside": np.array(list(result)) != 0}

    def read(self, name):
        face = np.array([found.primitive_index for found in self.found])
        return {name: np.where(face < 0, np.inf, [found.d for found in self.found]) / self.scale, "face": face}

    def nearest(self, points):
        points, radii = single(points * self.scale, "F"), np.full(len(points), np.inf, np.float32)
        return lambda: self.scene.find_closest_points(points, radii, self.found), lambda _: self.read("distance")

    def rays(self, origins, directions):
        origins, directions = single(origins * self.scale, "F"), single(directions, "F")
        bounds = np.full(len(origins), np.inf, np.float32)
        return lambda: self.scene.intersect(origins, directions, bounds, self.found), lambda _: self.read("t")


class Libigl(Mesh):
    """libigl: FastWindingNumberBVH, its newest test of the inside, and AABB, in double precision."""

    modules = ["igl", "igl.copyleft.cgal"]

    def inside_structure(self):
        self.winding = self.package[0].FastWindingNumberBVH()
        self.winding.init(self.vertices, self.triangles)

    def nearest_structure(self):
        self.tree = self.package[0].AABB()
        self.tree.init(self.vertices, self.triangles)

    rays_structure = nearest_structure

    def inside(self, points):
        return lambda: self.winding.winding_number(points), lambda result: {"inside": result > 0.5}

    def nearest(self, points):
        return (lambda: self.tree.squared_distance(self.vertices, self.triangles, points),
                lambda result: {"distance": np.sqrt(result[0]), "face": result[1]})

    def rays(self, origins, directions):
        return (lambda: self.tree.intersect_ray_first(self.vertices, self.triangles, origins, directions),
                lambda result: {"t": np.where(result[0] < 0, np.inf, result[1]), "face": result[0]})

    def pairs_structure(self):
        return False  # nothing is built in advance

    def contact(self, matrices):
        moved = [self.vertices @ pose[:3, :3].T + pose[:3, 3] for pose in matrices]

        def run():
            return [self.package[1].intersect_other(self.vertices, self.triangles, other, self.triangles, first_only=True)
                    for other in moved]
        return run, lambda result: {"contact": [len(pairs[0]) > 0 for pairs in result]}


class Open3d(Mesh):
    """Open3D's RaycastingScene, over its Embree."""

    modules = ["open3d"]

    def nearest_structure(self):
        core = self.package[0].core
        self.tensor = core.Tensor
        self.scene = self.package[0].t.geometry.RaycastingScene(nthreads=1)
        self.scene.add_triangles(core.Tensor(single(self.vertices)), core.Tensor(self.faces.astype(np.uint32)))
        self.scene.compute_distance(core.Tensor(np.zeros((1, 3), np.float32)), nthreads=1)  # builds the tree

    inside_structure = rays_structure = nearest_structure

    def inside(self, points):
        points = self.tensor(single(points))
        return (lambda: self.scene.compute_occupancy(points, nthreads=1),
                lambda result: {"inside": result.numpy() > 0})

    def nearest(self, points):
        tensor = self.tensor(single(points))

        def read(result):
            return {"distance": np.linalg.norm(result["points"].numpy() - points, axis=1),
                    "face": result["primitive_ids"].numpy().astype(np.int64)}
        return lambda: self.scene.compute_closest_points(tensor, nthreads=1), read

    def rays(self, origins, directions):
        rays = self.tensor(single(np.hstack((origins, directions))))

        def read(result):
            t = result["t_hit"].numpy()
            return {"t": t, "face": np.where(np.isinf(t), -1, result["primitive_ids"].numpy().astype(np.int64))}
        return lambda: self.scene.cast_rays(rays, nthreads=1), read


class Trimesh(Mesh):
    """trimesh with embreex, rtree and python-fcl."""

    modules = ["trimesh", "embreex", "rtree", "fcl"]

    def nearest_structure(self):
        self.mesh = self.package[0].Trimesh(self.vertices, self.faces, process=False)
        self.mesh.nearest.on_surface([[0, 0, 0]])

    def inside_structure(self):
        self.mesh = self.package[0].Trimesh(self.vertices, self.faces, process=False)
        self.mesh.contains([self.vertices.mean(axis=0)])

    rays_structure = inside_structure

    def inside(self, points):
        return lambda: self.mesh.contains(points), lambda result: {"inside": result}

    def nearest(self, points):
        return (lambda: self.mesh.nearest.on_surface(points),
                lambda result: {"distance": result[1], "face": result[2]})

    def rays(self, origins, directions):
        def read(result):
            t, face = np.full(len(origins), np.inf), np.full(len(origins), -1)
            faces, rays, at = result
            t[rays] = (((at - origins[rays]) * directions[rays]).sum(axis=1)
                       / (directions[rays] ** 2).sum(axis=1))
            face[rays] = faces
            return {"t": t, "face": face}
        return (lambda: self.mesh.ray.intersects_id(origins, directions, multiple_hits=False, return_locations=True),
                read)

    def pairs_structure(self):
        trimesh = self.package[0]
        self.mesh = trimesh.Trimesh(self.vertices, self.faces, process=False)
        self.manager = trimesh.collision.CollisionManager()
        self.manager.add_object("a", self.mesh)
        self.other = trimesh.collision.CollisionManager()
        self.other.add_object("b", self.mesh)

    def posed(self, matrices, query):
        def run():
            out = []
            for pose in matrices:
                self.other.set_transform("b", pose)
                out.append(query(self.other))
            return out
        return run

    def contact(self, matrices):
        return self.posed(matrices, self.manager.in_collision_other), lambda result: {"contact": result}

    def gap(self, matrices):
        return self.posed(matrices, self.manager.min_distance_other), lambda result: {"gap": result}


class Coal(Mesh):
    """Coal: BVHModelOBBRSS; break_distance is 0, which makes it faster."""

    modules = ["coal"]

    def pairs_structure(self):
        coal, = self.package
        self.coal, self.model = coal, coal.BVHModelOBBRSS()
        self.model.beginModel(len(self.faces), len(self.vertices))
        self.model.addVertices(self.vertices)
        self.model.addTriangles(self.triangles)
        self.model.endModel()
        self.still = coal.Transform3s()

    def transforms(self, matrices):
        return [self.coal.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy()) for pose in matrices]

    def contact(self, matrices):
        coal, request = self.coal, self.coal.CollisionRequest(self.coal.CollisionRequestFlag.NO_REQUEST, 1)
        request.break_distance = 0
        transforms = self.transforms(matrices)

        def run():
            return [coal.collide(self.model, self.still, self.model, transform, request, coal.CollisionResult())
                    for transform in transforms]
        return run, lambda result: {"contact": [count > 0 for count in result]}

    def gap(self, matrices):
        coal, transforms = self.coal, self.transforms(matrices)

        def run():
            return [coal.distance(self.model, self.still, self.model, transform, coal.DistanceRequest(),
                                  coal.DistanceResult()) for transform in transforms]
        return run, lambda result: {"gap": result}


class Manifold(Mesh):
    """manifold3d: ray_cast takes one segment a call; a contact is an intersection that is not empty."""

    modules = ["manifold3d"]

    def pairs_structure(self):
        manifold3d, = self.package
        self.solid = manifold3d.Manifold(manifold3d.Mesh64(self.vertices, self.faces.astype(np.uint64)))
        if self.solid.status() != manifold3d.Error.NoError:
            raise ValueError(f"manifold3d: {self.solid.status()}")

    rays_structure = pairs_structure

    def rays(self, origins, directions):
        length = 4 * np.abs(self.vertices).max() + np.abs(origins).max()
        ends = [tuple(end) for end in origins + length * directions]
        begins = [tuple(begin) for begin in origins]

        def read(result):
            t = [hits[0].distance * length if hits else np.inf for hits in result]
            return {"t": t, "face": [hits[0].face_id if hits else -1 for hits in result]}
        return lambda: [self.solid.ray_cast(begin, end) for begin, end in zip(begins, ends)], read

    def contact(self, matrices):
        def run():
            return [(self.solid ^ self.solid.transform(pose[:3])).is_empty() for pose in matrices]
        return run, lambda result: {"contact": [not empty for empty in result]}

    def gap(self, matrices):
        reach = float(np.linalg.norm(np.ptp(self.vertices, axis=0))) / 20  # it must be known to be fast
        return (lambda: [self.solid.min_gap(self.solid.transform(pose[:3]), reach) for pose in matrices],
                lambda result: {"gap": result})


# Name on the page, class, names on PyPI (the first one gives the version).
PACKAGES = {"ebpo": (Ours, []), "embreex": (Embree, ["embreex"]), "fcpw": (Fcpw, ["fcpw"]),
            "libigl": (Libigl, ["libigl"]), "Open3D": (Open3d, ["open3d"]),
            "trimesh": (Trimesh, ["trimesh", "scipy", "rtree", "embreex", "python-fcl"]), "Coal": (Coal, ["coal"]),
            "manifold3d": (Manifold, ["manifold3d"])}


def serve(package, model, file):
    mesh = np.load(model)
    make, names = PACKAGES[package]
    peer = make(mesh["vertices"], mesh["faces"], file)
    for line in sys.stdin:
        order = json.loads(line)
        try:
            if "structure" in order:
                before = resident()
                began = time.process_time()
                built = getattr(peer, order["structure"] + "_structure")()
                report = {"version": importlib.metadata.version(names[0]) if names else ""}
                if built is not False:
                    report.update(seconds=time.process_time() - began, bytes=resident() - before)
            else:
                run, read = getattr(peer, order["query"])(**np.load(order["input"]))
                began = time.process_time()
                raw = run()
                report = {"seconds": time.process_time() - began}
                if "save" in order:
                    np.savez(order["save"], **read(raw))
        except Exception as error:  # any fault of a package is a row of the page
            report = {"fault": f"{type(error).__name__}: {error}"[:200]}
        print(json.dumps(report), flush=True)


if __name__ == "__main__":
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    serve(*sys.argv[1:])
