#!/usr/bin/env python3
"""Files from everywhere: paths, bytes, file objects, objects with ranges, fsspec, a web server."""
import http.server
import io
import mmap
import pathlib
import re
import threading
import time

from package_kit import Case, model, np, points, run

import ebpo
from ebpo import sources

P = points(500)


class Ranges:
    def __init__(self, data):
        self.data, self.size, self.asked = data, len(data), 0

    def read_range(self, offset, size):
        self.asked += size
        return self.data[offset:offset + size]


class Server(http.server.BaseHTTPRequestHandler):
    """Ranges of one file; what `fail` holds comes before."""
    data, etag, fail, protocol_version = b"", '"1"', [], "HTTP/1.1"
    keys: list = []  # of requests for the file: the header X-Key
    silent = False  # about ranges
    later = ""  # Retry-After
    cut = 0  # answers that end before their time

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
        first, last = map(int, re.match(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        part = Server.data[first:last + 1]
        self.send_response(206)
        if not Server.silent:
            self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{len(Server.data)}")
        self.send_header("Content-Length", str(len(part)))
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
        self.assertGreater(ranges.asked, 0)

    def test_sources_that_fail(self):
        class Failing(Ranges):
            def read_range(self, offset, size):
                if self.asked > 70_000:
                    raise KeyError("no such part")
                return super().read_range(offset, size)

        with self.assertRaisesRegex(ebpo.IOFailure, "KeyError.*no such part") as caught:
            ebpo.open(Failing(self.data)).mesh()
        self.assertIsInstance(caught.exception, OSError)

        class Short(Ranges):
            def read_range(self, offset, size):
                return super().read_range(offset, size)[:-1]

        with self.assertRaisesRegex(ebpo.IOFailure, "came instead of"):
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

    def test_damage_is_told(self):
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

    def serve(self):
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        Server.data = self.data
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
        url = f"{self.serve()}/scan.ebpo.h5?key=secret"
        self.same(ebpo.open(url, headers={"X-Key": "1"}, retries=2).distance(P), self.expected)

        # where the library has no HTTP, Python's is taken
        Server.fail = [503, 500]
        web = sources.Web(url)
        self.assertEqual((web.size, web.read_range(100, web.size - 200)), (len(self.data), self.data[100:-100]))
        file = sources.by_ranges(web, "scan")
        self.assertTrue(file.pointer)
        Server.etag = 'W/"1"'  # the same, as a proxy hands it on
        web.blocks.clear()
        self.assertEqual(web.read_range(len(self.data) - 10, 10), self.data[-10:])
        Server.etag = '"2"'
        web.blocks.clear()
        with self.assertRaisesRegex(OSError, "changed"):
            web.read_range(len(self.data) - 10, 10)
        Server.etag, Server.fail = '"1"', [404]
        with self.assertRaisesRegex(OSError, "404"):
            sources.Web(url)

    def test_patience(self):
        """Servers that are away for a while are waited for, as long as they say and as is allowed."""
        url = f"{self.serve()}/scan.ebpo.h5?key=secret"
        self.addCleanup(setattr, Server, "later", "")
        self.addCleanup(Server.fail.clear)
        waited = []
        real, sources.Patience.FIRST = sources.Patience.FIRST, 0.001
        self.addCleanup(setattr, sources.Patience, "FIRST", real)
        Server.fail[:] = [503] * 7
        self.assertEqual(sources.Web(url).size, len(self.data))
        Server.cut = 2
        self.assertEqual(sources.Web(url).size, len(self.data), "short bodies are asked for again")
        Server.fail[:] = [503] * 5
        with self.assertRaisesRegex(OSError, "no answer after 4 requests.*503.* 3 retries") as caught:
            sources.Web(url, retries=3)
        self.assertNotIn("secret", str(caught.exception))
        Server.fail[:] = [503] * 1000
        with self.assertRaisesRegex(OSError, "status 503; 0.3 s"):
            sources.Web(url, time_limit=.3)
        Server.fail[:], Server.later = [429], "3600"
        with self.assertRaisesRegex(OSError, "after 1 requests.*status 429"):
            sources.Web(url)
        Server.fail[:], Server.later = [503], "1"
        begin = time.monotonic()
        sources.Web(url)
        self.assertGreaterEqual(time.monotonic() - begin, 1)
        for _ in range(20):  # doubling, and never together
            patience = sources.Patience(1e9, None, "it")
            patience.FIRST, patience.failures = 0.001, 3
            begin = time.monotonic()
            patience.wait(TimeoutError())
            waited.append(time.monotonic() - begin)
        self.assertTrue(.004 <= min(waited) < max(waited))
        with self.assertRaisesRegex(OSError, "refused"):
            sources.Web("http://127.0.0.1:1/", time_limit=.01)


if __name__ == "__main__":
    run()
