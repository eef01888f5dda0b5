#!/usr/bin/env python3
"""Tests what Python users expect of a package: shapes, NaN, types, exceptions, notebooks, progress, forks.

Tests with trimesh, Open3D, PyVista, tqdm and mypy are skipped where these are not installed.
"""
import concurrent.futures
import errno
import gzip
import importlib
import inspect
import multiprocessing
import os
import pathlib
import pickle
import re
import struct
import subprocess
import sys
import threading
import types
import urllib.request
import zlib

from package_support import Case, model, np, points, run

import ebpo
from ebpo import notebook

P = points(3000)
USES = '''
import numpy as np, numpy.typing as npt, ebpo
m: ebpo.Model = ebpo.open("scan.ebpo.h5", memory="1G", headers={"A": "b"})
P = np.zeros((4, 3), np.float32)
inside: npt.NDArray[np.bool_] = m.inside(P, nan="propagate")
d, point, normal, face = m.distance([[0, 0, 0]], max_distance=1)
total: float = float(d.sum()) + m.volume + m.measure().area + m.bounds.max()
hits = m.ray(P, [0, 0, 1], sides="front")
box: float = float(hits.t[0]) + int(hits.face[0])
converted: ebpo.Model = ebpo.convert((P, np.zeros((2, 3), int)), "a.ebpo.h5", weld=True, unit="mm")
c = ebpo.Catalogue.of(["a.ebpo.h5"], http={"retries": 3})
cut: npt.NDArray[np.uint32] = ebpo.boolean("A - B", [m, m], poses=[None, np.eye(4)]).faces
relation: ebpo.Relation = ebpo.Collider(m, m).relation(pose_b=ebpo.pose(translation=[1, 0, 0]))
with ebpo.open("a.ebpo.h5") as opened:
    opened.level(2).volume.sum()
'''
WRONG = '''
import ebpo
m = ebpo.open("scan.ebpo.h5")
m.inside([[0, 0, 0]], nan="ignore")
m.ray([0, 0, 0], [0, 0, 1], sides="left")
ebpo.convert("a.ply", "a.ebpo.h5", weld_all=True)
ebpo.open("a", header={"A": "b"})
ebpo.convert(17, "a.ebpo.h5")
'''


def results(m):
    """Return the results of all kinds of queries, as a list of arrays."""
    o, d = P[:50] * 3, -P[:50]
    hits = m.ray_all(o, d)
    return [*m.locate(P), m.inside(P), *m.distance(P[:200]), *m.ray(o, d), m.ray_any(o, d), *hits,
            *ebpo.Collider(m, m).pairs(pose_b=ebpo.pose(translation=[.4, .1, 0]))]


def digest(m):
    return [zlib.crc32(np.ascontiguousarray(part).tobytes()) for part in results(m)]


def query_in_process(m):
    return digest(m)


