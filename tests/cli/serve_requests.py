"""serve_requests.py FOLDER MODEL...: requests everything from `ebpo serve`, and attacks it.

FOLDER becomes the viewer's folder. Prints "OK: N requests" if each response has the expected status and content, if
no response contains a file that was not given, and if the server still runs and then ends by Ctrl-C with code 0.
"""
import json
import os
import random
import re
import select
import signal
import socket
import subprocess
import sys
import time
import urllib.parse

SECRET = b"a file that was not given"
LIMIT = 30 # seconds

folder, models = sys.argv[1], sys.argv[2:]
requests = 0
problems = []


def prepare():
    os.makedirs(folder, exist_ok=True)
    for name, text in (("index.html", "<p>the page</p>"), ("app.js", "let x = 1;"), ("notes.txt", "not of the viewer"),
                       (".hidden.js", "hidden")):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as f:
            f.write(text)
    for place in (".", folder, os.path.dirname(models[0]) or "."):
        with open(os.path.join(place, "secret.txt"), "wb") as f:
            f.write(SECRET)


def start():
    server = subprocess.Popen(["ebpo", "serve", "-q", "--port", "0", "--viewer", folder, *models],
                              stdout=subprocess.PIPE, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    address = server.stdout.readline().decode().strip()
    return server, int(re.fullmatch(r"http://127\.0\.0\.1:(\d+)/", address)[1])


def connect():
    return socket.create_connection(("127.0.0.1", port), timeout=LIMIT)


def receive(connection, head_only=False, before=b""):
    """Returns (status, fields, body, remaining bytes) of a response."""
    data = before
    while b"\r\n\r\n" not in data:
        more = connection.recv(65536)
        if not more:
            return None, {}, data, b""
        data += more
    head, _, body = data.partition(b"\r\n\r\n")
    lines = head.decode("latin-1").split("\r\n")
    fields = {k.lower(): v for k, v in (line.split(": ", 1) for line in lines[1:])}
    length = 0 if head_only or lines[0].split()[1] == "304" else int(fields["content-length"])
    while len(body) < length:
        more = connection.recv(65536)
        if not more:
            break
        body += more
    return int(lines[0].split()[1]), fields, body[:length], body[length:]


def send(data, head_only=False):
    global requests
    requests += 1
    with connect() as connection:
        try:
            connection.sendall(data)
            connection.shutdown(socket.SHUT_WR)
        except OSError:
            pass # the server has refused the rest
        return receive(connection, head_only)


def get(path, *fields, method="GET"):
    lines = [f"{method} {path} HTTP/1.1", "Host: localhost", *fields, "", ""]
    return send("\r\n".join(lines).encode("latin-1"), method == "HEAD")


def expect(what, found, wanted):
    if found != wanted:
        problems.append(f"{what}: {found!r}, not {wanted!r}")


def check_contents():
    expect("the page", get("/?x=1")[2], b"<p>the page</p>")
    expect("script", get("/app.js")[2], b"let x = 1;")
    expect("type", get("/app.js")[1]["content-type"], "text/javascript; charset=utf-8")
    status, fields, _, _ = get("/")
    expect("first page", status, 302)
    first = "samples=models/index.json" if len(entries) > 1 else "file=models/" + entries[0]["file"].replace("%", "%25")
    expect("first page", fields["location"], "/?" + first)
    for entry in entries:
        path = "/models/" + entry["file"]
        given = next(m for m in known if os.path.basename(m) == urllib.parse.unquote(os.path.basename(path)))
        with open(given, "rb") as f:
            expected = f.read()
        expect(path, get(path)[2] == expected, True)
        expect(path, entry["bytes"], len(expected))
        status, fields, body, _ = get(path, method="HEAD")
        expect(f"HEAD {path}", (status, fields["content-length"], body), (200, str(len(expected)), b""))
        check_ranges(path, expected, fields["etag"])
        if "picture" in entry:
            for _ in range(2):
                status, fields, body, _ = get("/models/" + entry["picture"])
                expect("picture", (status, fields["content-type"], body[:8]), (200, "image/png", b"\x89PNG\r\n\x1a\n"))


def check_ranges(path, data, tag):
    size = len(data)
    for text, first, end in (("0-0", 0, 1), ("5-9", 5, 10), ("-4", size - 4, size), ("10-", 10, size), (f"{size - 1}-", size - 1, size),
                             (f"0-{size}", 0, size), ("3-99999999999999999999999", 3, size), (f"-{2 * size}", 0, size)):
        status, fields, body, _ = get(path, f"Range: bytes={text}")
        found = (status, body == data[first:end], fields.get("content-range"))
        expect(f"range {text}", found, (206, True, f"bytes {first}-{end - 1}/{size}"))
    for text in (f"{size}-", "99999999999999999999-", "-0"):
        status, fields, _, _ = get(path, f"Range: bytes={text}")
        expect(f"range {text}", (status, fields["content-range"]), (416, f"bytes */{size}"))
    for text in ("bytes=9-5", "bytes=0-1,3-4", "bytes=", "bytes=-", "bytes=1", "bytes=a-b", "lines=1-2", "bytes=0-1x", "bytes=0x1-2"):
        status, _, body, _ = get(path, f"Range: {text}")
        expect(f"range {text}", (status, body == data), (200, True))
    expect("If-Range", get(path, "Range: bytes=0-0", f"If-Range: {tag}")[0], 206)
    expect("If-Range", get(path, "Range: bytes=0-0", 'If-Range: "other"')[0], 200)
    expect("If-None-Match", get(path, f'If-None-Match: "a", W/{tag}')[0], 304)
    expect("If-None-Match", get(path, 'If-None-Match: "other"')[0], 200)


def attack_paths():
    """Paths that lead to no content: yields (path, expected status)."""
    here, first = os.path.abspath("."), entries[0]["file"]
    for step in ("../", "..%2f", "%2e%2e/", "%2e%2e%2f", "%2E%2E%5C", "..\\", ".%2e/", "..;/", "%c0%ae%c0%ae/", "....//"):
        for depth in (1, 2, 5, 40):
            for start_at in ("/", "/models/", f"/models/{first}/", "/app.js/"):
                yield start_at + step * depth + "secret.txt", 404
                yield start_at + step * depth + "etc/passwd", 404
    for path in (here + "/secret.txt", "/" + here + "/secret.txt", f"/models/{first}/", f"/models//{first}"):
        yield path, 404
    for path in ("secret.txt /secret.txt ./secret.txt etc/passwd /etc/passwd notes.txt .hidden.js app.js/ /app.js ./app.js APP.JS "
                 "index.html models models/ models/0 models/0/ models/-1.png models/00.png models/99.png proc/self/environ dev/zero "
                 "late.js models/0/late.ebpo.h5 file:///etc/passwd %2561pp.js app.js%20 ~root").split():
        yield "/" + path, 404
    for path in ("/app.js%00", "/%00", "/app.js%0", "/app.js%", "/%zz", "/%-1", "/app.js#x"):
        yield path, 400
    yield "/" + "a" * 5000, 414
    yield "/" + "%61" * 5000, 414


# Requests of wrong form, and the expected status; None: any response or none.
FIRST_LINES = (
    (b"GET /app.js HTTP/2.0", 505), (b"GET /app.js HTTP/1.2", 505), (b"GET /app.js", 400), (b"GET  /app.js HTTP/1.1", 400),
    (b"GET /app.js HTTP/1.1 ", 400), (b" GET /app.js HTTP/1.1", 400), (b"GET", 400), (b"", 400), (b"GET app.js HTTP/1.1", 400),
    (b"GET http://localhost/app.js HTTP/1.1", 400), (b"GET file:///etc/passwd HTTP/1.1", 400), (b"GET * HTTP/1.1", 400),
    (b"G\x00T /app.js HTTP/1.1", 400), (b"GET /a\x00pp.js HTTP/1.1", 400), (b"GET /a\tb HTTP/1.1", 400), (b"\xff\xfe\xfd", 400),
    (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", None), *((m + b" /app.js HTTP/1.1", 405) for m in (
        b"POST", b"PUT", b"DELETE", b"OPTIONS", b"CONNECT", b"TRACE", b"get", b"PROPFIND")))
