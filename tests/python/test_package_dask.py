#!/usr/bin/env python3
"""Tests ebpo.dask: equal bytes with every scheduler, chunk and worker; killed workers and clients.

Exit code 77: dask or distributed is missing.
"""
import errno
import http.server
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import unittest.mock
import weakref

try:
    import dask.array
    import distributed
except ImportError as error:
    print(f"skipped: {error} (tools/install-deps.sh --tests)")
    sys.exit(77)

from package_support import Case, model, np, points, run

import ebpo
import ebpo.dask as ed
from ebpo.catalogue import Catalogue

P = points(20_000, seed=4)
D = points(20_000, seed=6)
INPUT = pathlib.Path("points.npy")


def h5py_or_none():
    try:
        import h5py
        return h5py
    except ImportError:
        return None


def setUpModule():
    model("scan")
    np.save(INPUT, P)
    P.tofile("points.raw")


class Results(Case):
    """Schedulers in this process."""

    def test_results_of_the_model(self):
        m = model("scan")
        for scheduler, chunk in (("sync", 7000), ("threads", 999), ("threads", 1 << 18)):
            options = {"chunk": chunk}
            with dask.config.set(scheduler=scheduler):
                np.testing.assert_array_equal(ed.inside("scan.ebpo.h5", P, **options).compute(), m.inside(P))
                np.testing.assert_array_equal(ed.winding("scan.ebpo.h5", P, **options).compute(), m.winding(P))
                nearest = ed.distance("scan.ebpo.h5", P[:5000], **options)
                self.same(dask.compute(*nearest[:4]), m.distance(P[:5000]))
                for o, d in ((2 * P, D), (2 * P, np.array([0, .1, 1.]))):
                    self.same(dask.compute(*ed.ray("scan.ebpo.h5", o, d, **options)[:3]), m.ray(o, d))
        near = ed.distance("scan.ebpo.h5", P[:999], max_distance=.1).face.compute()
        np.testing.assert_array_equal(near, m.distance(P[:999], max_distance=.1).face)

    def test_masked(self):
        """Masked coordinates are NaN, as in the queries of a model."""
        m, hidden = model("scan"), np.zeros((400, 3), bool)
        hidden[[3, 250], 1] = True
        masked, origins = np.ma.masked_array(P[:400], hidden), 2 * P[:400]
        for given in (masked, dask.array.from_array(masked, chunks=(99, 3))):
            with dask.config.set(scheduler="sync"):
                self.same(dask.compute(*ed.distance("scan.ebpo.h5", given, nan="propagate")[:4]),
                          m.distance(masked, nan="propagate"))
                self.same(dask.compute(*ed.ray("scan.ebpo.h5", origins, given, nan="propagate")[:3]),
                          m.ray(origins, masked, nan="propagate"))
                self.same(dask.compute(*ed.ray("scan.ebpo.h5", origins, masked[3], nan="propagate")[:3]),
                          m.ray(origins, masked[3], nan="propagate"))
                with self.assertRaisesRegex(ebpo.ArgumentError, "point 3 has a coordinate that is not a finite"):
                    ed.inside("scan.ebpo.h5", given).compute()

    def test_points_from_everywhere(self):
        m, expected = model("scan"), model("scan").winding(P)
        given = [(P, None), (dask.array.from_array(P, chunks=(6000, 2)), None), (INPUT, None), ("points.raw", None),
                 (P.tolist()[:500], None)]
        if h5py_or_none():
            with h5py_or_none().File("points.h5", "w") as file:
                file["a/P"], file["other"] = P, np.zeros(3)
                file["a/P"].attrs["coding"] = "of another format"
            given += [("points.h5", "a/P"), ("points.h5", None)]
        for source, dataset in given:
            found = ed.winding("scan.ebpo.h5", source, dataset=dataset, chunk=3333)
            np.testing.assert_array_equal(found.compute(), expected[:found.shape[0]])
        some = dask.array.from_array(P, chunks=(1000, 3))
        some = some[some[:, 0] > 0]  # chunks of unknown sizes
        np.testing.assert_array_equal(ed.inside("scan.ebpo.h5", some).compute(), m.inside(P[P[:, 0] > 0]))
        self.assertEqual(ed.inside("scan.ebpo.h5", np.zeros((0, 3))).compute().shape, (0,))

    def test_datasets_that_cannot_be_points(self):
        h5py = h5py_or_none()
        if not h5py:
            self.skipTest("no h5py")
        with h5py.File("several.h5", "w") as file:
            file["a"], file["b/c"], file["complex"], file["empty"] = P, P, P.astype(complex), h5py.Empty("f8")
        for path, dataset, says in (("several.h5", None, "name one .*: a, b/c$"), ("several.h5", "complex", "real"),
                                    ("several.h5", "empty", "shape"), ("scan.ebpo.h5", "mesh/vertices", "codes.*mesh"),
                                    ("scan.ebpo.h5", None, "0 datasets")):
            with self.assertRaisesRegex(ebpo.FormatError, says):
                model("scan")
                ed.points(path, dataset)

    def test_hdf5_without_locks(self):
        """A file system without locks, such as some network file systems, and a file that another program writes."""
        h5py = h5py_or_none()
        if not h5py:
            self.skipTest("no h5py")
        with h5py.File("points.h5", "w") as file:
            file["points"] = P
        tried, number = [], errno.ENOLCK

        class Locking(h5py.File):
            def __init__(self, name, mode, **options):
                tried.append(options)
                if "locking" not in options:
                    raise OSError(number, f"unable to lock file, errno = {number}")
                super().__init__(name, mode, **options)

        with unittest.mock.patch.object(h5py, "File", Locking):
            np.testing.assert_array_equal(ed.points("points.h5").compute(), P)
            number = errno.EAGAIN
            with self.assertRaisesRegex(ebpo.IOFailure, "open for writing"):
                ed.points("points.h5")
        self.assertIn({"locking": False}, tried)

    def test_invalid_queries(self):
        pathlib.Path("odd.raw").write_bytes(b"x" * 100)
        np.save("wide.npy", np.zeros((5, 4)))
        np.save("complex.npy", np.zeros((5, 3), complex))
        pathlib.Path("cut.npy").write_bytes(INPUT.read_bytes()[:2000])
        for wrong in ("odd.raw", "wide.npy", "complex.npy", "cut.npy"):
            with self.assertRaisesRegex(ebpo.FormatError, wrong):
                ed.points(wrong)
        with self.assertRaisesRegex(ValueError, "shape"):
            ed.inside("scan.ebpo.h5", np.zeros((5, 2)))
        with self.assertRaisesRegex(ValueError, "can be queried"):
            ed.query("beauty", "scan.ebpo.h5", P)
        with self.assertRaisesRegex(TypeError, "Catalogue"):
            ed.inside(model("scan"), P)
        with self.assertRaises(ebpo.NotSolidError):
            ebpo.convert("open_box.ply", "bare.ebpo.h5", parts="mesh,maps")
            ed.inside("bare.ebpo.h5", P).compute()

    def test_errors_number_points_in_the_whole(self):
        bad, rays = P.copy(), np.concatenate([2 * P, D], axis=1)
        bad[12_345, 1], rays[7777, 3:] = np.nan, 0
        with self.assertRaisesRegex(ebpo.ArgumentError, "point 12345 "):
            ed.inside("scan.ebpo.h5", bad, chunk=1000).compute(scheduler="sync")
        with self.assertRaisesRegex(ebpo.ArgumentError, "ray 7777 "):
            ed.query("ray", "scan.ebpo.h5", rays, chunk=1000).compute(scheduler="sync")
        with self.assertRaisesRegex(ebpo.ArgumentError, "ray 0 needs a t_max"):
            ed.query("ray", "scan.ebpo.h5", rays, chunk=1000, t_max=-1).compute(scheduler="sync")
        some = dask.array.from_array(bad, chunks=(1000, 3))
        with self.assertRaisesRegex(ebpo.ArgumentError, "point 345 "):
            ed.inside("scan.ebpo.h5", some[some[:, 0] != 9]).compute(scheduler="sync")

    def test_files_that_change(self):
        shutil.copy(INPUT, "changing.npy")
        query = ed.inside("scan.ebpo.h5", "changing.npy")
        np.save("changing.npy", P[::-1])
        with self.assertRaisesRegex(ebpo.IOFailure, "changed"):
            query.compute()
        shutil.copy("scan.ebpo.h5", "changing.ebpo.h5")
        query = ed.inside("changing.ebpo.h5", P)
        model("open_box")
        shutil.copy("open_box.ebpo.h5", "changing.ebpo.h5")
        with self.assertRaisesRegex(ebpo.FormatError, "has changed"):
            query.compute()

    def test_one_budget(self):
        for i in range(6):
            shutil.copy("scan.ebpo.h5", f"copy{i}.ebpo.h5")
        before = ed.stats()
        results = ed.winding([f"copy{i}.ebpo.h5" for i in range(6)], P, memory="9M", chunk=2000)
        np.testing.assert_array_equal(results.compute(), 6 * model("scan").winding(P))
        after = ed.stats()
        self.assertGreaterEqual(after["opened"] - before["opened"], 6)
        self.assertGreater(after["bytes_read"], before["bytes_read"])
        self.assertLessEqual(after["memory"], 9_000_000)
        ebpo.open_models.process_models("1GiB").clear()


