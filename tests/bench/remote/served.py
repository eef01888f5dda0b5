"""nginx with its log, and a slow line that records when requests were sent and responses were complete."""
import asyncio
import contextlib
import os
import shutil
import socket
import subprocess
import threading
import time

BUSY = 0.02  # seconds within which a busy client uses a connection again


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def wait_for(port):
    for _ in range(100):
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise RuntimeError(f"no server on port {port}")


class Server:
    """nginx on a folder of links. Lines of its log are (status, bytes of the body, method, uri)."""
    def __init__(self, work, rules, links):
        self.port, self.log = free_port(), work / "access.log"
        shutil.rmtree(work / "www", ignore_errors=True)
        (work / "tmp").mkdir(parents=True, exist_ok=True)
        self.log.write_text("")
        for name, target in links.items():
            (work / "www" / name).parent.mkdir(parents=True, exist_ok=True)
            (work / "www" / name).symlink_to(target.resolve())
        temporary = " ".join(f"{kind}_temp_path {work}/tmp/{kind};"
                             for kind in ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"])
        (work / "nginx.conf").write_text(f"""{"user root;" if os.getuid() == 0 else ""}
worker_processes 1; daemon off; pid {work}/pid; error_log {work}/error.log;
events {{ worker_connections 4096; }}
http {{
    log_format short '$status $body_bytes_sent $request_method $uri'; access_log {self.log} short;
    {temporary}
    types {{ text/html html; text/javascript js mjs; application/wasm wasm; }}
    server {{ listen 127.0.0.1:{self.port}; root {work}/www; include {rules}; }}
}}
""")
        self.process = subprocess.Popen(["nginx", "-e", str(work / "error.log"), "-p", str(work),
                                         "-c", str(work / "nginx.conf")])
        wait_for(self.port)

    def traffic(self, name):
        """Return requests and bytes for a file since the last call."""
        time.sleep(0.3)  # nginx writes a line after the response is sent
        lines = [line.split(" ", 3) for line in self.log.read_text().splitlines()]
        self.log.write_text("")
        lines = [line for line in lines if line[3].endswith(name)]
        return len(lines), sum(int(line[1]) for line in lines)

    def close(self):
        self.process.terminate()
        self.process.wait()


class Line:
    """Forwards a port to another port, with a latency.

    Each round trip takes `seconds` longer, and each new connection one more round trip (the handshake). All responses
    together have a rate of `rate` bytes per second.
    """
    def __init__(self, to, seconds, rate=None):
        self.to, self.half, self.rate, self.port = to, seconds / 2, rate, free_port()
        self.free_at = 0   # time when the line has transferred all bytes that it has accepted
        self.requests = []  # [sent, response complete, connection] at the client's times
        self.loop = asyncio.new_event_loop()
        ready = threading.Event()
        threading.Thread(target=self.run, args=(ready,), daemon=True).start()
        ready.wait()

    def run(self, ready):
        asyncio.set_event_loop(self.loop)
        self.loop.run_until_complete(asyncio.start_server(self.connection, "127.0.0.1", self.port,
                                                          limit=1 << 20))
        ready.set()
        self.loop.run_forever()

    async def connection(self, reader, writer):
        """Accept a connection. The client connects for a request, and sends it after the handshake."""
        call = [self.loop.time(), None, writer]
        self.requests.append(call)

        def sent():
            nonlocal call
            if call[1]:
                call = [self.loop.time(), None, writer]
                self.requests.append(call)

        def arrived():
            call[1] = self.loop.time()
        await asyncio.sleep(2 * self.half)
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.to, limit=1 << 20)
        await asyncio.gather(self.forward(reader, far_writer, None, sent, lambda: None),
                             self.forward(far_reader, writer, self.rate, lambda: None, arrived),
                             return_exceptions=True)

    async def carried(self, size, rate):
        """Wait until the line has transferred `size` bytes, after the bytes of other connections."""
        if rate:
            self.free_at = max(self.free_at, self.loop.time()) + size / rate
            await asyncio.sleep(self.free_at - self.loop.time())

    async def forward(self, reader, writer, rate, taken, given):
        """Forward bytes. Bytes that are transferred at t arrive at t + half the latency, whatever follows."""
        queue = asyncio.Queue()

        async def take():
            with contextlib.suppress(ConnectionError):  # a client may close the connection at any time
                while data := await reader.read(1 << (12 if rate else 16)):
                    taken()
                    await self.carried(len(data), rate)
                    queue.put_nowait((self.loop.time() + self.half, data))
            queue.put_nowait((0, b""))

        async def give():
            while True:
                due, data = await queue.get()
                if not data:
                    writer.close()
                    return
                await asyncio.sleep(max(0, due - self.loop.time()))
                writer.write(data)
                await writer.drain()
                given()
        await asyncio.gather(take(), give())

    def least_round_trips(self, connections):
        """Return the round trips since the last call: batches of requests that depend on each other.

        A request begins a new batch if it was sent after a response of the batch was complete. The exception is a request that
        only waited for a connection: all `connections` were busy until then, and some still are.
        """
        calls, self.requests = sorted((c for c in self.requests if c[1]), key=lambda c: c[:2]), []
        count, first_response = 0, 0
        for i, (sent, responded, _) in enumerate(calls):
            busy = len({id(call[2]) for call in calls[:i] if call[1] > sent - BUSY})
            waited = busy >= connections and any(call[1] > sent for call in calls[:i])
            if i == 0 or (sent > first_response and not waited):
                count, first_response = count + 1, responded
            first_response = min(first_response, responded)
        return count