class Arrays(Case):
    def test_shapes(self):
        m, image, flat = model("scan"), P.reshape(50, 60, 3), model("scan").distance(P)
        got = m.distance(image)
        self.assertEqual([part.shape for part in got], [(50, 60), (50, 60, 3), (50, 60, 3), (50, 60)])
        self.same([part.reshape(3000, *part.shape[2:]) for part in got], flat)
        self.same([part.ravel() for part in m.locate(image)], m.locate(P))
        for query in (m.inside, m.winding):
            np.testing.assert_array_equal(query(image).ravel(), query(P))
        self.assertEqual(m.inside(P.reshape(2, 25, 60, 3)[:, ::2]).shape, (2, 13, 60))
        self.assertEqual(m.inside(np.zeros((4, 0, 3))).shape, (4, 0))
        self.assertEqual(m.distance_bounds(image, level=2).lo.shape, (50, 60))
        np.testing.assert_array_equal(m.winding_bounds(image).reshape(3000, 2), m.winding_bounds(P))
        self.assertEqual((m.winding_bounds(P[0]).shape, m.winding_bounds(P[:0]).shape), ((2,), (0, 2)))
        origins = 3 * image
        hits, plain = m.ray(origins, -image), m.ray(3 * P, -P)
        self.same([part.ravel() for part in hits], plain)
        self.assertEqual(m.ray_any(origins, [0, 0, 1]).shape, (50, 60))
        self.assertEqual(m.ray(origins, [0, 0, 1], t_max=np.ones((50, 60))).t.shape, (50, 60))
        self.same(m.ray_all(origins, -image), m.ray_all(3 * P, -P))
        many = ebpo.Catalogue.of(["scan.ebpo.h5"])
        np.testing.assert_array_equal(many.distance(image)["distance"], got.distance)
        np.testing.assert_array_equal(many.inside(image), m.inside(image))
        self.assertEqual(many.ray(origins, -image).shape, (50, 60))
        with self.assertRaisesRegex(ValueError, "shape"):
            m.ray(origins, P)
        for wrong in (np.zeros((2, 3, 2)), np.zeros(4), 1.0):
            with self.assertRaisesRegex(ValueError, "shape"):
                m.inside(wrong)

    def test_nan(self):
        m, bad = model("scan"), P.copy()
        gone = np.arange(len(P)) % 7 == 3
        bad[gone, np.arange(gone.sum()) % 3] = np.nan
        left, bad32 = ~gone, bad.astype(np.float32).reshape(50, 60, 3)
        with self.assertRaisesRegex(ebpo.ArgumentError, "number 3 "):
            m.inside(bad)
        located, expected = m.locate(bad, nan="propagate"), m.locate(P)
        self.same([part[left] for part in located], [part[left] for part in expected])
        self.assertTrue((located.where[gone] == ebpo.Where.MAYBE).all() and np.isnan(located.doubt[gone]).all())
        self.assertFalse(m.inside(bad, nan="propagate")[gone].any() or m.winding(bad, nan="propagate")[gone].any())
        near, expected = m.distance(bad, nan="propagate"), m.distance(P)
        self.same([part[left] for part in near], [part[left] for part in expected])
        self.assertTrue(all(np.isnan(part[gone]).all() for part in near[:3]) and (near.face[gone] == -1).all())
        self.assertTrue(np.isnan(m.distance_bounds(bad, nan="propagate").lo[gone]).all())
        self.assertEqual(np.isnan(m.distance(bad32, nan="propagate").distance).sum(), gone.sum())
        hits, expected = m.ray(bad * 3, -P, nan="propagate"), m.ray(P * 3, -P)
        self.same([part[left] for part in hits], [part[left] for part in expected])
        self.assertTrue(np.isnan(hits.t[gone]).all() and (hits.face[gone] == -1).all())
        self.same(m.ray(P * 3, -bad, nan="propagate"), hits)
        every, alone = m.ray_all(bad * 3, -P, nan="propagate"), m.ray_all(P[left] * 3, -P[left])
        np.testing.assert_array_equal(every.t, alone.t)
        np.testing.assert_array_equal(every.ray, np.flatnonzero(left)[alone.ray])
        self.assertTrue((np.diff(every.begin)[gone] == 0).all() and len(every.begin) == len(P) + 1)
        self.assertFalse(m.ray_any(P, [np.nan, 0, 1], nan="propagate").any())
        bounds = m.winding_bounds(bad, nan="propagate")
        np.testing.assert_array_equal(bounds[left], m.winding_bounds(P[left]))
        self.assertTrue(np.isnan(bounds[gone]).all())
        one = m.distance([np.nan, 0, 0], nan="propagate")
        self.assertTrue(np.isnan(one.distance) and one.point.shape == (3,) and one.face == -1)
        many = ebpo.Catalogue.of(["scan.ebpo.h5"])
        self.assertTrue((many.distance(bad, nan="propagate")["model"][gone] == -1).all())
        np.testing.assert_array_equal(many.inside(bad, nan="propagate"), m.inside(bad, nan="propagate"))
        bad[11, 0] = np.inf  # the numbers of errors count all points
        with self.assertRaisesRegex(ebpo.ArgumentError, "number 11 "):
            m.inside(bad, nan="propagate")
        with self.assertRaisesRegex(ValueError, "propagate"):
            m.inside(P, nan="ignore")

    def test_masked(self):
        m, mask = model("scan"), np.zeros(P.shape, bool)
        mask[4, 1] = True
        masked, image = np.ma.masked_array(P, mask), np.ma.masked_array(P, mask).reshape(50, 60, 3)
        self.same(m.distance(np.ma.masked_array(P)), m.distance(P))
        for given in (masked, image):
            with self.assertRaisesRegex(ebpo.ArgumentError, "number 4 "):
                m.distance(given)
            with self.assertRaisesRegex(ebpo.ArgumentError, "ray 4 "):
                m.ray(given, [0, 0, 1])
            near = m.distance(given, nan="propagate")
            self.assertEqual(np.flatnonzero(near.face.ravel() < 0).tolist(), [4])
        with self.assertRaisesRegex(ebpo.ArgumentError, "masked"):
            ebpo.convert((P[:3], np.ma.masked_array([[0, 1, 2]], [[0, 0, 1]])), "masked.ebpo.h5")
        with self.assertRaisesRegex(ebpo.FormatError, "vertex 1 has y = nan"):
            ebpo.convert((masked[3:6].astype(np.float32), [[0, 1, 2]]), "masked.ebpo.h5")

    def test_bounds_and_volume(self):
        for options in ({}, {"memory": "2M"}):
            m = model("scan", **options)
            v = m.mesh().vertices
            np.testing.assert_array_equal(m.bounds, [v.min(axis=0), v.max(axis=0)])
            m.bounds[0] = 7
            self.assertNotEqual(m.bounds[0, 0], 7)
            self.assertEqual(m.volume, m.measure().volume)