class Files(Case):
    def test_every_kind(self):
        inside = ed.inside("scan.ebpo.h5", INPUT, chunk=3000)
        ed.to_file(inside, "inside.npy")
        np.testing.assert_array_equal(np.load("inside.npy"), model("scan").inside(P))
        rows = ed.query("distance", "scan.ebpo.h5", P[:4000], chunk=1500)
        ed.to_file(rows, "nearest.npy", scheduler="sync")
        np.testing.assert_array_equal(np.load("nearest.npy"), rows.compute())
        matrix = np.arange(24.).reshape(6, 4)  # chunks of columns as well
        ed.to_file(dask.array.from_array(matrix, chunks=(3, 2)), "matrix.npy", scheduler="sync")
        np.testing.assert_array_equal(np.load("matrix.npy"), matrix)
        ed.to_file(inside, "folder")
        parts = sorted(pathlib.Path("folder").glob("*.npy"))
        np.testing.assert_array_equal(np.concatenate([np.load(part) for part in parts]), model("scan").inside(P))
        if h5py_or_none():
            ed.to_file(rows, "nearest.h5", dataset="near")
            with h5py_or_none().File("nearest.h5") as file:
                np.testing.assert_array_equal(file["near"][:], rows.compute())
        with self.assertRaises(FileExistsError):
            ed.to_file(inside, "inside.npy")
        self.assertEqual([str(p) for p in pathlib.Path(".").glob("*.parts")], [])
        self.assertEqual([str(p) for p in pathlib.Path(".").glob(".*")], [], "no temporary files remain")

    def test_few_chunks_are_mapped_at_a_time(self):
        opened, load, limit = [], np.load, [0]

        def counted(*arguments, **options):
            opened[:] = [part for part in opened if part() is not None]
            part = load(*arguments, **options)
            opened.append(weakref.ref(part))
            limit[0] = max(limit[0], len(opened))
            return part

        self.addCleanup(setattr, np, "load", load)
        np.load = counted
        ed.to_file(ed.inside("scan.ebpo.h5", P[:1000], chunk=4), "many.npy", scheduler="sync")
        np.testing.assert_array_equal(load("many.npy"), model("scan").inside(P[:1000]))
        self.assertTrue(1 <= limit[0] <= 3, limit)

    def test_two_processes_begin_one_folder(self):
        """The query of the second process is compared with that of the first, and does not replace it."""
        from ebpo.point_files import published
        inside, other = (ed.inside("scan.ebpo.h5", P[:n], chunk=100) for n in (300, 200))
        folder = pathlib.Path("begun.npy.parts")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        ed.begin_parts(folder, inside)
        before = (folder / "query.json").read_bytes()
        with self.assertRaises(FileExistsError), published(folder / "query.json", new=True) as file:
            file.write(b"{}")
        with unittest.mock.patch.object(pathlib.Path, "exists", side_effect=[False]), \
                unittest.mock.patch.object(pathlib.Path, "iterdir", return_value=[]):
            with self.assertRaisesRegex(ValueError, "another query"):
                ed.begin_parts(folder, other)
        self.assertEqual((folder / "query.json").read_bytes(), before)
        self.assertEqual(len([*folder.iterdir()]), 1)

    def test_invalid_chunks_are_not_joined(self):
        inside = ed.inside("scan.ebpo.h5", P[:300], chunk=100)
        self.addCleanup(shutil.rmtree, "joined.npy.parts", ignore_errors=True)
        folder = pathlib.Path("joined.npy.parts")
        ed.begin_parts(folder, inside)
        for wrong in (np.zeros(99, bool), np.zeros(100, np.int8), None):
            if wrong is None:
                (folder / "000001.npy").write_bytes(b"none")
            else:
                np.save(folder / "000001.npy", wrong)
            with self.assertRaisesRegex(ValueError, "000001.npy.*compute it again"):
                ed.to_file(inside, "joined.npy")
        os.remove(folder / "000001.npy")
        ed.to_file(inside, "joined.npy")
        np.testing.assert_array_equal(np.load("joined.npy"), model("scan").inside(P[:300]))

    def test_invalid_points(self):
        np.save("complex.npy", np.zeros((3, 3), complex))
        np.save("text.npy", np.full((3, 3), "1"))
        pathlib.Path("cut.npy").write_bytes(pathlib.Path("text.npy").read_bytes()[:140])
        for name in ("complex.npy", "text.npy", "cut.npy"):
            with self.subTest(name), self.assertRaises(ebpo.FormatError):
                ed.inside("scan.ebpo.h5", name)
        for chunk in (0, -1):
            with self.subTest(chunk), self.assertRaisesRegex(ValueError, "1 point or more"):
                ed.inside("scan.ebpo.h5", P, chunk=chunk)
        self.assertEqual(ed.inside("scan.ebpo.h5", P[:5], chunk=1).numblocks, (5,))

    def test_killed_client_continues(self):
        """The client is killed after some chunks. The next one does not compute these chunks again."""
        script = (f"import sys, time; sys.argv[1:] = []\nimport ebpo.dask as ed, ebpo.catalogue as cat\n"
                  f"slow = cat.Catalogue.inside\n"
                  f"def inside(*a, **k):\n    time.sleep(.2)\n    return slow(*a, **k)\n"
                  f"cat.Catalogue.inside = inside\n"
                  f"ed.to_file(ed.inside('scan.ebpo.h5', '{INPUT}', chunk=500), 'killed.npy', scheduler='sync')\n")
        client = subprocess.Popen([sys.executable, "-c", script])
        self.addCleanup(shutil.rmtree, "killed.npy.parts", ignore_errors=True)
        folder, deadline = pathlib.Path("killed.npy.parts"), time.monotonic() + 60
        while len(list(folder.glob("*.npy"))) < 5 and time.monotonic() < deadline:
            time.sleep(.02)
        client.kill()
        client.wait()
        self.assertFalse(os.path.exists("killed.npy"))
        done = {part.name: part.stat().st_mtime_ns for part in folder.glob("0*.npy")}
        self.assertTrue(5 <= len(done) < 40)
        with self.assertRaisesRegex(ValueError, "another query"):
            ed.to_file(ed.winding("scan.ebpo.h5", INPUT, chunk=500), "killed.npy")
        kept = {}
        joined = ed.join_parts
        ed.join_parts = lambda path, names, dataset: (
            kept.update((n.name, n.stat().st_mtime_ns) for n in names), joined(path, names, dataset))
        try:
            ed.to_file(ed.inside("scan.ebpo.h5", INPUT, chunk=500), "killed.npy")
        finally:
            ed.join_parts = joined
        self.assertEqual({name: kept[name] for name in done}, done)
        np.testing.assert_array_equal(np.load("killed.npy"), model("scan").inside(P))