FIELDS = (
    (b"", 200), (b"Host: localhost\r\n", 400), (b"No colon\r\n", 400), (b": x\r\n", 400), (b"A b: x\r\n", 400), (b" folded: x\r\n", 400),
    (b"Content-Length: 5\r\n", 400), (b"Content-Length: 0\r\nContent-Length: 0\r\n", 400), (b"Content-Length: 0\r\n", 200),
    (b"Content-Length: -1\r\n", 400), (b"Transfer-Encoding: chunked\r\n", 400), (b"X: a\x00b\r\n", 400), (b"X: a\nb: c\r\n", 400),
    (b"X: a\rb\r\n", 400), (b"Range: bytes=0-0\r\nRange: bytes=1-1\r\n", 400), (b"X: " + b"y" * 20000 + b"\r\n", 431),
    (b"X: y\r\n" * 4000, 431), (b"Range: bytes=" + b"0" * 1000 + b"-1\r\n", 200), (b"If-Range: " + b"x" * 1000 + b"\r\n", 200))
HOSTS = (
    (b"127.0.0.1:1", 200), (b"[::1]:65535", 200), (b"LOCALHOST:80", 200), (b"example.org", 421), (b"localhost.example.org", 421),
    (b"localhost:x", 421), (b"localhost:123456", 421), (b"127.0.0.1.example.org", 421), (b"", 421), (b"user@localhost", 421))
WHOLE = (
    (b"GET /app.js HTTP/1.1\r\n\r\n", 400), (b"GET /app.js HTTP/1.1\nHost: localhost\n\n", None), (b"", None), (b"\r\n" * 10000, 400),
    (b"A" * 100000, 431))