class Errors(Case):
    def test_missing_files(self):
        for query in (lambda: ebpo.open("no/file.ebpo.h5"), lambda: ebpo.convert("no.ply", "new.ebpo.h5"),
                      lambda: ebpo.open_scene("no.scene.json"), lambda: ebpo.Catalogue.of(["no.ebpo.h5"]),
                      lambda: ebpo.convert("scan.ply", "no/folder/x.ebpo.h5")):
            with self.assertRaises(FileNotFoundError) as caught:
                query()
            error = caught.exception
            self.assertIsInstance(error, ebpo.IOFailure)
            self.assertEqual(error.errno, errno.ENOENT, error)
            self.assertTrue(error.filename and str(error).startswith(error.filename))
            again = pickle.loads(pickle.dumps(error))
            self.assertEqual((type(again), str(again), again.errno), (type(error), str(error), error.errno))
        with self.assertRaises(IsADirectoryError):
            ebpo.open(".")

    def test_names_of_attributes(self):
        m = model("coloured")
        self.assertIn("vertex:red", repr(m.attributes))
        with self.assertRaisesRegex(KeyError, "'vertex:temperature'.*vertex:red"):
            m.attributes["vertex:temperature"]
        with self.assertRaisesRegex(KeyError, "none"):
            model("scan").attributes["red"]

    def test_strokes_are_short(self):
        m = model("scan")
        paint = ebpo.Paint(m)
        paint.add_layer(title="x")
        paint.draw(m, np.linspace([-1, 0, 1, 1], [1, 0, 1, 1], 500), radius=.05)
        self.assertLess(len(repr(paint.strokes)), 200)
        self.assertEqual(pickle.loads(pickle.dumps(paint.strokes[0])).radius, .05)