class Unavailable(http.server.BaseHTTPRequestHandler):
    """Serves ranges of a file; returns status 503 until `until`. None: for two seconds from the next request."""
    until, refused, protocol_version = 0.0, 0, "HTTP/1.1"

    def do_GET(self):
        if Unavailable.until is None:
            Unavailable.until = time.monotonic() + 2
        if time.monotonic() < Unavailable.until:
            Unavailable.refused += 1
            self.send_response(503)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        data = pathlib.Path("scan.ebpo.h5").read_bytes()
        first, last = map(int, re.match(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        part = data[first:last + 1]
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{len(data)}")
        self.send_header("Content-Length", str(len(part)))
        self.send_header("ETag", '"1"')
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_):
        pass


def take_time():
    """Slow the queries of a worker down, so that it is killed during its work."""
    quick = Catalogue.distance

    def slow(*arguments, **options):
        time.sleep(.05)
        return quick(*arguments, **options)

    Catalogue.distance = slow


class Cluster(Case):
    """Two worker processes."""

    @classmethod
    def setUpClass(cls):
        main = sys.modules["__main__"]  # workers must not run this file
        cls.addClassCleanup(setattr, main, "__file__", main.__file__)
        main.__file__ = None
        dask.config.set({"distributed.worker.use-file-locking": False, "temporary-directory": os.getcwd()})
        cls.cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True,
                                               dashboard_address=None, memory_limit=None)
        cls.client = distributed.Client(cls.cluster)

    @classmethod
    def tearDownClass(cls):
        cls.client.close()
        cls.cluster.close()

    def test_a_worker_dies_and_one_is_slow(self):
        pids = self.client.run(os.getpid)
        self.assertEqual(len(pids), 2)
        rows = ed.query("distance", os.path.abspath("scan.ebpo.h5"), INPUT, chunk=500, memory="64M")
        expected = Catalogue.of(["scan.ebpo.h5"]).distance(P)
        self.client.run(take_time)
        future = self.client.compute(rows)
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and not all(c["hits"] + c["open"] for c in ed.stats(self.client).values()):
            time.sleep(.05)
        self.assertFalse(future.done())
        first, second = pids.values()
        os.kill(first, signal.SIGKILL)
        os.kill(second, signal.SIGSTOP)
        time.sleep(.5)
        os.kill(second, signal.SIGCONT)
        self.assertEqual(future.result(60).tobytes(), expected.tobytes())
        self.assertNotIn(first, self.client.run(os.getpid).values())

    def test_workers_keep_the_model(self):
        name = os.path.abspath("scan.ebpo.h5")
        inside = ed.inside(name, P, chunk=1000)
        np.testing.assert_array_equal(inside.compute(), model("scan").inside(P))
        before = ed.stats(self.client)
        np.testing.assert_array_equal(ed.inside(name, P[::-1], chunk=700).compute(), model("scan").inside(P[::-1]))
        after = ed.stats(self.client)
        self.assertEqual(sum(c["opened"] for c in after.values()), sum(max(1, c["opened"]) for c in before.values()))

    def test_a_server_is_away(self):
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Unavailable)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        catalogue = Catalogue.of([f"http://127.0.0.1:{server.server_port}/scan.ebpo.h5"])
        Unavailable.until = None  # a fixed time could be over before a busy machine sends the first request
        results = ed.inside(catalogue, P, chunk=5000).compute()
        np.testing.assert_array_equal(results, model("scan").inside(P))
        self.assertGreater(Unavailable.refused, 0)

    def test_to_file(self):
        ed.to_file(ed.inside(os.path.abspath("scan.ebpo.h5"), INPUT, chunk=1500), "of_cluster.npy")
        np.testing.assert_array_equal(np.load("of_cluster.npy"), model("scan").inside(P))


if __name__ == "__main__":
    run()
