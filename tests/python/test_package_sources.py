#!/usr/bin/env python3
"""Tests all sources of bytes: paths, bytes, file objects, objects with ranges, fsspec, a web server."""
import contextlib
import http.server
import io
import mmap
import os
import pathlib
import re
import socket
import subprocess
import threading
import time
import unittest.mock

from package_support import COMMAND, GENERATE, Case, model, np, points, run

import ebpo
from ebpo import automatic, sources
from ebpo.ranges import Ranges as Far
from ebpo.web import Patience

P = points(500)


class Ranges:
    def __init__(self, data):
        self.data, self.size, self.requested = data, len(data), 0

    def read_range(self, offset, size):
        self.requested += size
        return self.data[offset:offset + size]


class Server(http.server.BaseHTTPRequestHandler):
    """A server of ranges of one file. It first returns the status codes in `fail`."""
    data, etag, fail, protocol_version = b"", '"1"', [], "HTTP/1.1"
    keys: list = []  # the header X-Key of each request for the file
    silent = False  # omits the header Content-Range
    later = ""  # value of Retry-After
    cut = 0  # number of responses that end too early
    cap = 1 << 30  # most bytes of a response
    plain = False  # True: does not support ranges
    count, max_at_once, now = 0, 0, 0  # requests: all, most at a time, current
    pause = .005  # seconds for each request
    lock = threading.Lock()
    connections, kind = 0, "application/octet-stream"

    def setup(self):
        Server.connections += 1
        super().setup()

    def do_GET(self):
        if self.path.startswith("/to?"):
            self.send_response(302)
            self.send_header("Location", self.path[4:])
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        Server.keys.append(self.headers["X-Key"])
        if Server.fail:
            code = Server.fail.pop()
            self.send_response(code)
            if Server.later:
                self.send_header("Retry-After", Server.later)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        with Server.lock:
            Server.count, Server.now = Server.count + 1, Server.now + 1
            Server.max_at_once = max(Server.max_at_once, Server.now)
        time.sleep(Server.pause)
        with Server.lock:
            Server.now -= 1
        first, last = map(int, re.match(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        first, last = (0, len(Server.data)) if Server.plain else (first, min(last, first + Server.cap - 1))
        part = Server.data[first:last + 1]
        self.send_response(200 if Server.plain else 206)
        if not Server.silent and not Server.plain:
            self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{len(Server.data)}")
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Content-Type", Server.kind)
        if Server.etag:
            self.send_header("ETag", Server.etag)
        self.end_headers()
        if Server.cut:
            Server.cut -= 1
            self.wfile.write(part[:len(part) // 2])
            self.close_connection = True
            return
        self.wfile.write(part)

    def log_message(self, *_):
        pass


class Sources(Case):
    @classmethod
    def setUpClass(cls):
        cls.expected = model("scan").distance(P)
        cls.data = pathlib.Path("scan.ebpo.h5").read_bytes()

    def test_bytes(self):
        with open("scan.ebpo.h5", "rb") as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        for given in (self.data, bytearray(self.data), memoryview(self.data), mapped,
                      np.frombuffer(self.data, np.uint8), pathlib.Path("scan.ebpo.h5"), "scan.ebpo.h5"):
            self.same(ebpo.open(given).distance(P), self.expected)

    def test_files_and_ranges(self):
        ranges = Ranges(self.data)
        with open("scan.ebpo.h5", "rb", buffering=0) as raw:
            for given in (io.BytesIO(self.data), open("scan.ebpo.h5", "rb"), raw, ranges):
                self.same(ebpo.open(given).distance(P), self.expected)
        self.assertGreater(ranges.requested, 0)

    def test_sources_that_fail(self):
        class Failing(Ranges):
            def read_range(self, offset, size):
                if self.requested > 0:
                    raise KeyError("no such part")
                return super().read_range(offset, size)

        with self.assertRaisesRegex(ebpo.IOFailure, "KeyError.*no such part") as caught:
            ebpo.open(Failing(large())).mesh()
        with self.assertRaisesRegex(ebpo.IOFailure, "a name with"):
            class Unencodable(Ranges):
                def read_range(self, offset, size):
                    if self.requested:
                        raise OSError("a name with \udcff and \0")
                    return super().read_range(offset, size)
            ebpo.open(Unencodable(large())).mesh()
        self.assertIsInstance(caught.exception, OSError)

        class Short(Ranges):
            def read_range(self, offset, size):
                return super().read_range(offset, size)[:-1]

        with self.assertRaisesRegex(ebpo.IOFailure, "expected .* bytes at byte"):
            ebpo.open(Short(self.data))
        with self.assertRaises(ebpo.FormatError):
            ebpo.open(b"not such a file" * 100)
        with self.assertRaises(OSError):
            ebpo.open("nothing.ebpo.h5")
        for nonsense in (3, object(), None):
            with self.assertRaisesRegex(TypeError, "neither a path"):
                ebpo.open(nonsense)
        with self.assertRaises(TypeError):
            ebpo.open("scan.ebpo.h5", retries=3)
        with self.assertRaisesRegex(TypeError, "nonsense"):
            ebpo.open("http://127.0.0.1:1/", nonsense=3)

    def test_damage(self):
        damaged = bytearray(self.data)
        for at in range(len(damaged) // 2, len(damaged), 997):
            damaged[at] ^= 0x55
        with self.assertRaises((ebpo.FormatError, ebpo.IOFailure)):
            ebpo.open(damaged).mesh()

    def test_fsspec(self):
        try:
            import fsspec
        except ImportError:
            with self.assertRaisesRegex(ImportError, "fsspec"):
                ebpo.open("memory://scan.ebpo.h5")
            return
        with fsspec.open("memory://scan.ebpo.h5", "wb") as file:
            file.write(self.data)
        self.same(ebpo.open("memory://scan.ebpo.h5").distance(P), self.expected)

    def serve(self, data=None):
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        Server.data = data or self.data
        return f"http://127.0.0.1:{server.server_port}"

    def test_headers_stay_with_their_server(self):
        one, other = self.serve(), self.serve()
        for address, key in ((one, "1"), (f"{one}/to?{one}", "1"), (f"{one}/to?{other}", None),
                             (f"{one}/to?{other}/to?{one}", None)):
            Server.keys.clear()
            self.assertEqual(sources.Web(f"{address}/scan.ebpo.h5", {"X-Key": "1"}).size, len(self.data))
            self.assertEqual(Server.keys, [key], address)
        with self.assertRaisesRegex(OSError, "302|not followed"):
            sources.Web(f"{one}/to?ftp://127.0.0.1/scan.ebpo.h5")
        with self.assertRaisesRegex(OSError, "302|redirect"):
            sources.Web(f"{one}/to?" * 6 + f"{one}/scan.ebpo.h5")
        Server.silent = True
        self.addCleanup(setattr, Server, "silent", False)
        with self.assertRaisesRegex(OSError, "which range"):
            sources.Web(f"{one}/scan.ebpo.h5")

    def test_web(self):
        data = large()
        url = f"{self.serve(data)}/scan.ebpo.h5?key=secret"
        self.same(ebpo.open(url, headers={"X-Key": "1"}, retries=2).locate(P), ebpo.open(data).locate(P))

        # Python's HTTP is used when the library has none.
        Server.fail = [503, 500]
        web = sources.Web(url)
        self.assertEqual((web.size, web.read_range(100, web.size - 200)), (len(data), data[100:-100]))
        Server.etag = 'W/"1"'
        self.assertEqual(web.read_range(len(web.head), 10), data[len(web.head):][:10], "compared weakly")
        Server.etag = '"2"'
        with self.assertRaisesRegex(ebpo.IOFailure, "changed"):
            web.read_range(len(data) - 10, 10)
        Server.etag, Server.fail = '"1"', [404]
        with self.assertRaisesRegex(FileNotFoundError, "status 404"):
            sources.Web(url)

    def test_patience(self):
        """Requests to an unavailable server are repeated, after the delay that it requests, within the limits."""
        url = f"{self.serve()}/scan.ebpo.h5?key=secret"
        self.addCleanup(setattr, Server, "later", "")
        self.addCleanup(Server.fail.clear)
        waited = []
        real, Patience.FIRST = Patience.FIRST, 0.001
        self.addCleanup(setattr, Patience, "FIRST", real)
        Server.fail[:] = [503] * 5
        self.assertEqual(sources.Web(url).size, len(self.data))
        Server.cut = 2
        self.assertEqual(sources.Web(url).size, len(self.data), "short bodies are requested again")
        Server.fail[:] = [503] * 5
        with self.assertRaisesRegex(OSError, "no response after 4 requests.*503.* 3 retries") as caught:
            sources.Web(url, retries=3)
        self.assertNotIn("secret", str(caught.exception))
        Server.fail[:] = [503] * 1000
        # At the end of the limit, there may be too little time left for a response.
        with self.assertRaisesRegex(OSError, "(status 503|not complete in time); 0.3 s"):
            sources.Web(url, time_limit=.3, retries=None)
        Server.fail[:], Server.later = [429], "3600"
        with self.assertRaisesRegex(OSError, "after 1 requests.*status 429"):
            sources.Web(url)
        Server.fail[:], Server.later = [503], "1"
        begin = time.monotonic()
        sources.Web(url)
        self.assertGreaterEqual(time.monotonic() - begin, 1)
        for _ in range(20):  # pauses double, and differ between clients
            patience = Patience(1e9, None, "it")
            patience.FIRST, patience.failures = 0.001, 3
            begin = time.monotonic()
            patience.wait(TimeoutError())
            waited.append(time.monotonic() - begin)
        self.assertTrue(.004 <= min(waited) < max(waited))
        with self.assertRaisesRegex(OSError, "refused"):
            sources.Web("http://127.0.0.1:1/", time_limit=.01)


    def changed(self, **server):
        """Set members of Server for this test."""
        for name, value in server.items():
            self.addCleanup(setattr, Server, name, getattr(Server, name))
            setattr(Server, name, value)

    def by_web(self, url, **http):
        """Open a model with Python's own HTTP, as when the library has none."""
        self.assertTrue(sources.has_http())
        with unittest.mock.patch.object(sources, "has_http", return_value=False):
            return ebpo.open(url, **http)

    def test_web_reads_parts(self):
        """Only the bytes that a query needs are read, joined and several ranges at a time, as in the library."""
        url = f"{self.serve(large())}/large.ebpo.h5"
        self.changed(count=0, max_at_once=0, pause=.1)  # long enough for a busy machine to send several requests
        library = ebpo.open(url)
        expected = library.distance(P), library.inside(P[0])
        counts = []
        for open_it in (ebpo.open, self.by_web):
            Server.count, Server.max_at_once = 0, 0
            m = open_it(url)
            self.same((m.inside(P[0]),), expected[1:])
            counts.append(Server.count)
            self.assertEqual((m.stats["budget"], m.stats["resident"]), (256 << 20, False))
            self.same(m.distance(P), expected[0])
            self.assertGreater(Server.max_at_once, 3)
        self.assertLessEqual(counts[1], counts[0])
        self.assertLess(counts[1], 10)

    def test_connections_are_used_again(self):
        url = f"{self.serve(large())}/large.ebpo.h5"
        self.changed(connections=0, timeout=.3)
        web = sources.Web(f"{url[:-14]}/to?{url}")
        for at in range(200_000, 201_000, 100):
            self.assertEqual(web.read_range(at, 1000), large()[at:at + 1000])
        self.assertEqual(Server.connections, 1)
        time.sleep(.6)  # the server closes idle connections
        self.assertEqual(web.read_range(200_000, 1000), large()[200_000:201_000])
        Server.cut = 1
        self.assertEqual(web.read_range(200_000, 1000), large()[200_000:201_000])
        self.assertEqual(Server.connections, 3)

    def test_server_that_caps_ranges(self):
        self.changed(cap=40_000)
        url = f"{self.serve(large())}/scan.ebpo.h5"
        web = sources.Web(url)
        self.assertEqual((web.read_range(0, web.size), len(web.head)), (large(), 1 << 17))
        self.same(self.by_web(url).locate(P), ebpo.open(large()).locate(P))
        self.changed(etag="")
        with self.assertRaisesRegex(ebpo.IOFailure, "parts of the file"):
            sources.Web(url)
        self.assertEqual(sources.Web(url, unversioned=True).read_range(0, web.size), large())

    def test_server_without_ranges_or_versions(self):
        url = f"{self.serve(large())}/scan.ebpo.h5"
        for server in ({"plain": True}, {"etag": ""}):
            self.changed(**server)
            self.same(self.by_web(url).locate(P), ebpo.open(large()).locate(P))
            with self.assertRaisesRegex(ebpo.UnsupportedError, "download"):
                self.by_web(url, whole_limit=1000)
            self.changed(plain=False, etag='"1"')
        self.changed(plain=True, kind="text/html; charset=utf-8")
        with self.assertRaisesRegex(ebpo.IOFailure, "sends text/html"):
            sources.Web(url)
        for connections in (0, 33, -1):
            with self.assertRaisesRegex(ValueError, "connections"):
                self.by_web(url, connections=connections)
        with self.assertRaisesRegex(ValueError, "time-out"):
            sources.Web(url, time_limit=0)
        for bad in ({"A\n": "b"}, {"A": "b\r\nC: d"}):
            with self.assertRaisesRegex(ValueError, "header"):
                sources.Web(url, headers=bad)

    def test_time_limit(self):
        """Every endless response raises IOFailure after `time_limit`, and no other exception."""
        good = b"HTTP/1.1 206 OK\r\nContent-Range: bytes 0-9/10\r\n"
        cases = {"trickle": (good + b"Content-Length: 10\r\n\r\n", b"0", .5),
                 "trailers": (good + b"Transfer-Encoding: chunked\r\n\r\na\r\n0123456789\r\n0\r\n", b"X: y\r\n", 0),
                 "continues": (b"", b"HTTP/1.1 100 Continue\r\n\r\n", 0), "headers": (good, b"X: y\r\n", 0),
                 "a header": (good + b"X: ", b"y" * 1000, 0), "status": (b"", b"x" * 1000, 0), "silence": (b"", b"", .1),
                 "redirect": (b"HTTP/1.1 302 OK\r\nLocation: /\r\n\r\n", b"x" * 1000, 0),
                 "slow redirect": (b"HTTP/1.1 302 OK\r\nX: ", b"x", .2), "garbage": (b"\0\xff\r\n\r\n", b"\0" * 1000, 0),
                 "a chunk": (good + b"Transfer-Encoding: chunked\r\n\r\n-5\r\n", b"x" * 1000, 0),
                 "chunks": (good + b"Transfer-Encoding: chunked\r\n\r\n", b"1;x=y\r\nx\r\n", .4),
                 "a longer body": (good + b"Content-Length: 10\r\n\r\n", b"0123456789", 0)}
        def query(name, begin, rest, pause):
            listening = socket.create_server(("127.0.0.1", 0), backlog=50)
            self.addCleanup(listening.close)

            def serve(listening=listening, begin=begin, rest=rest, pause=pause):
                def respond(connection):
                    with contextlib.suppress(OSError), connection:
                        connection.recv(65536)
                        connection.sendall(begin)
                        while True:
                            connection.sendall(rest)
                            time.sleep(pause)
                with contextlib.suppress(OSError):
                    while True:
                        threading.Thread(target=respond, args=(listening.accept()[0],), daemon=True).start()

            threading.Thread(target=serve, daemon=True).start()
            began = time.monotonic()
            try:
                web = sources.Web(f"http://127.0.0.1:{listening.getsockname()[1]}/x", time_limit=1.0, retries=3,
                                  unversioned=True)
                self.assertEqual((name, web.size), ("a longer body", 10))  # Content-Length states its end
            except ebpo.IOFailure:
                pass
            took[name] = time.monotonic() - began

        took: dict = {}
        threads = [threading.Thread(target=query, args=(name, *case)) for name, case in cases.items()]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(set(took), set(cases))
        self.assertLess(max(took.values()), 10, took)

    def test_npy_shapes(self):
        """A .npy whose shape is negative, huge or overflows is refused, as points and as face indices."""
        from ebpo.catalogue import Catalogue
        from ebpo.open_models import process_models
        from ebpo.point_files import PointFile

        def save(shape, descr="<f8", body=bytes(48)):
            head = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
            pathlib.Path("x.npy").write_bytes(b"\x93NUMPY\x01\0" + bytes([len(head), 0]) + head.encode() + body)

        save("(2, 3)")
        self.assertEqual(PointFile.at("x.npy").read(0, 2).shape, (2, 3))
        for shape in ("(-1, 3)", "(-2, 3)", "(-2, -3)", "(-8, 3)", "(2, -3)", "(3, 3)", "(9223372036854775807, 3)", "(0, -3)",
                      "(99999999999999999999999, 3)", "(6148914691236517206, 3)", "(2.0, 3)", "(True, 3)", "(2, 3", "x"):
            save(shape)
            with self.assertRaises(ebpo.FormatError, msg=shape):
                PointFile.at("x.npy")
        model("cube")
        entry = Catalogue.of(["cube.ebpo.h5"]).entries[0]
        numbered = Catalogue([entry._replace(numbers=os.path.abspath("x.npy"))])
        save("(12,)", "<i8", np.arange(12).tobytes())
        self.assertLess(numbered.distance([.5, .5, .5])["face"], 12)
        process_models().clear()
        for shape in ("(-1,)", "(-6,)", "(7,)", "(2, 3)", "(4611686018427387910,)", "(99999999999999999999999,)"):
            save(shape, "<i8")
            with self.assertRaisesRegex(ebpo.FormatError, "x.npy", msg=shape):
                numbered.distance([.5, .5, .5])
        save("(2, 3)", "<i8", np.full(6, 2**53 + 1).tobytes())
        with self.assertRaisesRegex(ValueError, "no double"):
            PointFile.at("x.npy").read(0, 2)

    def test_ranges_ahead(self):
        """Ranges of prefetch hints are joined, fetched several at a time, and kept within the memory."""
        data = np.random.default_rng(1).bytes(3 << 20)
        requested, gate = [], threading.Event()

        class Slow:
            def read_range(self, offset, size):
                requested.append((offset, size))
                if offset:
                    gate.wait(10)
                return data[offset:offset + size]

        far = Far(Slow(), len(data), memory=1 << 20)
        self.assertEqual(requested, [(0, 1 << 17)])
        far.prefetch([(1 << 18, 1000), (300_000, 2000), ((1 << 18) + 2000, 1000), (1 << 20, 5000), (100, 200)])
        for _ in range(500):
            if len(requested) == 4:
                break
            time.sleep(.01)
        self.assertEqual(sorted(requested[1:]), [(1 << 18, 3000), (300_000, 2000), (1 << 20, 5000)], "three at a time, joined")
        gate.set()
        self.assertEqual(far.read_range(300_500, 100), data[300_500:300_600])
        self.assertEqual(len(requested), 4, "received bytes are not requested again")
        far.prefetch([(begin, 100_000) for begin in range(1 << 18, 2 << 20, 120_000)])
        for begin in range(1 << 18, 2 << 20, 120_000):
            self.assertEqual(far.read_range(begin, 100_000), data[begin:begin + 100_000])
            self.assertLessEqual(far.held, (1 << 20) + 100_000)
        self.assertEqual(far.read_range(0, len(data)), data, "more than the memory while it is read")
        self.assertLessEqual(far.held, 1 << 20)
        threads = [threading.Thread(target=lambda: [self.assertEqual(far.read_range(b, 999), data[b:b + 999])
                                                    for b in range(1000, 3 << 20, 7777)]) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def test_ranges_without_threads(self):
        """A reader fetches by itself when no thread can be started, and after a fork."""
        data = np.random.default_rng(1).bytes(1 << 20)
        for start in (RuntimeError, threading.Thread.start):
            far = Far(Ranges(data), len(data), memory=1 << 18)
            with unittest.mock.patch.object(threading.Thread, "start", side_effect=start, autospec=True):
                far.prefetch([(1 << 18, 1000), (1 << 19, 1000)])
                self.assertEqual(far.read_range(1000, 1 << 19), data[1000:][:1 << 19])
                far.running, far.process = 16, -1
                self.assertEqual(far.read_range(1 << 19, 1 << 19), data[1 << 19:])

    def test_local_model_without_subtrees(self):
        self.addCleanup(setattr, automatic, "SMALL", automatic.SMALL)
        automatic.SMALL = 0
        for name in ("scan", "cube"):
            self.same(model(name).locate(P), model(name, memory="1G").locate(P))

    def test_ranges_that_fail_once(self):
        data, fail = bytes(1 << 20), [1]

        class Failing:
            def read_range(self, offset, size):
                if offset and fail:
                    raise KeyError(fail.pop())
                return data[offset:offset + size]

        far = Far(Failing(), len(data))
        far.prefetch([(1 << 18, 1000)])
        while fail:
            time.sleep(.01)
        self.assertEqual(far.read_range(1 << 18, 1000), bytes(1000), "no reader waited for the failed piece")
        fail.append(2)
        with self.assertRaises(KeyError):
            far.read_range(1 << 19, 1000)
        self.assertEqual(far.read_range(1 << 19, 1000), bytes(1000))

    def test_fsspec_files(self):
        """File objects of fsspec are read without their cache, which reads ahead; other remote ones by ranges."""
        try:
            from fsspec.spec import AbstractBufferedFile
        except ImportError:
            self.skipTest("fsspec is not installed")
        data, read = large(), []

        class Stored(AbstractBufferedFile):
            def _fetch_range(self, start, end):
                read.append(end - start)
                return data[start:end]

        class Unknown(io.RawIOBase):
            def __init__(self):
                self.file = io.BytesIO(data)
                self.seek = self.file.seek

            def read(self, size):
                read.append(size)
                return self.file.read(size)

        expected = ebpo.open(data).inside(P[0])
        for file, requests in ((Stored(None, "x", size=len(data)), 10), (Unknown(), 10)):
            read.clear()
            m = ebpo.open(file)
            self.assertEqual((m.inside(P[0]), m.stats["budget"]), (expected, 256 << 20))
            self.assertLess(len(read), requests)
            self.assertLess(sum(read), len(data) // 4)

    def test_local_files_are_held_in_parts(self):
        """One point loads only the subtrees that it needs; many load the whole model. Results are equal."""
        pathlib.Path("large.ebpo.h5").write_bytes(large())
        q, whole = points(20_000, 2), ebpo.open("large.ebpo.h5", memory="4G")
        m = ebpo.open("large.ebpo.h5")
        self.assertEqual(m.inside(P[0]), whole.inside(P[0]))
        self.assertEqual(m.stats["resident"], False, "one point")
        self.assertLess(m.stats["memory_peak"], whole.stats["memory"] / 2)
        self.same(m.distance(q)[:3], whole.distance(q)[:3])
        self.assertTrue(m.stats["resident"], "enough points to need the whole model")
        q = q[:2000]
        for query in (lambda m: m.ray(q, q + .1), lambda m: m.ray_all(q, q + .1), lambda m: m.locate(q),
                    lambda m: m.faces_in_box([0, 0, 0], [.2, .2, 1])):
            m = ebpo.open("large.ebpo.h5")
            for a, b in zip(np.atleast_2d(query(m)) if isinstance(query(m), np.ndarray) else query(m),
                            np.atleast_2d(query(whole)) if isinstance(query(whole), np.ndarray) else query(whole)):
                np.testing.assert_array_equal(a, b)
        m = ebpo.open("large.ebpo.h5")
        ebpo.Collider(m, m)
        self.assertTrue(m.stats["resident"], "an object that keeps the model loads it whole")

    def test_parts_are_freed_before_all_is_loaded(self):
        """The whole model and the subtrees that other threads query are never in memory together."""
        pathlib.Path("large.ebpo.h5").write_bytes(large())
        for hold, waits in ((lambda m: m._context(1, 1, "box"), True), (lambda m: m._context(), False)):
            m, alive = ebpo.open("large.ebpo.h5"), []
            m.inside(P[0])
            parts, make = [m._made, *m._contexts], m._new_model

            def new(options, make=make, parts=parts, alive=alive):
                alive.append([part._end.alive for part in parts])
                return make(options)

            m._new_model = new
            other = threading.Thread(target=ebpo.Collider, args=(m, m), daemon=True)
            with hold(m):
                other.start()
                other.join(.3 if waits else 30)
                self.assertEqual((other.is_alive(), alive), (waits, []))
            other.join(30)
            self.assertFalse(other.is_alive())
            self.assertEqual((alive, m.stats["resident"]), ([[False, False]], True) if waits else ([], False))
        m = ebpo.open("large.ebpo.h5")
        with m._context():  # as when a progress function queries the model that it reports on
            m.distance(points(20_000, 2))
            self.assertFalse(m.stats["resident"])
        m.distance(points(20_000, 2), threads=4)
        self.assertTrue(m.stats["resident"], "at a later query")


def large():
    """Return the bytes of a model of more than 2 MiB, which is made once."""
    if not MADE:
        subprocess.run([GENERATE, "--base", "sphere", "--faces", "300000", "large.ply"], check=True, capture_output=True)
        subprocess.run([COMMAND, "convert", "-q", "large.ply", "large.ebpo.h5"], check=True)
        MADE.append(pathlib.Path("large.ebpo.h5").read_bytes())
    return MADE[0]


MADE: list = []


if __name__ == "__main__":
    run()
