"""A web server that serves ranges of one file: serve(data) returns its URL."""
import http.server
import re
import threading


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def log_message(self, *arguments):
        pass

    def do_GET(self):
        data = self.server.data
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        begin, end = (int(found[1]), min(int(found[2]) + 1, len(data))) if found else (0, len(data))
        self.send_response_only(206 if found else 200)
        self.send_header("ETag", self.server.etag)
        self.send_header("Content-Length", str(end - begin))
        if found:
            self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{len(data)}")
        try:
            self.end_headers()
            self.wfile.write(data[begin:end])
        except ConnectionError: # the client was killed
            pass


def start(data):
    """Return a running server. Its members `data` and `etag` may be changed."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    server.data, server.etag = data, '"1"'
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def url_of(server):
    return f"http://127.0.0.1:{server.server_address[1]}/model.ebpo.h5"


def serve(data):
    return url_of(start(data))