def attack_heads():
    for line, status in FIRST_LINES:
        yield line + b"\r\nHost: localhost\r\n\r\n", status
    for fields, status in FIELDS:
        yield b"GET /app.js HTTP/1.1\r\nHost: localhost\r\n" + fields + b"\r\n", status
    for host, status in HOSTS:
        yield b"GET /app.js HTTP/1.1\r\nHost: " + host + b"\r\n\r\n", status
    yield from WHOLE


def attack():
    for path, status in attack_paths():
        found, _, body, _ = get(path)
        expect(path[:80], found, status)
        if SECRET in body or b"root:" in body:
            problems.append(f"{path[:80]}: the response has a file that was not given")
    for data, status in attack_heads():
        found, _, body, _ = send(data)
        if status is not None:
            expect(data[:60], found, status)
        if SECRET in body:
            problems.append(f"{data[:60]}: the response has a file that was not given")
    dice = random.Random(1)
    seed = b"GET /models/" + entries[0]["file"].encode() + b" HTTP/1.1\r\nHost: localhost\r\nRange: bytes=0-9\r\nIf-Range: \"x\"\r\n\r\n"
    for _ in range(300):
        data = bytearray(seed)
        for _ in range(dice.randrange(1, 8)):
            at = dice.randrange(len(data))
            if dice.random() < 0.5:
                data[at] = dice.randrange(256)
            else:
                del data[at:at + dice.randrange(4)]
        if SECRET in send(bytes(data))[2]:
            problems.append(f"{bytes(data)}: the response has a file that was not given")


def change_files():
    """Files that appear or change after the start."""
    os.symlink(os.path.abspath("secret.txt"), os.path.join(folder, "late.js"))
    path = "/models/" + entries[0]["file"]
    before = get(path)[2]
    given = next(m for m in known if os.path.basename(m) == urllib.parse.unquote(os.path.basename(path)))
    os.rename(given, given + ".moved")
    os.symlink(os.path.abspath("secret.txt"), given)
    expect("a file that became a link", get(path)[0], 410)
    os.remove(given)
    os.rename(given + ".moved", given)
    expect("a file that came back", get(path)[2] == before, True)
    times = os.stat(given)
    with open(given, "r+b") as f:
        f.write(before[:1])
    os.utime(given, ns=(times.st_atime_ns, times.st_mtime_ns + 1))
    expect("a file that was written to", get(path)[0], 410)
    os.utime(given, ns=(times.st_atime_ns, times.st_mtime_ns))
    expect("a file that is the same again", get(path)[0], 200)


def connections():
    path = "/models/" + entries[0]["file"]
    one = f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    with connect() as c: # two requests at once
        c.sendall(one + b"GET /app.js HTTP/1.1\r\nHost: localhost\r\n\r\n")
        first = receive(c)
        second = receive(c, before=first[3])
        expect("second of two requests", second[2], b"let x = 1;")
    with connect() as c: # byte after byte
        for byte in b"GET /app.js HTTP/1.0\r\nHost: localhost\r\n\r\n":
            c.sendall(bytes([byte]))
        expect("byte after byte", receive(c)[2], b"let x = 1;")
        expect("end", c.recv(1), b"")
    for _ in range(20): # clients that leave
        with connect() as c:
            c.sendall(one * 3)
            c.recv(10)
    silent = [connect() for _ in range(60)] # more than the server has threads for
    for c in silent:
        c.close()
    expect("after silent clients", get("/app.js")[0], 200)
    began, slow = time.monotonic(), [connect() for _ in range(32)] # refused clients that go on sending
    for c in slow:
        c.sendall(b"X\r\n\r\n")
    with connect() as c:
        c.sendall(b"GET /app.js HTTP/1.1\r\nHost: localhost\r\n\r\n")
        c.setblocking(False)
        while time.monotonic() - began < LIMIT:
            for other in slow:
                try:
                    other.send(b"y")
                except OSError:
                    pass # the server has closed this connection
            if select.select([c], [], [], 0.2)[0]:
                break
        c.settimeout(LIMIT)
        expect("beside refused clients", receive(c)[0], 200)
    expect("beside refused clients, soon", time.monotonic() - began < LIMIT / 2, True)
    for c in slow:
        c.close()
    expect("Connection", get("/app.js", "Connection: TE, close")[1]["connection"], "close")


prepare()
known = []
for given in models:
    if os.path.isdir(given):
        known += [os.path.join(at, name) for at, _, names in os.walk(given) for name in names if name.endswith(".h5")]
    else:
        known.append(given)
server, port = start()
entries = []
try:
    entries = json.loads(get("/models/index.json")[2])
    check_contents()
    change_files()
    attack()
    connections()
    expect("runs", server.poll(), None)
finally:
    idle = connect()
    server.send_signal(signal.SIGINT)
    expect("exit code", server.wait(timeout=LIMIT), 0)
print("\n".join(problems) or f"OK: {len(entries)} models, {requests} requests")
sys.exit(bool(problems))
