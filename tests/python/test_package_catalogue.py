#!/usr/bin/env python3
"""Tests catalogues in Python: compares many models with each single model, and parts with the whole."""
import json
import os
import pathlib
import shutil
import signal
import threading
import time
from unittest import mock

from package_support import Case, command_results, model, np, points, run

import ebpo
from catalogue_support import by_command, caps_of, cut_by_sample, on_triangles, same
from ebpo.catalogue import LONG, Catalogue, Where, interruptible
from ebpo.open_models import process_models

P = points(6000, seed=5, reach=3)


def spheres(count=27):
    """Make copies of the scan at different positions; some overlap."""
    names = [f"moved/{i:02d}.ebpo.h5" for i in range(count)]
    if not os.path.isdir("moved"):
        os.mkdir("moved")
        mesh = model("scan").mesh(order="source")
        for name, at in zip(names, points(count, seed=9, reach=2.5)):
            ebpo.convert((mesh.vertices[:, :3] * .4 + at, mesh.faces), name)
    return names


class Many(Case):
    def setUp(self):
        self.names = spheres()
        self.models = [ebpo.open(name) for name in self.names]
        self.catalogue = Catalogue.of(self.names)

    def test_inside_is_the_sum(self):
        results = [m.locate(P) for m in self.models]
        located = self.catalogue.locate(P)
        inner = np.any([t.where == Where.IN for t in results], axis=0)
        np.testing.assert_array_equal(located["winding"], np.sum([t.winding for t in results], axis=0))
        np.testing.assert_array_equal(located["where"] == Where.IN, inner)
        self.assertGreater(located["winding"].max(), 1)
        on = self.models[3].mesh().vertices[:200].astype(float)
        where = self.catalogue.locate(on)["where"]
        buried = np.any([m.locate(on).where == Where.IN for m in self.models], axis=0)
        np.testing.assert_array_equal(where, np.where(buried, Where.IN, Where.ON))
        np.testing.assert_array_equal(self.catalogue.inside(on, boundary=False), buried)

    def test_results_of_the_command(self):
        rays = np.concatenate([P[:3000], P[3000:] - P[:3000]], axis=1)
        rays[:500, 3:] = 1e-320, 0, 0  # t is inf: the hits are at a t above every double
        expected = self.catalogue.locate(P), self.catalogue.distance(P), self.catalogue.ray(rays[:, :3], rays[:, 3:])
        self.assertTrue((np.isinf(expected[2]["t"]) & (expected[2]["face"] >= 0)).any())
        for options in ([], ["--memory", "8M", "--threads", "4"], ["--memory", "0", "--threads", "1"]):
            for command, rows, results in zip(("inside", "distance", "ray"), (P, P, rays), expected):
                same(by_command(command, self.catalogue, rows, *options), results)
        near = by_command("distance", self.catalogue, P, "--max-distance", ".1")
        same(near, self.catalogue.distance(P, max_distance=.1))
        self.assertTrue(np.isposinf(near["distance"][near["face"] < 0]).all())

    def test_distance_is_the_least(self):
        results = [m.distance(P, signed=False) for m in self.models]
        every = np.array([t.distance for t in results])
        nearest, row = every.argmin(axis=0), np.arange(len(P))
        d = self.catalogue.distance(P)
        np.testing.assert_array_equal(abs(d["distance"]), every.min(axis=0))
        np.testing.assert_array_equal(d["model"], nearest)
        np.testing.assert_array_equal(d["face"], np.array([t.face for t in results])[nearest, row])
        np.testing.assert_array_equal(d["point"], np.array([t.point for t in results])[nearest, row])
        np.testing.assert_array_equal(d["distance"] < 0, self.catalogue.inside(P, boundary=False))
        near = self.catalogue.distance(P, max_distance=.3)
        np.testing.assert_array_equal(near["face"] == -1, every.min(axis=0) > .3)
        twice = Catalogue.of(self.names[:1] * 3).distance(P[:500])
        self.assertEqual(set(twice["model"]), {0}, "the first of equal ones")
        entry = self.catalogue.entries[0]
        wider = Catalogue([entry, entry._replace(low=(-9, -9, -9), high=(9, 9, 9))]).distance(P[:500])
        self.assertEqual(set(wider["model"]), {0}, "also when another model is queried before")

    def test_rays(self):
        d = points(len(P), seed=6)
        d[:2000:2, 1], d[:2000:5, 2] = 0, 0
        hits = [m.ray(P, d) for m in self.models]
        t, found = np.array([h.t for h in hits]), self.catalogue.ray(P, d)
        np.testing.assert_array_equal(found["t"], t.min(axis=0))
        np.testing.assert_array_equal(found["model"], np.where(np.isinf(t.min(axis=0)), -1, t.argmin(axis=0)))
        self.assertTrue(0 < np.isfinite(found["t"]).mean() < 1)

    def test_rays_beyond_doubles(self):
        """Hits at a t that is greater than every double have a face and t = inf, and are sorted."""
        def box(z):
            x, y, k = np.array(np.meshgrid([0, 1], [0, 1], [z, z + 1], indexing="ij"), float).reshape(3, 8)
            faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                     [0, 6, 4], [1, 5, 7], [1, 7, 3]]
            ebpo.convert((np.stack([x, y, k], axis=1), faces), f"box{z}.ebpo.h5")
            return f"box{z}.ebpo.h5"

        boxes = Catalogue.of([box(9), box(3), box(6)])
        for z, direction, t, row in ((-1e308, 1e-308, np.inf, 0), (-1, 1e-320, np.inf, 1), (20, -1e-320, np.inf, 0),
                                     (-1, 1e-300, 4 / 1e-300, 1), (-1, 5e-324, np.inf, 1)):
            o, d = [.5, .25, z], [0, 0, direction]  # seen from 1e308 all boxes are at the same double: the first is used
            found = boxes.ray(o, d)
            self.assertEqual((found["t"], found["model"]), (t, row))
            self.assertGreaterEqual(found["face"], 0)
            printed = by_command("ray", boxes, [o + d])[0]
            self.assertEqual([printed[name] for name in ("t", "face", "model")], [found[name] for name in ("t", "face", "model")])
            hits = ebpo.open("box3.ebpo.h5").ray_all(o, d)
            self.assertEqual((len(hits.t), hits.side.tolist()), (2, [1, -1]))

    def test_few_models_are_queried(self):
        p = points(50, seed=3, reach=.01) + (self.catalogue.entries[4].low + np.array(self.catalogue.entries[4].high)) / 2
        for query, limit in ((self.catalogue.inside, 6), (self.catalogue.distance, 20)):
            process_models().clear()
            before = process_models().stats()["opened"]
            query(p)
            self.assertLess(process_models().stats()["opened"] - before, limit)

    def test_files(self):
        self.catalogue.save("moved/catalogue.json")
        stated = json.loads(pathlib.Path("moved/catalogue.json").read_text())
        self.assertEqual(stated["models"][3]["path"], "03.ebpo.h5")
        again = Catalogue.open("moved/catalogue.json")
        self.assertEqual(again.entries, self.catalogue.entries)
        stated["of later"] = stated["models"][0]["of later"] = 1

        def damaged(**members):
            return {"models": [{**stated["models"][0], **members}]}

        for change, kind, message in (({}, None, ""), ({"version": 2}, ebpo.VersionError, "version 2"),
                                      ({"version": True}, ebpo.VersionError, "version 0"),
                                      ({"format": "x"}, ebpo.FormatError, "ebpo-catalogue"),
                                      ({"models": [{"path": "a"}]}, ebpo.FormatError, "content_sha256"),
                                      ({"models": []}, ebpo.FormatError, "one model"),
                                      ({"models": 5}, ebpo.FormatError, "catalogue"),
                                      ({"parts": "false"}, ebpo.FormatError, "parts is not true or false"),
                                      (damaged(box_min=[9, 9, 9]), ebpo.FormatError, "box_min is above box_max"),
                                      (damaged(box_max=[10**400, 1, 1]), ebpo.FormatError, "real number overflow"),
                                      (damaged(solid="no"), ebpo.FormatError, "solid is not true or false"),
                                      (damaged(path="a\0b"), ebpo.FormatError, "u0000")):
            pathlib.Path("moved/changed.json").write_text(json.dumps({**stated, **change}))
            if kind is None:
                self.assertEqual(len(Catalogue.open("moved/changed.json")), 27)
                continue
            with self.assertRaisesRegex(kind, message):
                Catalogue.open("moved/changed.json")
        pathlib.Path("moved/changed.json").write_text("[" * 200_000)
        with self.assertRaisesRegex(ebpo.FormatError, "depth"):
            Catalogue.open("moved/changed.json")
        os.mkfifo("moved/pipe")
        with self.assertRaisesRegex(ebpo.FormatError, "not a regular file"):
            Catalogue.open("moved/pipe")

    def test_errors(self):
        bad = P.copy()
        bad[77, 2] = np.nan
        with self.assertRaisesRegex(ebpo.ArgumentError, "point 77 "):
            self.catalogue.inside(bad)
        model("open_box")
        surface = Catalogue.of(["open_box.ebpo.h5"])
        with self.assertRaisesRegex(ebpo.NotSolidError, "open_box"):
            surface.winding(P)
        self.same([surface.distance(P)["distance"]], [model("open_box").distance(P, signed=False).distance])
        self.assertEqual(len(self.catalogue.distance(np.zeros((0, 3)))), 0)
        self.assertEqual(len(self.catalogue.ray(np.zeros((0, 3)), [0, 0, 1])), 0)
        ebpo.convert("scan.ply", "other.ebpo.h5")
        one = Catalogue.of(["other.ebpo.h5"])
        one.inside(P[:9])
        ebpo.convert("open_box.ply", "other.ebpo.h5", overwrite=True)
        process_models().clear()
        with self.assertRaisesRegex(ebpo.FormatError, "has changed"):
            one.inside(P)


