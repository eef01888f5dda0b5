#!/usr/bin/env python3
"""Tests models for asyncio: results, round trips, cancellation, errors, and a web server."""
import asyncio
import contextlib
import gc
import http.server
import pathlib
import re
import subprocess
import threading
import weakref
from unittest import mock

from package_support import GENERATE, Case, model, np, points, run

import ebpo

P = points(400)


class Remote:
    """Bytes with a coroutine `fetch`. Counts its calls, and requests that run at the same time."""

    def __init__(self, data):
        self.data, self.size = data, len(data)
        self.rounds = self.requests = self.bytes = 0
        self.changed = self.short = False

    async def one(self, offset, size):
        await asyncio.sleep(.001)
        self.requests, self.bytes = self.requests + 1, self.bytes + size
        data = self.data[offset:offset + size]
        return data[:-1] if self.short else bytes(len(data)) if self.changed else data

    async def fetch(self, ranges):
        self.rounds += 1
        return await asyncio.gather(*(self.one(*each) for each in ranges))


class Server(http.server.BaseHTTPRequestHandler):
    data, protocol_version = b"", "HTTP/1.1"

    def do_GET(self):
        first, last = map(int, re.match(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        part = Server.data[first:last + 1]
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{first + len(part) - 1}/{len(Server.data)}")
        self.send_header("ETag", '"1"')
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_):
        pass


@contextlib.contextmanager
def serving(data):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
    Server.data = data
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/m.ebpo.h5"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


class Async(Case):
    @classmethod
    def setUpClass(cls):
        subprocess.run([GENERATE, "--base", "sphere", "--faces", "40000", "remote.ply"], check=True,
                       capture_output=True)
        cls.near = model("remote")
        cls.data = pathlib.Path("remote.ebpo.h5").read_bytes()
        cls.expected = cls.near.inside(P), cls.near.distance(P), cls.near.ray(P, [0, 0, 1.])

    async def check(self, far):
        inside, distance, hits = self.expected
        np.testing.assert_array_equal(await far.inside(P), inside)
        self.assertEqual(bool(await far.inside(P[0])), bool(inside[0]))
        for found, expected in zip(await far.distance(P), distance):
            np.testing.assert_array_equal(found, expected)
        for found, expected in zip(await far.ray(P, [0, 0, 1.]), hits):
            np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal((await far.level(2)).vertices, self.near.level(2).vertices)
        self.assertEqual(await far.run(lambda m: len(m.faces_in_box([-9] * 3, [9] * 3))), far.info.face_count)

    def test_results(self):
        async def body():
            for options in ({}, {"cut_level": 2, "memory": "64M"}, {"cut_level": 2, "memory": "64M", "buffer": 0}):
                remote = Remote(self.data)
                async with await ebpo.open_async(remote, **options) as far:
                    await self.check(far)
                self.assertGreaterEqual(remote.requests, remote.rounds)
                self.assertLess(remote.rounds, 60)
        asyncio.run(body())

    def test_url(self):
        async def body(url):
            async with await ebpo.open_async(url, cut_level=2, memory="64M") as far:
                await self.check(far)
        with serving(self.data) as url:
            asyncio.run(body(url))

    def test_calls_at_the_same_time(self):
        async def body():
            async with await ebpo.open_async(Remote(self.data)) as far:
                results = await asyncio.gather(*(far.inside(P[i::4]) for i in range(4)))
                for i in range(4):
                    np.testing.assert_array_equal(results[i], self.expected[0][i::4])
        asyncio.run(body())

    def test_cancelled(self):
        class Slow(Remote):
            async def one(self, offset, size):
                if self.slow:
                    await asyncio.sleep(60)
                return await super().one(offset, size)

        async def body():
            remote = Slow(self.data)
            remote.slow = False
            async with await ebpo.open_async(remote) as far:
                remote.slow = True
                with self.assertRaises(asyncio.TimeoutError):
                    await asyncio.wait_for(far.distance(P), .05)
                remote.slow = False
                np.testing.assert_array_equal((await far.distance(P))[0], self.expected[1][0])
        asyncio.run(body())

    def test_cancelled_in_the_thread(self):
        """After a cancellation, the arrays that the running call writes to still exist."""
        arrays, exist, running, goes_on, ended = [], [], *(threading.Event() for _ in range(3))

        def zeros(*arguments):
            array = zeros_of_numpy(*arguments)
            arrays.append(weakref.ref(array))
            return array

        def call(name, *arguments):
            if name != "ebpo_inside_many":
                return call_of_library(name, *arguments)
            running.set()
            goes_on.wait(10)
            exist.extend(each() is not None for each in arrays)
            ended.set()
            return None

        async def body():
            async with await ebpo.open_async(Remote(self.data)) as far:
                with mock.patch.object(np, "zeros", zeros), mock.patch.object(ebpo.asynchronous, "call", call):
                    task = asyncio.create_task(far.inside(P))
                    await asyncio.to_thread(running.wait, 10)
                    task.cancel()
                    await asyncio.wait([task])
                    self.assertTrue(task.cancelled())
                    del task
                    gc.collect()
                    goes_on.set()
                    await asyncio.to_thread(ended.wait, 10)

        zeros_of_numpy, call_of_library = np.zeros, ebpo.asynchronous.call
        asyncio.run(body())
        self.assertTrue(exist and all(exist), exist)

    def test_errors(self):
        async def body():
            remote = Remote(self.data)
            remote.short = True
            with self.assertRaisesRegex(ebpo.IOFailure, "instead of"):
                await ebpo.open_async(remote)
            with self.assertRaises(ebpo.FormatError):
                await ebpo.open_async(Remote(bytes(4000)))
            with self.assertRaises(TypeError):
                await ebpo.open_async(remote, retries=3)
            async with await ebpo.open_async(Remote(self.data)) as far:
                with self.assertRaises(ebpo.ArgumentError):
                    await far.inside([[0, 0, float("nan")]])
                np.testing.assert_array_equal(await far.inside(P), self.expected[0])
        asyncio.run(body())


if __name__ == "__main__":
    run()