class Signatures(Case):
    def public(self):
        for name in ebpo.__all__:
            thing = getattr(ebpo, name)
            if inspect.isfunction(thing):
                yield name, thing
            elif inspect.isclass(thing) and thing.__module__.startswith("ebpo."):
                for key, value in inspect.getmembers(thing):
                    if not key.startswith("_") or key == "__init__" and "__init__" in vars(thing):
                        value = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
                        if inspect.isfunction(value) and value.__module__.startswith("ebpo."):
                            yield f"{name}.{key}", value

    def test_arguments_are_named_and_typed(self):
        internal = {"Info.__init__", "Level", "Subtree.__init__", "Attributes.__init__", "Structure"}
        count = 0
        for name, function in self.public():
            if name in internal or function.__module__ == "ebpo._declared":
                continue
            for argument in inspect.signature(function).parameters.values():
                if argument.name in ("self", "cls") or argument.name.startswith("_"):
                    continue
                self.assertNotIn(argument.kind, (argument.VAR_KEYWORD, argument.VAR_POSITIONAL), name)
                self.assertNotIn(argument.annotation, ("Any", argument.empty), f"{name}({argument.name})")
                count += 1
            self.assertNotIn(function.__annotations__.get("return", "Any"), ("Any", "Callable"), name)
        self.assertGreater(count, 150)

    def test_mypy(self):
        folder = pathlib.Path(ebpo.__file__).parents[1]
        environment = dict(os.environ)
        if folder.name != "site-packages":  # mypy finds an installed package by itself
            environment["MYPYPATH"] = str(folder)
        mypy = [os.environ["EBPO_MYPY"]] if os.environ.get("EBPO_MYPY") else [sys.executable, "-m", "mypy"]
        if subprocess.run([*mypy, "--version"], capture_output=True).returncode:
            self.skipTest("mypy is not installed; EBPO_MYPY may name its program")
        options = ["--python-executable", sys.executable, "--cache-dir", "mypy-cache"]

        def check(*words):
            return subprocess.run([*mypy, *options, *words], capture_output=True, text=True, env=environment)

        pathlib.Path("uses.py").write_text(USES)
        done = check("--strict", "--follow-imports", "silent", "uses.py")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        pathlib.Path("wrong.py").write_text(WRONG)
        found = {int(line) for line in re.findall(r"^wrong.py:(\d+): error", check("wrong.py").stdout, re.M)}
        self.assertEqual(found, {4, 5, 6, 7, 8})
        done = check("--ignore-missing-imports", "-p", "ebpo")
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr)


class Notebooks(Case):
    def test_html(self):
        text = model("scan")._repr_html_()
        self.assertIn(f"{model('scan').info.face_count:,}", text)
        self.assertLess(len(text), 100_000)
        image = notebook.picture(model("scan"))
        seen = image[:, :, 3] > 0
        self.assertTrue(.2 < seen.mean() < .9 and len(np.unique(image[seen], axis=0)) > 20, seen.mean())
        png = notebook.png_of(image)
        self.assertEqual(struct.unpack(">II", png[16:24]), (notebook.WIDTH, notebook.HEIGHT))
        data = zlib.decompress(png[41:41 + struct.unpack(">I", png[33:37])[0]])
        lines = np.frombuffer(data, np.uint8).reshape(notebook.HEIGHT, -1)[:, 1:]
        np.testing.assert_array_equal(lines.reshape(image.shape), image)
        bare = ebpo.convert("scan.ply", "<b>.ebpo.h5", parts="mesh")
        self.assertNotIn("<b>", bare._repr_html_())
        self.assertNotIn("<img", bare._repr_html_())

    def test_viewer(self):
        pathlib.Path("a viewer").mkdir()
        pathlib.Path("a viewer/index.html").write_text("the viewer")
        m = model("scan")
        with m.show(height=300, viewer="a viewer") as shown:
            found = re.fullmatch(r"<iframe src='(http://127\.0\.0\.1:\d+/)' style='[^'<>]* height: 300px;[^'<>]*'></iframe>",
                                 shown._repr_html_())
            self.assertEqual(found[1], shown.address)
            with urllib.request.urlopen(shown.address) as page:  # redirects to the address with the file
                self.assertIn("file=models/0/scan.ebpo.h5", page.url)
                self.assertEqual(page.read(), b"the viewer")
            with urllib.request.urlopen(shown.address + "models/0/scan.ebpo.h5") as file:
                self.assertEqual(file.read(), pathlib.Path("scan.ebpo.h5").read_bytes())
            process = shown._process
            self.assertNotEqual(os.getpgid(process.pid), os.getpgrp())  # an interrupt is sent to the group
            child = os.fork()
            if not child:  # a forked process does not end the server of the old one
                shown.close()
                os._exit(0)
            os.waitpid(child, 0)
            self.assertIsNone(process.poll())
        self.assertIsNotNone(process.poll())
        shown.close()
        with self.assertRaisesRegex(ebpo.UnsupportedError, "nowhere: the viewer is not in this folder"):
            m.show(viewer="nowhere")
        with self.assertRaisesRegex(ValueError, "local path"):
            ebpo.open(pathlib.Path("scan.ebpo.h5").read_bytes()).show()
        for height in (0, -1, 1 << 70):
            with self.assertRaises(ebpo.ArgumentError):
                m.show(height=height, viewer="a viewer")