class Holdings(Case):
    def setUp(self):
        self.addCleanup(process_models, "1GiB")

    def test_least_recently_queried_is_closed(self):
        catalogue = Catalogue.of(spheres())
        process_models().clear()
        before = process_models().stats()
        for _ in range(2):
            for entry in catalogue.entries:
                # Each open model has an eighth of the budget.
                catalogue.inside(np.array(entry.low) / 2 + np.array(entry.high) / 2, memory="8M")
                self.assertLessEqual(process_models().stats()["memory"], 8_000_000)
        stats = process_models().stats()
        self.assertEqual(stats["opened"], stats["closed"] + stats["open"])
        self.assertGreater(stats["closed"] - before["closed"], 2)
        self.assertGreater(stats["bytes_read"], before["bytes_read"])
        catalogue.inside(np.array(entry.low) / 2 + np.array(entry.high) / 2)
        self.assertEqual(process_models().stats()["opened"], stats["opened"], "the model stayed open")
        process_models().clear()
        self.assertEqual(process_models().stats()["open"], 0)

    def test_threads_and_refusals(self):
        catalogue, found = Catalogue.of(spheres()[:6]), []
        expected = catalogue.locate(P).tobytes()

        def work(turn):
            found.append(catalogue.locate(P, memory="6M", threads=1 + turn % 3).tobytes() == expected)

        threads = [threading.Thread(target=work, args=(turn,)) for turn in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60)
        self.assertEqual(found, [True] * 6)
        process_models().clear()
        for _ in range(2):
            with self.assertRaises(ebpo.LimitError):
                catalogue.inside(P, memory=1000)
        self.assertEqual(process_models().stats()["open"], 0)

    def test_exceptions_of_opening(self):
        """An exception of the function that opens files is raised by the query unchanged."""
        catalogue = Catalogue.of(spheres()[:2], http={"storage_options": {"no": "file system"}})
        catalogue.entries = [entry._replace(path="nowhere://x/y") for entry in catalogue.entries]
        with self.assertRaises((ValueError, ImportError)):  # raised by fsspec, or because it is not installed
            catalogue.inside(P)
        os.remove(spheres()[1])
        self.addCleanup(shutil.rmtree, "moved")  # the next test creates it again
        for entry in Catalogue.of(spheres()[:1]).entries:
            with self.assertRaises(ebpo.IOFailure):
                Catalogue([entry._replace(path=os.path.abspath("moved/01.ebpo.h5"))]).inside(P)


