#!/usr/bin/env python3
"""A web server that misbehaves as its URLs request.

faulty_server.py FILE            serves FILE on 127.0.0.1, prints the port on a line, and ends when
                                 its standard input ends
http://127.0.0.1:PORT/FAULT/...  FAULT is one of the functions below without "fault_"; numbers after
                                 dashes are its arguments

The server counts requests separately for each URL, so each test uses a URL of its own. The text
after FAULT/ has no other effect.
"""
import collections
import email.utils
import gzip
import http.server
import os
import random
import re
import socket
import sys
import threading
import time

MODIFIED = email.utils.formatdate(1700000000, usegmt=True)
LATER = email.utils.formatdate(1700000100, usegmt=True)
NAP = 30  # seconds, longer than any test waits


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    data = b""
    counts = collections.Counter()
    other_port = 0
    lock = threading.Lock()

    def log_message(self, *arguments):
        pass

    # --- parts of responses ---

    def head(self, code, headers):
        self.send_response_only(code)
        for name, value in headers:
            self.send_header(name, str(value))
        self.end_headers()

    def version(self, etag='"v1"', modified=MODIFIED):
        return ([("ETag", etag)] if etag else []) + ([("Last-Modified", modified)] if modified
                                                     else [])

    def requested_range(self, data):
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if not found:
            return None
        begin, last = int(found[1]), min(int(found[2]), len(data) - 1)
        return (begin, last) if begin <= last else None

    def part(self, data=None, version=None, extra=(), shift=0, cut=0, code=206):
        """Send the requested range.

        shift: offset of the range in Content-Range.
        cut: bytes that are missing at the end.
        """
        data = self.data if data is None else data
        requested = self.requested_range(data)
        if requested is None:
            self.head(416, [("Content-Range", f"bytes */{len(data)}"), ("Content-Length", 0)])
            return
        begin, last = requested
        body = data[begin:last + 1]
        self.head(code, [("Content-Range", f"bytes {begin + shift}-{last + shift}/{len(data)}"),
                         ("Content-Length", len(body))]
                  + (self.version() if version is None else version) + list(extra))
        self.wfile.write(body[:len(body) - cut])
        if cut:
            self.drop()

    def whole(self, data=None, version=None):
        data = self.data if data is None else data
        self.head(200,
                  [("Content-Length", len(data))] + (self.version() if version is None
                                                     else version))
        self.wfile.write(data)

    def chunks(self, code, headers, body):
        self.head(code, headers + [("Transfer-Encoding", "chunked")] + self.version())
        for at in range(0, len(body), 5000):
            piece = body[at:at + 5000]
            self.wfile.write(b"%x\r\n%s\r\n" % (len(piece), piece))
        self.wfile.write(b"0\r\n\r\n")

    def drop(self):
        self.close_connection = True
        self.wfile.flush()
        try:
            self.connection.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass

    def fail(self, code, extra=()):
        text = b"<html>no</html>"
        self.head(code, [("Content-Length", len(text)),
                         ("Content-Type", "text/html")] + list(extra))
        self.wfile.write(text)

    def first(self, times, fault):
        """Send the fault for the first requests of this URL, then the range."""
        if self.number <= times:
            fault()
        else:
            self.part()

    def first_good(self, times, fault):
        """Send the range for the first requests of this URL, then the fault."""
        (self.part if self.number <= times else fault)()

    def redirect(self, target):
        self.head(302, [("Location", target), ("Content-Length", 0)])

    # --- faults ---

    def fault_good(self):
        self.part()

    def fault_modified(self):
        self.part(version=self.version(etag=None))

    def fault_bare(self):
        self.part(version=[])

    def fault_whole(self):
        self.whole()

    def fault_whole_bare(self):
        self.whole(version=[])

    def fault_whole_chunked(self):
        self.chunks(200, [], self.data)

    def fault_whole_open(self):
        """Use HTTP/1.0 without a length, so that the end of the body is unknown."""
        self.head(200, [("Connection", "close")])
        self.wfile.write(self.data[:len(self.data) // 2])
        self.drop()

    def fault_whole_dropped(self, times=1):
        def fault():
            self.head(200, [("Content-Length", len(self.data))] + self.version())
            self.wfile.write(self.data[:len(self.data) // 2])
            self.drop()
        if self.number <= times:
            fault()
        else:
            self.whole()

    def fault_small_parts(self):
        """Send at most 32 KiB at a time, with the correct Content-Range."""
        begin, last = self.requested_range(self.data)
        self.headers.replace_header("Range", f"bytes={begin}-{min(last, begin + 32767)}")
        self.part()

    def fault_whole_then_parts(self, times=1):
        """Send the whole file, but cut off, then ranges, like two different servers behind one URL."""
        def fault():
            self.head(200, [("Content-Length", len(self.data))] + self.version())
            self.wfile.write(self.data[:1000])
            self.drop()
        self.first(times, fault)

    def fault_bare_replaced(self):
        """Send no version, and replace the file while it is read."""
        if self.number <= 2:
            self.part(version=[], cut=0 if self.number == 1 else len(self.data) // 2)
        else:
            self.part(data=bytes(255 - b for b in self.data), version=[])

    def fault_whole_later(self, good=1):
        if self.number <= good:
            self.part()
        else:
            self.whole()

    def fault_html(self):
        body = b"<html><body>Please log in</body></html>"
        self.head(200, [("Content-Length", len(body)), ("Content-Type", "text/html")])
        self.wfile.write(body)

    def fault_html_bare(self):
        body = b"\r\n<!DOCTYPE html><html><body>Please log in</body></html>"
        self.head(200, [("Content-Length", len(body))])
        self.wfile.write(body)

    def fault_html_later(self):
        self.first_good(1, self.fault_html)

    def fault_model_as_text(self):
        self.part(data=b"\x89HDF\r\n\x1a\n" + self.data, extra=[("Content-Type", "text/plain")])

    def fault_short(self, times=1):
        self.first(times, lambda: self.part(cut=1000))

    def fault_empty(self, times=1):
        self.first(times, self.drop)

    def fault_lying_length(self, times=99):
        """Send a body that agrees with Content-Length but is shorter than the range."""
        def fault():
            begin, last = self.requested_range(self.data)
            body = self.data[begin:last + 1][:500]
            self.head(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}"),
                            ("Content-Length", len(body))] + self.version())
            self.wfile.write(body)
        self.first(times, fault)

    def fault_less(self):
        """Send a shorter range than requested, with the correct Content-Range; this is allowed."""
        begin, last = self.requested_range(self.data)
        last = min(last, begin + 70000)
        self.head(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}"),
                        ("Content-Length", last - begin + 1)] + self.version())
        self.wfile.write(self.data[begin:last + 1])

    def fault_wrong_range(self):
        self.part(shift=1 if self.requested_range(self.data)[1] + 1 < len(self.data) else -1)

    def fault_wrong_range_later(self, good=1):
        self.part(shift=0 if self.number <= good else -1)

    def fault_bad_range(self):
        body = self.data[:100]
        self.head(206, [("Content-Range", "bytes one-two/3"), ("Content-Length", len(body))])
        self.wfile.write(body)

    def fault_no_range(self):
        begin, last = self.requested_range(self.data)
        self.head(206, [("Content-Length", last + 1 - begin)])
        self.wfile.write(self.data[begin:last + 1])

    def fault_star(self):
        begin, last = self.requested_range(self.data)
        self.head(206, [("Content-Range", f"bytes {begin}-{last}/*"),
                        ("Content-Length", last + 1 - begin)])
        self.wfile.write(self.data[begin:last + 1])

    def fault_two_ranges(self):
        begin, last = self.requested_range(self.data)
        self.part(extra=[("Content-Range", f"bytes {begin}-{last}/{len(self.data) + 1}")])

    def fault_wide(self):
        begin = self.requested_range(self.data)[0]
        self.head(206, [("Content-Range", f"bytes {begin}-{len(self.data) - 1}/{len(self.data)}"),
                        ("Content-Length", len(self.data) - begin)])
        self.wfile.write(self.data[begin:])

    def fault_longer(self):
        begin, last = self.requested_range(self.data)
        self.chunks(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}")],
                    self.data[begin:last + 1] + b"more")

    def fault_multipart(self):
        body = b"--x\r\nContent-Range: bytes 0-9/100\r\n\r\n0123456789\r\n--x--\r\n"
        self.head(206, [("Content-Type", "multipart/byteranges; boundary=x"),
                        ("Content-Length", len(body))])
        self.wfile.write(body)

    def fault_gzip(self):
        begin, last = self.requested_range(self.data)
        body = gzip.compress(self.data[begin:last + 1])
        self.head(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}"),
                        ("Content-Encoding", "gzip"), ("Content-Length", len(body))]
                  + self.version())
        self.wfile.write(body)

    def fault_gzip_whole(self):
        body = gzip.compress(self.data)
        self.head(200, [("Content-Encoding", "gzip"), ("Content-Length", len(body))])
        self.wfile.write(body)

    def fault_stall_head(self, times=1):
        self.first(times, lambda: self.nap())

    def fault_stall_body(self, times=1):
        def fault():
            begin, last = self.requested_range(self.data)
            self.head(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}"),
                            ("Content-Length", last + 1 - begin)] + self.version())
            self.wfile.write(self.data[begin:begin + 1000])
            self.nap()
        self.first(times, fault)

    def fault_drip(self):
        """Send a few bytes at a time, without an end."""
        begin, last = self.requested_range(self.data)
        self.head(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}"),
                        ("Content-Length", last + 1 - begin)] + self.version())
        for at in range(begin, last + 1, 200):
            self.wfile.write(self.data[at:min(at + 200, last + 1)])
            self.wfile.flush()
            time.sleep(0.2)

    def nap(self):
        self.wfile.flush()
        end = time.monotonic() + NAP
        self.connection.settimeout(0.2)
        while time.monotonic() < end:
            try:
                if not self.connection.recv(1):
                    break
            except TimeoutError:
                pass
            except OSError:
                break
        self.close_connection = True

    def fault_code(self, code=503, times=10**6):
        self.first(times, lambda: self.fail(code))

    def fault_code_later(self, code=503, good=1, times=10**6):
        if good < self.number <= good + times:
            self.fail(code)
        else:
            self.part()

    def fault_wait(self, code=429, seconds=1, times=1):
        self.first(times, lambda: self.fail(code, [("Retry-After", seconds)]))

    def fault_redirect(self):
        self.redirect("/good/elsewhere")

    def fault_redirect_wrong(self):
        """Redirect to a URL that returns another range than requested."""
        self.redirect("/wrong_range/elsewhere")

    def fault_redirect_long(self, bytes):
        self.redirect("/good/" + "x" * bytes)

    def fault_redirect_loop(self):
        self.redirect(self.path)

    def fault_redirect_file(self):
        self.redirect("file:///etc/passwd")

    def here(self):
        return int(self.server.server_address[1])

    def fault_away(self, where=0):
        """Redirect by the value of `where`.

        0: to this server by another host name; 1: to another port; 2: to this server, which then redirects
        to another host name; 3: to another host name, which redirects back; 4, 5: to this server only, by
        an absolute and by a relative URL.
        """
        rest = "/".join(self.path.split("/")[2:])
        self.redirect([f"http://localhost:{self.here()}/other/{rest}",
                       f"http://127.0.0.1:{Handler.other_port}/other/{rest}",
                       f"/away-0/{rest}",
                       f"http://localhost:{self.here()}/back/{rest}",
                       f"http://127.0.0.1:{self.here()}/private/{rest}",
                       f"../private/{rest}"][where])

    def fault_back(self):
        rest = "/".join(self.path.split("/")[2:])
        self.redirect(f"http://127.0.0.1:{self.here()}/other/{rest}")

    def fault_other(self):
        """Fail when the request contains a secret."""
        if self.headers.get("X-Key") or self.headers.get("Authorization"):
            self.fail(403)
        else:
            self.part()

    def fault_weak_sometimes(self):
        self.part(version=self.version(etag='W/"v1"' if self.number % 2 else '"v1"'))

    def fault_etag_by_server(self):
        self.part(version=self.version(etag=f'"v{self.number % 2}"'))

    def fault_modified_by_server(self):
        self.part(version=self.version(etag=None, modified=LATER if self.number % 2 else MODIFIED))

    def fault_change_etag(self, good=1):
        if self.number <= good:
            self.part()
        else:
            self.part(data=self.data[::-1], version=self.version(etag='"v2"'))

    def fault_change_modified(self, good=1):
        if self.number <= good:
            self.part(version=self.version(etag=None))
        else:
            self.part(data=self.data[::-1], version=self.version(etag=None, modified=LATER))

    def fault_change_size(self, good=1):
        if self.number <= good:
            self.part()
        else:
            self.part(data=self.data[:-1])

    def fault_change_shorter(self, good=1):
        if self.number <= good:
            self.part()
        else:
            self.part(data=self.data[:1000])

    def fault_change_bare(self, good=1):
        """Send neither ETag nor Last-Modified: only the bytes show a change."""
        self.part(data=self.data if self.number <= good else self.data[::-1], version=[])

    def fault_change_between(self):
        """Send short responses; from the second on they are of another version."""
        if self.number == 1:
            self.part(cut=1000)
        else:
            self.part(data=self.data[::-1], version=self.version(etag='"v2"'))

    def fault_chunked(self):
        begin, last = self.requested_range(self.data)
        self.chunks(206, [("Content-Range", f"bytes {begin}-{last}/{len(self.data)}")],
                    self.data[begin:last + 1])

    def fault_headers(self, kilobytes=400):
        self.send_response_only(206)
        for i in range(kilobytes):
            self.send_header(f"X-{i}", "x" * 1000)
        self.end_headers()

    def fault_garbage(self):
        self.wfile.write(os.urandom(2000))
        self.drop()

    def fault_not_satisfiable(self):
        self.head(416, [("Content-Range", "bytes */0"), ("Content-Length", 0)])

    def fault_private(self):
        good = (self.headers.get("Authorization") == "Basic bmFtZTpzZWNyZXQ="
                and self.headers.get("X-Key") == "7")
        if good and self.headers.get("Accept-Encoding") == "identity":
            self.part()
        else:
            self.fail(401, [("WWW-Authenticate", 'Basic realm="x"')])

    def fault_random(self, seed=0, percent=30):
        dice = random.Random(f"{seed} {self.number}")
        if dice.random() * 100 >= percent:
            self.part()
            return
        passing = [lambda: self.part(cut=dice.randrange(1, 400)), self.drop, lambda: self.fail(503),
                   lambda: self.fail(500),
                   self.fault_less, self.fault_chunked, lambda: self.fault_lying_length(10**6),
                   lambda: self.redirect("/good/r")]
        final = [self.fault_gzip, self.fault_longer, self.fault_wrong_range, self.fault_no_range,
                 self.fault_whole, lambda: self.fail(404),
                 lambda: self.part(data=self.data[::-1], version=self.version(etag='"v2"'))]
        dice.choice(final if dice.random() < 0.03 else passing)()

    # --- several ranges in one request ---

    def several(self, ranges, data=None, version=None, **changed):
        """Send several ranges, with one of the faults that fault_several names."""
        data = self.data if data is None else data
        mark, total = b"mark", changed.get("total", len(data))
        body = b"preamble\r\n" if "preamble" in changed else b""
        for begin, last in ranges:
            shift = changed.get("shift", 0)
            body += b"\r\n--%s\r\nContent-Type: application/x-hdf5\r\n" % mark
            body += b"X-Long: " + b"x" * changed.get("long", 0) + b"\r\n"
            body += b"X: y\r\n" * changed.get("lines", 0)
            body += b"Content-Range: bytes %d-%d/%d\r\n\r\n" % (begin + shift, last + shift, total)
            body += data[begin:last + 1 + changed.get("more", 0)]
        body += b"\r\n--%s--\r\n" % mark
        kind = changed.get("kind", 'multipart/byteranges; boundary="mark"')
        self.head(206, [("Content-Type", kind), ("Content-Length", len(body)), ("Server", "nginx")]
                  + (self.version() if version is None else version) + changed.get("extra", []))
        cut = changed.get("cut", 0)
        self.wfile.write(body[:len(body) - cut])
        if cut:
            self.drop()

    def fault_several(self, what=0):
        """Send several ranges as a server that names itself nginx. `what` is the fault; 0 to 2 are valid."""
        ranges = [tuple(map(int, each.split("-"))) for each in self.headers["Range"][6:].split(",")]
        if len(ranges) == 1:
            new = {"data": self.data[::-1], "version": self.version(etag='"v2"')} if what == 22 and self.number > 1 else {}
            return self.part(extra=[("Server", "nginx")], **new)
        found = [lambda: self.several(ranges),
                 lambda: self.several(ranges, kind="Multipart/Byteranges; boundary=mark"),
                 lambda: self.several(ranges[::-1]),
                 lambda: self.several(ranges, cut=150) if self.number == 3 else self.several(ranges),
                 self.whole,
                 lambda: self.several(ranges, kind="multipart/byteranges"),
                 lambda: self.several(ranges, kind="multipart/byteranges; boundary=" + "m" * 99),
                 lambda: self.several(ranges, kind="multipart/byteranges; boundary=other"),
                 lambda: self.several(ranges[:1]),
                 lambda: self.several(ranges[:1] * len(ranges)),
                 lambda: self.several([(0, 9)] + ranges),
                 lambda: self.several(ranges, shift=1),
                 lambda: self.several(ranges, total=len(self.data) - 1),
                 lambda: self.several(ranges, more=5),
                 lambda: self.several(ranges, long=5000),
                 lambda: self.several(ranges, lines=20000),
                 lambda: self.several(ranges, preamble=True),
                 lambda: self.several(ranges, extra=[("Content-Encoding", "br")]),
                 lambda: self.several([(begin, last + 1) for begin, last in ranges]),
                 lambda: self.several([(ranges[0][0], ranges[-1][1])]),
                 lambda: self.fail(416),
                 lambda: self.several(ranges, version=self.version(etag='"v2"')),
                 lambda: self.several(ranges, data=self.data[::-1], version=self.version(etag='"v2"')),
                 lambda: self.fail(503) if self.number == 3 else self.several(ranges),
                 self.drop]
        found[what]()

    # --- ---

    def do_GET(self):
        name, *arguments = self.path.split("/")[1].split("-")
        with self.lock:
            self.counts[self.path] += 1
            self.number = self.counts[self.path]
        try:
            getattr(self, "fault_" + name)(*map(int, arguments))
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 64

    def handle_error(self, request, client_address):
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


def main():
    with open(sys.argv[1], "rb") as f:
        Handler.data = f.read()
    server = Server(("127.0.0.1", 0), Handler)
    other = Server(("127.0.0.1", 0), Handler)
    Handler.other_port = other.server_address[1]
    for each in (server, other):
        threading.Thread(target=each.serve_forever, daemon=True).start()
    print(server.server_address[1], flush=True)
    sys.stdin.read()
    os._exit(0)


main()