class Bars(Case):
    def test_classes_of_bars(self):
        made = []

        class Bar:
            def __init__(self, total, desc):
                made.append([desc, total, 0, False])

            def update(self, n):
                made[-1][2] += n

            def close(self):
                made[-1][3] = True

        m = model("scan")
        m.distance(P, progress=Bar)
        self.assertEqual(made, [["distance", len(P), len(P), True]])
        made.clear()
        m.ray(P, -P, progress=Bar)
        m.level(3, progress=Bar)
        ebpo.convert("scan.ply", "barred.ebpo.h5", progress=Bar)
        self.assertGreater(len({bar[0] for bar in made}), 3)

    def test_tqdm(self):
        try:
            import tqdm
        except ImportError:
            self.skipTest("tqdm is not installed")
        model("scan").distance(P, progress=tqdm.tqdm)


class Processes(Case):
    """Models after os.fork, and in processes of multiprocessing."""

    def setUp(self):
        self.expected = digest(model("scan"))

    def forked(self, work):
        """Return what work() returns in a forked process. Fails when the process does not end in a minute."""
        read, write = os.pipe()
        child = os.fork()
        if not child:
            try:
                os.write(write, repr(work()).encode())
            except BaseException as error:
                os.write(write, repr(error).encode())
            finally:
                os._exit(0)
        os.close(write)
        timer = threading.Timer(60, os.kill, (child, 9))
        timer.start()
        with os.fdopen(read) as pipe:
            text = pipe.read()
        os.waitpid(child, 0)
        timer.cancel()
        return text

    def test_forks_while_threads_query(self):
        m, end = model("scan", memory="2M", prefetch=True), threading.Event()
        threads = [threading.Thread(target=lambda: [m.distance(P) for _ in iter(end.is_set, True)]) for _ in range(3)]
        for thread in threads:
            thread.start()
        try:
            for _ in range(8):
                self.assertEqual(self.forked(lambda: digest(m)), repr(self.expected))
        finally:
            end.set()
            for thread in threads:
                thread.join()
        self.assertEqual(digest(m), self.expected)

    def test_forks_of_other_objects(self):
        m = model("scan")
        collider, many = ebpo.Collider(m, m), ebpo.Catalogue.of(["scan.ebpo.h5"])
        many.inside(P)
        haptic = ebpo.Haptic(m, [0, 0, 3])
        self.assertEqual(self.forked(lambda: collider.relation().name), repr(collider.relation().name))
        self.assertEqual(self.forked(lambda: int(many.inside(P).sum())), repr(int(m.inside(P).sum())))
        self.assertIn("RuntimeError", self.forked(lambda: haptic.step([0, 0, 3])))
        closed = model("scan")
        closed.close()
        self.assertIn("closed", self.forked(lambda: closed.inside(P)))
        data = pathlib.Path("scan.ebpo.h5").read_bytes()
        pathlib.Path("replaced.ebpo.h5").write_bytes(data)
        old = ebpo.open("replaced.ebpo.h5")
        ebpo.convert("cube.ply", "replaced.ebpo.h5", overwrite=True)
        self.assertIn("replaced", self.forked(lambda: old.inside(P)))
        self.assertEqual(digest(ebpo.open(data)), self.expected)
        memory = ebpo.open(data)
        self.assertEqual(self.forked(lambda: digest(memory)), repr(self.expected))

    def test_files_shared_with_forked_processes(self):
        """Processes that read the same file object do not disturb each other."""
        with open("scan.ebpo.h5", "rb") as file:
            m = ebpo.open(file, memory="2M")
            file.seek(5)
            with concurrent.futures.ThreadPoolExecutor(2) as pool:
                found = list(pool.map(lambda _: self.forked(lambda: digest(m)), range(4)))
            self.assertEqual(found, [repr(self.expected)] * 4)
            self.assertEqual((digest(m), file.tell()), (self.expected, 5))
        with gzip.open("scan.gz", "wb") as file:
            file.write(pathlib.Path("scan.ebpo.h5").read_bytes())
        with gzip.open("scan.gz", "rb") as file:
            self.assertEqual(digest(ebpo.open(file)), self.expected)

    def test_multiprocessing(self):
        for method in multiprocessing.get_all_start_methods():
            if method == "fork":
                with multiprocessing.get_context(method).Pool(2) as pool:
                    self.assertEqual(pool.map(query_in_process, [model("scan")] * 4), [self.expected] * 4)
        m = pickle.loads(pickle.dumps(ebpo.Collider(model("scan"), model("scan"))))
        self.assertEqual(m.relation(), ebpo.Relation.EQUAL if hasattr(ebpo.Relation, "EQUAL") else m.relation())