class Interrupts(Case):
    def test_long_queries_end_at_once(self):
        catalogue, p = Catalogue.of(spheres()), points(3_000_000, seed=1, reach=2)
        before, began = len(os.listdir("/proc/self/task")), time.monotonic()
        timer = threading.Timer(.5, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            catalogue.distance(p)
        self.assertLess(time.monotonic() - began, 10)
        timer.join()
        # No thread remains that could write into arrays that are freed. The thread of the query may still be ending.
        until = time.monotonic() + 1
        while len(os.listdir("/proc/self/task")) > before and time.monotonic() < until:
            time.sleep(.01)
        self.assertEqual(len(os.listdir("/proc/self/task")), before)

    def test_exceptions_of_signal_handlers_wait_for_the_thread(self):
        def stop(*_):
            raise TimeoutError

        def work(_progress):
            time.sleep(.3)
            ended.append(True)

        ended, before = [], signal.signal(signal.SIGALRM, stop)
        try:
            signal.setitimer(signal.ITIMER_REAL, .05)
            with self.assertRaises(TimeoutError):
                interruptible(work, LONG)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
        self.assertTrue(ended, "the arrays of the query are freed while the thread runs")

    def test_no_thread(self):
        catalogue = Catalogue.of([spheres()[0]])
        with mock.patch.object(threading.Thread, "start", side_effect=RuntimeError("no threads")):
            self.assertEqual(catalogue.winding(np.zeros((LONG, 3))).shape, (LONG,))


class Untrusted(Case):
    """Catalogues are untrusted input: false data in them is detected."""

    def setUp(self):
        model("cube")
        Catalogue.of(["cube.ebpo.h5"]).save("stated.json")
        self.stated = json.loads(pathlib.Path("stated.json").read_bytes())

    def query(self, stated):
        pathlib.Path("untrusted.json").write_text(stated if isinstance(stated, str) else json.dumps(stated))
        catalogue = Catalogue.open("untrusted.json")
        catalogue.inside([[.5, .5, .5]])
        return catalogue.distance([[.5, .5, .5]])

    def test_refused_catalogues(self):
        row = self.stated["models"][0]
        np.save("few.npy", np.arange(3))
        np.save("halves.npy", np.arange(12) + .5)
        for wrong in (dict(box_min=row["box_max"], box_max=row["box_min"]), dict(box_min=[10**400, 0, 0]),
                      dict(box_min="123"), dict(box_min=[False, 0, 0]), dict(box_min=[float("nan")] * 3),
                      dict(box_min=[.4] * 3, box_max=[.6] * 3), dict(box_min=[5] * 3, box_max=[6] * 3),
                      dict(content_sha256=""), dict(content_sha256=None), dict(content_sha256="0" * 64),
                      dict(path="\ud800"), dict(solid="false"), dict(surface="cube.ebpo.h5"),
                      dict(numbers="few.npy"), dict(numbers="halves.npy"), dict(numbers="nowhere.npy")):
            with self.subTest(wrong), self.assertRaises(ebpo.FormatError):
                self.query(dict(self.stated, models=[dict(row, **wrong)]))
        for wrong in ("[" * 100000, dict(self.stated, parts="false"), dict(self.stated, models=["a"]),
                      dict(self.stated, models={"a": 1})):
            with self.subTest(str(wrong)[:40]), self.assertRaises(ebpo.FormatError):
                self.query(wrong)
        self.assertLess(self.query(self.stated)["distance"][0], 0)

    def test_queries_are_checked_wherever_boxes_are(self):
        c, p = Catalogue.open("stated.json"), [9.0, 9, 9]
        for query in (lambda: c.distance(p, max_distance=-1), lambda: c.distance(p, max_distance=float("nan")),
                      lambda: c.ray(p, [0, 0, 0]), lambda: c.ray(p, [1, float("nan"), 0]),
                      lambda: c.ray([float("inf"), 0, 0], [1, 0, 0]), lambda: c.ray(p, [1, 0, 0], t_max=-1),
                      lambda: c.ray(p, [1, 0, 0], t_max=float("nan"))):
            with self.assertRaises(ebpo.ArgumentError):
                query()
        self.assertEqual(len(c.ray(np.zeros((0, 3)), [1, 0, 0])), 0)


class Sizes(Case):
    def test_models_of_any_size(self):
        """Squares of lengths underflow to 0 or overflow."""
        vertices, faces = model("cube").mesh(order="source")
        for size in (3e-162, 1e155, 1e300):
            names, p = [f"sized{i}.ebpo.h5" for i in range(9)], points(200, seed=3, reach=3) * size
            for name, at in zip(names, points(9, seed=4, reach=2)):
                ebpo.convert(((vertices * .3 + at) * size, faces), name, overwrite=True)
            results = [ebpo.open(name).distance(p, signed=False).distance for name in names]
            found = Catalogue.of(names).distance(p)
            np.testing.assert_array_equal(np.abs(found["distance"]), np.min(results, axis=0))
            np.testing.assert_array_equal(found["model"], np.argmin(results, axis=0))


class Parts(Case):
    """A model cut into eight files returns the results of the whole, also on its faces and on caps."""

    @classmethod
    def setUpClass(cls):
        model("scan")
        cls.cut, cls.catalogue, cls.printed = cut_by_sample("scan.ebpo.h5", "cut")
        cls.whole = ebpo.open("scan.ebpo.h5")
        vertices, faces = cls.whole.mesh(order="source")
        cls.corners = vertices.astype(float)[faces]
        cls.caps = caps_of(cls.catalogue, cls.corners)

    def test_numbers_of_another_part(self):
        np.save("few.npy", np.arange(3))
        for wrong in (np.full(99_999, -1), np.full(99_999, 2**63, np.uint64)):
            np.save("negative.npy", wrong[:ebpo.open(self.catalogue.entries[0].path).info.face_count])
            entry = self.catalogue.entries[0]._replace(numbers=os.path.abspath("negative.npy"), surface="")
            with self.assertRaisesRegex(ebpo.FormatError, "negative"):
                Catalogue([entry]).distance([entry.low])
        entries = [entry._replace(numbers=os.path.abspath("few.npy")) for entry in self.catalogue.entries]
        with self.assertRaisesRegex(ebpo.FormatError, "few.npy: expected an index for each face: 3 indices for"):
            Catalogue(entries, parts=True).distance(P[:99])

    def test_half_empty_cells(self):
        ring = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])  # a rod along x, with no vertices between its ends
        vertices = np.array([[x, y, z] for x in range(21) for y, z in ring], float)
        sides = [[[a, b, b + 4], [a, b + 4, a + 4]] for x in range(20) for k in range(4)
                 for a, b in [(4 * x + k, 4 * x + (k + 1) % 4)]]
        faces = np.array(sum(sides, []) + [[0, 2, 1], [0, 3, 2], [80, 81, 82], [80, 82, 83]])[:, ::-1]
        ebpo.convert((vertices, faces), "rod.ebpo.h5")
        whole, parts = ebpo.open("rod.ebpo.h5"), cut_by_sample("rod.ebpo.h5", "rod", "2")[1]
        p = np.random.default_rng(8).uniform([-1, -.2, -.2], [21, 1.2, 1.2], (3000, 3))
        np.testing.assert_array_equal(parts.winding(p), whole.winding(p))
        np.testing.assert_array_equal(parts.distance(p)["distance"], whole.distance(p).distance)

    def test_folders_of_arrays(self):
        """Arrays stay on the disk and are read in several ranges. Face indices may have any integer type."""
        vertices, faces = self.whole.mesh(order="source")
        os.makedirs("arrays", exist_ok=True)
        np.save("arrays/vertices.npy", vertices.astype(np.float64))
        p = np.concatenate([points(2000, seed=12), on_triangles(self.corners[::9])])
        for kind in (np.int64, np.uint32):
            np.save("arrays/faces.npy", faces.astype(kind))
            parts = cut_by_sample("arrays", f"cut_{np.dtype(kind).name}")[1]
            same(parts.locate(p), self.catalogue.locate(p))
            np.testing.assert_array_equal(parts.distance(p)["distance"], self.whole.distance(p).distance)
            numbers = np.concatenate([np.load(entry.numbers) for entry in parts.entries])
            np.testing.assert_array_equal(np.sort(numbers), np.arange(len(faces)))
        np.save("arrays/faces.npy", faces[:-1])
        with self.assertRaisesRegex(SystemExit, "not closed"):
            cut_by_sample("arrays", "cut_open")

    def test_faces_are_dealt_out_and_caps_cancel(self):
        self.assertEqual(len(self.catalogue), 8)
        numbers = np.concatenate([np.load(entry.numbers) for entry in self.catalogue.entries])
        np.testing.assert_array_equal(np.sort(numbers), np.arange(self.whole.info.face_count))
        self.assertGreater(len(self.caps), 100)
        counts = [int(line.split()[-2]) for line in self.printed.splitlines() if line.endswith("caps")]
        self.assertEqual(sum(counts), len(self.caps))
        balance = {}
        for face in self.caps:
            key = tuple(sorted(map(tuple, face)))
            order = [key.index(tuple(corner)) for corner in face]
            even = order in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
            balance[key] = balance.get(key, 0) + (1 if even else -1)
        self.assertEqual(set(balance.values()), {0})

    def points(self):
        """Return random points, and points on faces and caps whose coordinates are exact doubles."""
        yield points(5000, seed=8)
        for k in (self.corners[::3], self.caps):
            yield on_triangles(k)

    def test_inside_and_winding(self):
        for p, least in zip(self.points(), (1, 1, 100)):
            results, expected = self.catalogue.locate(p), self.whole.locate(p)
            np.testing.assert_array_equal(results["where"], expected.where)
            np.testing.assert_array_equal(results["winding"], expected.winding)
            on_parts = np.zeros(len(p), bool)
            for entry in self.catalogue.entries:
                on_parts |= ebpo.open(entry.path).locate(p).where == Where.ON
            np.testing.assert_array_equal(self.catalogue.inside(p), self.whole.inside(p))
            same(by_command("inside", self.catalogue, p), results)
            self.points_on_caps = (on_parts & (expected.where != Where.ON)).sum()
        self.assertGreater(self.points_on_caps, least, "points on caps, which are not faces of the whole")

    def test_distance_and_rays_ignore_caps(self):
        for p in self.points():
            results, expected = self.catalogue.distance(p), self.whole.distance(p)
            same(by_command("distance", self.catalogue, p), results)
            np.testing.assert_array_equal(results["distance"], expected.distance)
            np.testing.assert_allclose(results["point"], expected.point, rtol=0, atol=1e-14)
            only = results["face"] == expected.face
            corners = self.corners[results["face"][~only]]  # another face is as near: both contain the nearest point
            shared = np.abs(self.corners[expected.face[~only]][:, :, None] - corners[:, None]).max(axis=3) == 0
            self.assertTrue(shared.any(axis=(1, 2)).all())
        o, d = 2 * points(4000, seed=2), points(4000, seed=3)
        results, expected = self.catalogue.ray(o, d), self.whole.ray(o, d)
        for name in ("t", "face", "side"):
            np.testing.assert_array_equal(results[name], getattr(expected, name))
        np.testing.assert_array_equal(command_results("inside", "scan", o)["where"], self.catalogue.locate(o)["where"])

    def test_open_meshes_are_refused(self):
        faces = np.arange(9).reshape(3, 3)
        with self.assertRaises(SystemExit):
            list(self.cut.cycles(self.cut.open_edges(faces)[:-1]))

    def test_rule_of_the_whole(self):
        vertices, faces = model("cube").mesh(order="source")
        two = np.concatenate([vertices, vertices * .5 + .3]), np.concatenate([faces, faces + len(vertices)])
        for rule, inner in (("evenodd", 0), ("nonzero", 1)):
            ebpo.convert(two, f"{rule}.ebpo.h5", rule=rule)
            results = cut_by_sample(f"{rule}.ebpo.h5", f"cut_{rule}")[1].locate(P)
            same(by_command("inside", Catalogue.open(f"cut_{rule}/catalogue.json"), P), results)
            expected = ebpo.open(f"{rule}.ebpo.h5").locate(P)
            np.testing.assert_array_equal(results["where"], expected.where)
            np.testing.assert_array_equal(results["winding"], expected.winding)
            self.assertEqual(set(results["where"][results["winding"] == 2].tolist()), {inner})

    def test_chains(self):
        for count in range(3, 40):
            chain = np.arange(count) * 7 % 1000
            cap = self.cut.filled(chain)
            self.assertEqual(len(cap), count - 2)
            edges = {tuple(edge) for face in cap for edge in zip(face, np.roll(face, -1))}
            border = {(a, b) for a, b in edges if (b, a) not in edges}
            self.assertEqual(border, set(zip(chain.tolist(), np.roll(chain, -1).tolist())))
            self.assertLess(np.unique(cap, return_counts=True)[1].max(), 2 * np.log2(count) + 2)
        eight = np.array([[0, 1, 2], [0, 3, 4]])  # two chains that share one vertex
        found = sorted(sorted(chain.tolist()) for chain in self.cut.cycles(self.cut.open_edges(eight)))
        self.assertEqual(found, [[0, 1, 2], [0, 3, 4]])


if __name__ == "__main__":
    run()
