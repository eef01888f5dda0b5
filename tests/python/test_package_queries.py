#!/usr/bin/env python3
"""Checks that queries from Python return the command's results, for any arrays and threads."""
import concurrent.futures
import ctypes
import pathlib
import pickle
import sys

from package_support import Case, command_results, model, np, points, run

import ebpo
from ebpo._library import lib

P = points(20_000)


def steps(function):
    """Return the number of the package's Python functions that a call runs, after a first call."""
    folder, entered = str(pathlib.Path(ebpo.__file__).parent), []
    function()
    sys.setprofile(lambda frame, event, _: entered.append(frame.f_code.co_name)
                   if event == "call" and frame.f_code.co_filename.startswith(folder) else None)
    try:
        function()
    finally:
        sys.setprofile(None)
    return len(entered)


class Queries(Case):
    def test_number_of_steps(self):
        """A query of one item runs few Python functions, which cost more than the library's function."""
        m = model("scan")
        collider, matrix, p = ebpo.Collider(m, m), np.eye(4), np.array([.1, .2, .3])
        matrix[0, 3] = 9
        pose = ebpo.pose(translation=[9, 0, 0])
        self.assertLessEqual(steps(lambda: collider.first(pose_b=pose)), 8)
        self.assertLessEqual(steps(lambda: collider.first(pose_b=matrix)), 10)
        self.assertLessEqual(steps(lambda: m.inside(p)), 27)
        self.assertLessEqual(steps(lambda: m.distance(p)), 42)
        self.assertLessEqual(steps(lambda: m.ray(3 * p, p)), 38)

    def test_inside_equals_the_command(self):
        m = model("scan")
        expected = command_results("inside", "scan", P)
        located = m.locate(P)
        np.testing.assert_array_equal(located.where, expected["where"])
        np.testing.assert_array_equal(located.winding, expected["winding"])
        np.testing.assert_array_equal(m.inside(P), expected["where"] != ebpo.Where.OUT)
        np.testing.assert_array_equal(m.winding(P), expected["winding"])
        self.assertTrue(0 < m.inside(P).mean() < 1)

    def test_surface_with_holes_equals_the_command(self):
        m = model("open_box")  # 0 .. 1 on each axis
        expected = command_results("inside", "open_box", P)
        self.same(m.locate(P)[:2], (expected["where"], expected["winding"]))
        inside, bounds = m.inside(P), m.winding_bounds(P, width=1e-6)
        self.assertTrue((bounds[:, 1] - bounds[:, 0] <= 1e-6).all())
        np.testing.assert_array_equal(inside, np.abs(bounds.mean(axis=1)) > .5)
        np.testing.assert_array_equal(inside, m.distance(P).distance < 0)
        self.assertTrue(0 < inside.mean() < 1)
        np.testing.assert_allclose(m.winding_bounds([.5, .5, .5]), 5 / 6, atol=1e-8)
        self.assertEqual(model("open_box", threshold=.84).winding([.5, .5, .5]), 0)

    def test_distance_equals_the_command(self):
        d = model("scan").distance(P[:4000])
        expected = command_results("distance", "scan", P[:4000])
        np.testing.assert_array_equal(d.distance, expected["distance"])
        np.testing.assert_array_equal(d.point, expected["point"])
        np.testing.assert_array_equal(d.normal, expected["normal"])
        np.testing.assert_array_equal(d.face, expected["face"].astype(np.int64))

    def test_rays_equal_the_command(self):
        m, direction = model("scan"), points(4000, seed=2)
        origin = 3 * points(4000, seed=3)
        expected = command_results("ray", "scan", np.hstack([origin, direction]))
        hits = m.ray(origin, direction)
        np.testing.assert_array_equal(hits.t, expected["t"])
        np.testing.assert_array_equal(hits.face, expected["face"].astype(np.int64))
        np.testing.assert_array_equal(hits.side, expected["side"])
        np.testing.assert_array_equal(m.ray_any(origin, direction), hits.face >= 0)
        every = m.ray_all(origin, direction)
        first = every.begin[:-1][np.diff(every.begin) > 0]
        np.testing.assert_array_equal(every.t[first], hits.t[hits.face >= 0])
        np.testing.assert_array_equal(every.ray[first], np.flatnonzero(hits.face >= 0))
        self.assertTrue(0 < len(first) < len(origin) < len(every.t) + len(origin))
        self.assertFalse(m.ray_any(origin, direction, t_max=hits.t * .999).any())

    def test_arrays_of_all_kinds(self):
        """Arrays that are not contiguous doubles are converted block by block, with the same results."""
        m, single = model("scan"), P.astype(np.float32)
        wide = np.zeros((len(P), 5), np.float32)
        wide[:, 1:4] = single
        np.save("points.npy", single)
        expected = m.locate(single.astype(np.float64))
        for kind in (single, wide[:, 1:4], np.asfortranarray(single), single.astype(">f4"),
                     np.load("points.npy", mmap_mode="r"), single[::-1][::-1]):
            self.same(m.locate(kind), expected)
        self.same(m.locate(single.tolist()[:50]), [part[:50] for part in expected])
        whole = np.random.default_rng(4).integers(-2, 3, (500, 3))
        self.same(m.distance(whole), m.distance(whole.astype(float)))
        one = m.distance(P[7])
        self.assertEqual((one.distance.shape, one.point.shape), ((), (3,)))
        self.same(one, [part[7] for part in m.distance(P[:8])])
        for nothing in ([], np.zeros((0, 3))):
            self.assertEqual(m.inside(nothing).shape, (0,))
            self.assertEqual(m.distance(nothing).point.shape, (0, 3))

    def test_datasets_of_h5py(self):
        try:
            import h5py
        except ImportError:
            self.skipTest("no h5py")
        with h5py.File("points.h5", "w") as file:
            file["points"] = P
        for name in (None, "NeXus", b"\xff", 7):
            with h5py.File("points.h5", "a") as file:
                file["points"].attrs["coding"] = "of another format"
                if name is not None:
                    file.attrs["format"] = name
            with h5py.File("points.h5", "r") as file:
                np.testing.assert_array_equal(model("scan").inside(file["points"]), model("scan").inside(P))
        with h5py.File("scan.ebpo.h5", "r") as file, self.assertRaisesRegex(TypeError, "codes.*mesh"):
            model("scan").inside(file["mesh/vertices"])

    def test_threads_and_budgets(self):
        m = model("scan")
        expected = m.distance(P[:3000])
        for other in (m.distance(P[:3000], threads=1), m.distance(P[:3000], threads=5),
                      model("scan", memory="2M").distance(P[:3000]), model("scan", cut_level=2).distance(P[:3000])):
            self.same(other, expected)
        with concurrent.futures.ThreadPoolExecutor(8) as pool:
            for got in pool.map(lambda _: m.inside(P), range(16)):
                np.testing.assert_array_equal(got, m.inside(P))

    def test_the_lock_of_python_is_free(self):
        """ctypes releases the lock around calls of a CDLL, and holds it around calls of a PyDLL."""
        self.assertTrue(isinstance(lib, ctypes.CDLL) and not isinstance(lib, ctypes.PyDLL))

    def test_limited_results_contain_exact_results(self):
        m = model("scan")
        exact = m.locate(P)
        for limited in (m.locate(P, level=2), m.locate(P[:2000], deadline=1e-9)):
            known = limited.where != ebpo.Where.MAYBE
            self.assertTrue(known.any() and not known.all())
            np.testing.assert_array_equal(limited.where[known], exact.where[:len(known)][known])
            self.assertTrue((limited.doubt[~known] > 0).all())
        lo, hi = m.distance_bounds(P[:2000], level=2)
        true = abs(m.distance(P[:2000]).distance)
        self.assertTrue(((lo <= true) & (true <= hi)).all() and (lo < hi).any())
        near = m.distance(P[:2000], max_distance=.1)
        np.testing.assert_array_equal(np.isinf(near.distance), true > .1)
        np.testing.assert_array_equal(near.face == -1, true > .1)

    def test_near_and_boxes(self):
        m = model("scan")
        near = m.near([1, .1, .2], count=20)
        self.assertEqual(len(near.face), 20)
        self.assertEqual(near.face[0], m.distance([1, .1, .2]).face)
        self.assertTrue((np.diff(near.distance) >= 0).all())
        radius = near.distance[9:11].mean()
        self.same(m.near([1, .1, .2], radius=radius), [part[:10] for part in near])
        box = [0, 0, 0], [1, .3, .2]
        corners, faces = m.triangles_in_box(*box)
        np.testing.assert_array_equal(faces, m.faces_in_box(*box))
        mesh = m.mesh(order="source")
        np.testing.assert_array_equal(corners, mesh.vertices[mesh.faces[faces]])
        self.assertTrue(0 < len(faces) < len(mesh.faces))

    def test_booleans(self):
        m, poses = model("scan"), [None, ebpo.pose(translation=[.4, .1, 0])]
        volume = {}
        for operator in "|&-^":
            mesh = ebpo.boolean(f"A {operator} B", [m, m], poses=poses, doubles=True)
            a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
            volume[operator] = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
            self.assertLess(mesh.displacement, 1e-15)
        self.assertGreater(volume["&"], 0)
        self.assertAlmostEqual(volume["|"] + volume["&"], 2 * m.volume, 9)
        self.assertAlmostEqual(volume["|"] - volume["&"], volume["^"], 9)
        self.assertAlmostEqual(m.volume - volume["&"], volume["-"], 9)
        self.assertEqual(len(ebpo.boolean("A - (A | B & B)", [m, m], poses=poses).faces), 0)
        box, plane = [[-9, -9, -9], [9, 9, 9]], [0, 0, 1, .1]
        cut = [ebpo.boolean(e, [m], box=box, planes=p, volume=True, doubles=True, memory=how, temp_dir=".")
               for e, p, how in (("A", None, None), ("~A", None, "256M"), ("A", plane, None), ("A", [plane, plane], None))]
        for result in cut:
            a, b, c = np.moveaxis(result.vertices[result.faces].astype(float), 1, 0)
            self.assertAlmostEqual(np.einsum("ij,ij->", a, np.cross(b, c)) / 6, result.volume[0], 8)
            self.assertLessEqual(result.volume[0], result.volume[1])
        self.assertAlmostEqual(cut[0].volume[0], m.volume, 12)
        self.assertAlmostEqual(cut[0].volume[0] + cut[1].volume[0], 18**3, 9)
        self.assertLess(cut[2].vertices[:, 2].max(), .1 + 1e-15)
        self.assertEqual(cut[2].volume, cut[3].volume)
        self.assertTrue(np.isnan(mesh.volume).all())
        self.assertEqual(mesh.attributes, {})
        mesh = ebpo.boolean("A - B", [m, m], poses=poses, origins=True)
        origins, faces = (mesh.attributes[f"face:{name}"] for name in ("operand", "operand_face"))
        source = m.mesh(order="source")
        self.assertEqual([len(origins), len(faces), set(origins)], [len(mesh.faces)] * 2 + [{0, 1}])
        low, high = (f(source.vertices[source.faces[faces[origins == 0]]], axis=1) for f in (np.min, np.max))
        corners = mesh.vertices[mesh.faces[origins == 0]]
        self.assertTrue((corners >= low[:, None] - 1e-6).all() and (corners <= high[:, None] + 1e-6).all())
        change = ebpo.boolean("A - B", [m, m], poses=poses, changed_only=True, origins=True)
        first, count = (change.attributes[f"removed:{name}"] for name in ("first", "count"))
        removed = np.concatenate([np.arange(a, a + n) for a, n in zip(first, count)])
        self.assertTrue(0 < len(removed) < m.info.face_count and len(change.faces) < len(mesh.faces))
        self.assertEqual(len(mesh.faces), len(change.faces) + m.info.face_count - len(removed))
        with self.assertRaises(ebpo.ArgumentError):
            ebpo.boolean("A - B", [m, m], poses=poses, changed_only=True, attributes=True)
        coloured = model("coloured")
        whole = ebpo.boolean("A", [coloured], attributes=True)
        red, mesh = coloured.attributes["red"], coloured.mesh()
        pairs = [set(map(tuple, np.column_stack([v[f.ravel()], r[f.ravel()]])))
                 for v, f, r in ((mesh.vertices, mesh.faces, red), (whole.vertices, whole.faces, whole.attributes["vertex:red"]))]
        self.assertEqual(*pairs)
        for wrong in {"box": [1, 2]}, {"planes": [1, 2, 3]}, {"temp_dir": "."}:
            with self.assertRaises(ValueError):
                ebpo.boolean("A", [m], **wrong)
        with self.assertRaises(ebpo.ArgumentError):
            ebpo.boolean("~A", [m])
        for wrong in "", "A B", "A -", "(A", "A - C", "a", "~":
            with self.assertRaises(ValueError):
                ebpo.boolean(wrong, [m, m])

    def test_errors(self):
        m, bad = model("scan"), P[:9000].copy()
        bad[8000, 1] = np.nan
        for query in (m.inside, m.distance):
            with self.assertRaisesRegex(ebpo.ArgumentError, "number 8000 "):
                query(bad)
        with self.assertRaisesRegex(ebpo.ArgumentError, "ray 8000 "):
            m.ray(bad, [0, 0, 1.])
        with self.assertRaises(ValueError):
            m.ray(P, np.zeros(3))
        for wrong in (P[:, :2], P[0, :2], [[1, 2, 3, 4]], np.zeros((2, 3, 2))):
            with self.assertRaisesRegex(ValueError, "shape"):
                m.inside(wrong)
        with self.assertRaises(TypeError):
            m.inside(P.astype(complex))
        model("open_box")
        bare = ebpo.convert("open_box.ply", "bare.ebpo.h5", parts="mesh,maps")  # without its border
        with self.assertRaises(ebpo.NotSolidError) as caught:
            bare.inside(P[:2])
        self.assertIsInstance(caught.exception, ValueError)
        self.assertEqual(caught.exception.status, "EBPO_E_NOT_SOLID")
        with self.assertRaises(ebpo.NotSolidError):
            bare.inside([])
        with self.assertRaises(ebpo.LimitError):
            model("scan", memory=1000).inside(P)
        for size in ("12 parsecs", -1):
            with self.assertRaises(ValueError):
                model("scan", memory=size)

    def test_progress(self):
        m, calls = model("scan"), []
        m.inside(P, progress=lambda *now: calls.append(now))
        self.assertEqual(calls[0], ("inside", 0, len(P)))
        self.assertEqual(calls[-1], ("inside", len(P), len(P)))
        self.assertEqual(calls, sorted(calls))
        with self.assertRaises(ebpo.Cancelled):
            m.distance(P, progress=lambda stage, done, total: done < 5000)
        with self.assertRaises(ZeroDivisionError):
            m.distance(P, progress=lambda *_: 1 / 0)
        with self.assertRaises(ZeroDivisionError):  # raised through the library
            m.level(2, progress=lambda *_: 1 / 0)
        np.testing.assert_array_equal(m.inside(P), model("scan").inside(P))

    def test_pickles(self):
        m = model("scan", memory="4M", cut_level=1, threads=1)
        again = pickle.loads(pickle.dumps(m))
        np.testing.assert_array_equal(again.inside(P), m.inside(P))
        self.assertEqual((again.stats["budget"], again.stats["resident"]), (4_000_000, False))
        with open("scan.ebpo.h5", "rb") as file:
            copy = pickle.loads(pickle.dumps(ebpo.open(file.read())))
        np.testing.assert_array_equal(copy.inside(P[:50]), m.inside(P[:50]))
        self.assertEqual(pickle.loads(pickle.dumps(m.info)).face_count, m.info.face_count)

    def test_closing(self):
        with model("scan") as m:
            mesh, inside = m.mesh(), m.inside(P)
            first = mesh.vertices.copy()
        with self.assertRaisesRegex(ValueError, "closed"):
            m.inside(P)
        np.testing.assert_array_equal(mesh.vertices, first)
        self.assertEqual(len(inside), len(P))


if __name__ == "__main__":
    run()