class Meshes(Case):
    """ebpo.convert with meshes of other packages."""

    def setUp(self):
        self.mesh = model("scan").mesh(order="source")

    def check(self, mesh, name):
        self.same(ebpo.convert(mesh, f"{name}.ebpo.h5", overwrite=True).mesh(order="source"), self.mesh)

    def test_stand_ins(self):
        vertices, faces = self.mesh
        flat = np.hstack([np.full((len(faces), 1), 3), faces]).ravel()
        square = types.SimpleNamespace(points=vertices, faces=np.array([4, 0, 1, 2, 3]), triangulate=lambda:
                                       types.SimpleNamespace(points=vertices, faces=flat))
        self.check(types.SimpleNamespace(vertices=vertices, faces=faces), "trimesh")
        self.check(types.SimpleNamespace(vertices=vertices, triangles=faces.astype(np.int32)), "open3d")
        self.check(square, "pyvista")
        self.check(self.mesh, "arrays")
        tensors = [types.SimpleNamespace(cpu=lambda array=array: types.SimpleNamespace(numpy=lambda: array))
                   for array in (vertices, faces.astype(np.int64))]
        self.check(types.SimpleNamespace(vertex=types.SimpleNamespace(positions=tensors[0]),
                                         triangle=types.SimpleNamespace(indices=tensors[1])), "tensors")
        self.check(types.SimpleNamespace(geometry={}, to_mesh=lambda: types.SimpleNamespace(vertices=vertices, faces=faces)),
                   "scene")
        for cells in ({}, {"celltypes": np.array([10]), "faces": np.array([0])}):  # the latter: PyVista 0.46
            grid = types.SimpleNamespace(points=vertices, triangulate=lambda cells=cells:
                                         types.SimpleNamespace(points=vertices, **cells))
            with self.assertRaisesRegex(TypeError, "extract_surface"):
                ebpo.convert(grid, "never.ebpo.h5")
        for wrong in (17, types.SimpleNamespace(points=vertices), [1, 2, 3]):
            with self.assertRaisesRegex(TypeError, "trimesh"):
                ebpo.convert(wrong, "never.ebpo.h5")

    def package(self, name):
        try:
            return importlib.import_module(name)
        except ImportError:
            self.skipTest(f"{name} is not installed")

    def test_trimesh(self):
        kind = self.package("trimesh").Trimesh
        mesh = model("scan").to_trimesh()
        self.assertIsInstance(mesh, kind)
        made = ebpo.convert(mesh, "of_trimesh.ebpo.h5", overwrite=True)
        np.testing.assert_array_equal(made.mesh(order="source").faces, self.mesh.faces)
        np.testing.assert_allclose(made.bounds, mesh.bounds, rtol=1e-6)
        self.assertAlmostEqual(made.volume, mesh.volume, 5)
        scene = importlib.import_module("trimesh").Scene(mesh)
        self.same(ebpo.convert(scene, "of_trimesh.ebpo.h5", overwrite=True).mesh(order="source"), made.mesh(order="source"))

    def test_open3d(self):
        o3d = self.package("open3d")
        mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(self.mesh.vertices.astype(float)),
                                         o3d.utility.Vector3iVector(self.mesh.faces.astype(np.int32)))
        for given in (mesh, o3d.t.geometry.TriangleMesh.from_legacy(mesh)):
            made = ebpo.convert(given, "of_open3d.ebpo.h5", overwrite=True).mesh(order="source")
            self.same(made, self.mesh)

    def test_pyvista(self):
        self.package("pyvista")
        mesh = model("scan").to_pyvista()
        self.check(mesh, "of_pyvista")
        with self.assertRaisesRegex(TypeError, "extract_surface"):
            ebpo.convert(mesh.cast_to_unstructured_grid(), "never.ebpo.h5")


if __name__ == "__main__":
    run()
