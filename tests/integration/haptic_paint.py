"""Tests painting by a haptic device while it moves: haptic_paint.py EBPO [FAULTS].

The device is this script, which sends UDP packets, or a recorded path. The model is a cube; the pen moves on its top.
"""
import fcntl
import json
import math
import os
import re
import resource
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

sys.dont_write_bytecode = True
from haptic_udp import CUBE, PLACE

RADIUS, STIFFNESS = 0.02, 400


def check(condition, *what):
    if not condition:
        raise SystemExit(f"line {sys._getframe(1).f_lineno} failed: " + " ".join(str(w) for w in what))


class Test:
    def __init__(self, ebpo, folder):
        self.ebpo, self.folder = ebpo, folder
        with open(self.at("cube.ply"), "w", encoding="ascii") as out:
            out.write(CUBE)
        self.model = self.at("cube.ebpo.h5")
        self.run("convert", "-q", self.at("cube.ply"), self.model)

    def at(self, name):
        return os.path.join(self.folder, name)

    def run(self, *words):
        return subprocess.run([self.ebpo, *words], check=True, stdout=subprocess.PIPE, text=True).stdout

    def strokes(self, paint):
        return json.loads(self.run("paint", "--json", "--points", paint, self.model))["strokes"]

    def point_count(self, paint):
        return sum(len(s["points"]) for s in self.strokes(paint))

    def start(self, paint, *more, **how):
        return subprocess.Popen([self.ebpo, "haptic", "--json", "--paint", paint, "--pen-radius", str(RADIUS), *more,
                                 self.model], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **how)


class Device:
    """A device that sends its position. time: when it was sent, by position number."""

    def __init__(self, process):
        line = process.stderr.readline()
        found = re.search(r"port (\d+)$", line.strip())
        check(found, "no port:", line)
        self.to, self.sent = ("127.0.0.1", int(found[1])), 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, at, kind=1, more=b""):
        self.sent += 1
        self.socket.sendto(PLACE.pack(b"EBPT", 1, kind, self.sent, 0, *at, 0, 0, 0, 1) + more, self.to)

    def begin(self, at):
        """Sends a position until the loop replies, so that later positions find a running loop."""
        self.socket.settimeout(0.05)
        for _ in range(1200):
            self.send(at)
            try:
                self.socket.recv(1024)
                return
            except TimeoutError:
                pass
        check(False, "the loop did not reply")

    def draw(self, process, seconds, step=None, kind=1):
        """Presses on the top of the cube and moves along x for some time, or until step(time) is true. Returns [(time, x)]."""
        self.begin((0.1, 0.5, 1.2))
        begin, sent, down = time.monotonic(), [], None
        while (now := time.monotonic() - begin) < seconds and process.poll() is None:
            z = max(1.2 - now, 1 - RADIUS / 2)
            if z < 1 and down is None:
                down = now
            x = 0.1 + (now - down) * 0.1 if down is not None else 0.1
            self.send((x, 0.5, z), kind)
            sent.append((time.monotonic(), x))
            if step and step(now):
                break
            time.sleep(0.002)
        return sent


def line(name, points):
    with open(name, "w", encoding="ascii") as out:
        out.writelines(f"{x!r} {y!r} {z!r}\n" for x, y, z in points)


def test_replay(t):
    """A replayed recording paints the same points each time, and the force sets their sizes."""
    path, count = t.at("path"), 1000
    line(path, [(0.2 + 0.6 * i / count, 0.5, 1.05 - 0.06 * min(1, i / 200) - 0.02 * i / count) for i in range(count)] +
         [(0.8, 0.5, 1.03)] * 100 + [(0.8 - 0.3 * i / count, 0.7, 0.985) for i in range(300)])
    made = []
    for name in ("a.paint.h5", "b.paint.h5"):
        p = t.start(t.at(name), "--path", path, "--colour", "00ff0080", "--rate", "2000", "--record", t.at(name + ".path"))
        out, err = p.communicate(timeout=60)
        got = json.loads(out)["paint"]
        check(p.returncode == 0 and err == "" and got["lost_steps"] == 0, p.returncode, err, got)
        made.append(t.strokes(t.at(name)))
        check(got["strokes"] == len(made[-1]) == 2 and got["points"] == sum(len(s["points"]) for s in made[-1]), got)
        path = t.at(name + ".path")
    check(made[0] == made[1], "two replays differ")
    first, second = made[0]
    check(first["colour"] == "#00ff0080", first["colour"])
    for at, size, pressure in ((p["place"], p["size"] / 2 ** 15, p["pressure"] / 65535) for p in first["points"]):
        check(at[2] == 1 and abs(at[1] - 0.5) < 1e-9 and 0.2 < at[0] < 0.81, at)
        check(abs(size - (0.25 + 0.75 * pressure)) < 1e-3, size, pressure)
    sizes = [p["size"] / 2 ** 15 for p in first["points"]]
    check(sizes == sorted(sizes) and sizes[0] < 0.7 < 0.99 < sizes[-1], "the width does not follow the force", sizes)
    steps = [b["place"][0] - a["place"][0] for a, b in zip(first["points"], first["points"][1:])]
    check(max(steps) < RADIUS / 2 * 1.01, "gaps between points", max(steps))
    # The pen moves sideways in the air in the second stroke: nothing is painted between the strokes.
    check(all(abs(p["place"][1] - 0.7) < 1e-9 for p in second["points"]), "paint between two contacts")


def boxes(t, name, *corners):
    """Makes a model of boxes, each of two corners. Returns its name."""
    header, rows = CUBE.split("end_header\n")
    rows, count, model = rows.splitlines(), len(corners), t.at(name + ".ebpo.h5")
    with open(t.at(name + ".ply"), "w", encoding="ascii") as out:
        out.write(header.replace("vertex 8", f"vertex {8 * count}").replace("face 12", f"face {12 * count}") + "end_header\n")
        out.writelines(" ".join(str(ends[int(one)][k]) for k, one in enumerate(row.split())) + "\n" for ends in corners for row in rows[:8])
        out.writelines(f"3 {' '.join(str(int(i) + 8 * n) for i in f.split()[1:])}\n" for n in range(count) for f in rows[8:])
    t.run("convert", "-q", t.at(name + ".ply"), model)
    return model


def test_gap(t):
    """A pen that crosses a gap in less than the time of a lift paints on both sides, and not through the air."""
    path, paint = t.at("gap"), t.at("gap.paint.h5")
    model = boxes(t, "two", ((0, 0, 0), (1, 1, 1)), ((1.3, 0, 0), (2.3, 1, 1)))
    line(path, [(1.1 - 0.11 * min(1, i / 100), 0.2, 0.5) for i in range(150)] +
         [(0.99 + 0.32 * i / 20, 0.2 + 0.6 * i / 20, 0.5) for i in range(20)] + [(1.31, 0.8, 0.5)] * 150)
    t.run("haptic", "--path", path, "--paint", paint, "--pen-radius", str(RADIUS), model)
    strokes = json.loads(t.run("paint", "--json", "--points", paint, model))["strokes"]
    places = [q["place"] for s in strokes for q in s["points"]]
    check({round(p[0], 6) for p in places} == {1, 1.3}, places)
    check(all(p[1] < 0.3 or p[1] > 0.7 for p in places), "paint along the way through the air", places)


def test_erase(t):
    """Painting continues an existing file; an eraser adds an erasing stroke to the layer."""
    paint = t.at("a.paint.h5")
    p = t.start(paint, "--path", t.at("path"), "--erase", "--layer", "0", "--rate", "2000")
    out, err = p.communicate(timeout=60)
    check(p.returncode == 0, err)
    kinds = [s["kind"] for s in t.strokes(paint)]
    check(kinds == ["paints"] * 2 + ["erases"] * 2, kinds)


def test_kill(t, faults):
    """After a kill, the file contains everything that was touched up to a second before, also if the disk is slow."""
    paint = t.at("killed.paint.h5")
    environment = {**os.environ, "LD_PRELOAD": faults, "EBPO_TEST_SLOW_DISK": "1"} if faults else None
    p = t.start(paint, "--device", "udp:0", "--seconds", "40", env=environment)
    sent = Device(p).draw(p, 2.1)
    p.kill()
    killed = time.monotonic()
    p.wait()
    reached = max((q["place"][0] for s in t.strokes(paint) for q in s["points"]), default=0)
    wanted = max(x for when, x in sent if when < killed - 1)
    check(reached >= wanted - RADIUS and wanted > 0.1, f"painted to {reached}, the pen was at {wanted}")


def test_second_writer(t):
    """Other programs can read the file, but not paint in it; the first one continues. SIGINT ends with all saved."""
    paint = t.at("one.paint.h5")
    p = t.start(paint, "--device", "udp:0", "--seconds", "40")
    device, second = Device(p), []

    def begin_second(now):
        if now > 0.25 and not second:
            second.append(t.start(paint, "--seconds", "1"))
            with open(paint, "rb") as reader:
                fcntl.flock(reader, fcntl.LOCK_SH | fcntl.LOCK_NB)  # as the HDF5 library does
        return second and second[0].poll() is not None

    sent = device.draw(p, 9, begin_second)
    p.send_signal(signal.SIGINT)
    out, err = p.communicate(timeout=60)
    check(p.returncode == 0 and err == "", p.returncode, err)
    refused, said = second[0].communicate(timeout=60)
    check(second[0].returncode == 1 and "another program has been changing the file" in said and refused == "", said)
    points = t.strokes(paint)[-1]["points"]
    check(json.loads(out)["paint"]["points"] == len(points), "points in the report and in the file differ")
    check(max(q["place"][0] for q in points) >= sent[-1][1] - RADIUS, "the last points are missing")


def replay(t, paint, path, *more):
    """A replay of a recording paints the strokes that the device has painted. Only their dates are missing."""
    made = paint + ".replay.paint.h5"
    p = t.start(made, "--path", path, *more)
    out, err = p.communicate(timeout=60)
    check(p.returncode == 0 and err == "", p.returncode, err)
    wanted, got = ([{**s, "time": 0} for s in t.strokes(name)] for name in (paint, made))
    check(got == wanted, "the replay of", path, "differs:", wanted, got)


def test_lifted_pen(t):
    """A device whose pen is lifted touches, and does not paint."""
    paint = t.at("lifted.paint.h5")
    p = t.start(paint, "--device", "udp:0", "--seconds", "40", "--record", t.at("lifted.path"))
    device = Device(p)
    device.draw(p, 0.5, kind=4)
    device.send((0, 0, 0), kind=3)
    out, err = p.communicate(timeout=60)
    check(p.returncode == 0 and json.loads(out)["contacts"] > 100 and t.strokes(paint) == [], err, out)
    replay(t, paint, t.at("lifted.path"))


def test_stylus(t):
    """The pressure of a stylus sets the size and the opacity of points. Without pressure, nothing is painted."""
    paint = t.at("stylus.paint.h5")
    more = ("--colour", "0000ffff", "--fade", "0.5")
    p = t.start(paint, "--device", "udp:0", "--seconds", "40", "--record", t.at("stylus.path"), *more)
    device = Device(p)
    device.begin((0.1, 0.5, 1.2))
    for i in range(60):
        device.send((0.1 + 0.01 * i, 0.5, max(0.99, 1.2 - 0.05 * i)), 1, struct.pack("<d", (0.25, 0.5, 0)[i // 20]))
        time.sleep(0.01)
    device.send((0, 0, 0), kind=3)
    out, err = p.communicate(timeout=60)
    check(p.returncode == 0, err)
    strokes = [(s["colour"], {q["pressure"] for q in s["points"]}, max(q["place"][0] for q in s["points"])) for s in t.strokes(paint)]
    check([s[0] for s in strokes] == ["#0000ff9f", "#0000ffbf"], strokes)  # 10 and 12 sixteenths
    check(strokes[0][1] == {16384} and min(strokes[1][1]) >= 16384 and max(strokes[1][1]) == 32768, strokes)
    check(strokes[1][2] < 0.52, "paint without pressure", strokes)
    replay(t, paint, t.at("stylus.path"), *more)


def test_unplugged(t, stopped):
    """A device whose positions are missing for a time does not paint along the way to its next position.
    stopped: neither if the loop is stopped meanwhile."""
    paint = t.at(f"unplugged-{stopped}.paint.h5")
    p = t.start(paint, "--device", "udp:0", "--seconds", "40")
    device = Device(p)
    device.draw(p, 0.4)
    time.sleep(0.1)
    if stopped:
        p.send_signal(signal.SIGSTOP)
    time.sleep(0.4)
    for x in (0.7, 0.72, 0.74, 0.76):
        for n in range(20):
            device.send((x, 0.5, 0.98))
            time.sleep(0.002)
            if n == 1:
                p.send_signal(signal.SIGCONT)
    device.send((0, 0, 0), kind=3)
    out, err = p.communicate(timeout=60)
    strokes = [[q["place"][0] for q in s["points"]] for s in t.strokes(paint)]
    check(p.returncode == 0 and len(strokes) == 2 and max(strokes[0]) < 0.3 and min(strokes[1]) > 0.6, err, strokes)


def test_brush(t):
    """A tool of 10,000 points, a tilted bowl, paints with its points that are pressed in. It keeps up with the loop."""
    brush, path, paint = t.at("brush.txt"), t.at("brush.path"), t.at("brush.paint.h5")
    line(brush, [(0.1 * math.cos(i) * (i / 10000) ** 0.5, 0.1 * math.sin(i) * (i / 10000) ** 0.5,
                  0.1 - 0.1 * (1 - i / 10000) ** 0.5) for i in range(10000)])  # the lower half of a ball
    tilt = 0.5  # about the x axis; the lowest point is then at y = 0.1 sin(tilt), z = -low
    low = 0.1 - 0.1 * math.cos(tilt)
    with open(path, "w", encoding="ascii") as out:
        out.writelines(f"{0.2 + 0.0003 * i} 0.5 {max(0.99 + low, 1.1 - 0.001 * i)} {math.sin(-tilt / 2)} 0 0 {math.cos(tilt / 2)}\n"
                       for i in range(2000))
    p = t.start(paint, "--tool", brush, "--path", path, "--rate", "4000")
    out, err = p.communicate(timeout=60)
    got = json.loads(out)
    check(p.returncode == 0 and err == "" and got["paint"]["lost_steps"] == 0, p.returncode, err)
    check(got["contacts"] > 1800 and got["paint"]["strokes"] == 1, got["contacts"], got["paint"])
    places = [q["place"] for s in t.strokes(paint) for q in s["points"]]
    check(len(places) > 40 * 64 and all(abs(q[2] - 1) < 1e-9 for q in places), len(places))
    y, wide = 0.5 + 0.1 * math.sin(tilt), math.sqrt(0.1 ** 2 - 0.09 ** 2)  # a cap of height 0.01
    last = places[-64:]  # the last print
    check(0.7 < last[0][0] < 0.85, last)
    for low, high in ((min(q[1] for q in last) - y, max(q[1] for q in last) - y),
                      (min(q[0] for q in last) - 0.8, max(q[0] for q in last) - 0.8)):
        check(abs(low + wide) < 0.015 and abs(high - wide) < 0.015, low, high, wide)


def ball(t, count):
    """Writes points of a ball of radius 0.1. Returns the name of the file."""
    name, heights = t.at(f"ball-{count}.txt"), [1 - (2 * i + 1) / count for i in range(count)]
    line(name, [(0.1 * math.cos(2.4 * i) * (1 - z * z) ** 0.5, 0.1 * math.sin(2.4 * i) * (1 - z * z) ** 0.5, 0.1 * z)
                for i, z in enumerate(heights)])
    return name


def test_corner(t):
    """A brush in a corner paints on both sides, each as far as the motion to the device would press it in."""
    path, paint = t.at("corner.path"), t.at("corner.paint.h5")
    model = boxes(t, "corner", ((0, 0, 0), (2, 1, 1)), ((1.5, 0, 1.0001), (2, 1, 2)))
    ends = [(1.41 - 0.1 * i / 200, 0.5, 1.08 + 0.2 * i / 200) for i in range(200, 0, -1)]
    line(path, ends + [(1.41, 0.5, 1.08)] * 100)
    t.run("haptic", "--path", path, "--tool", ball(t, 4000), "--paint", paint, "--pen-radius", "0.01", "--full-force", "9", model)
    strokes = json.loads(t.run("paint", "--json", "--points", paint, model))["strokes"]
    last = [q["place"] for s in strokes for q in s["points"]][-64:]
    for k, plane, centre, deep in ((2, 1, 1.4, 0.02), (0, 1.5, 1.1, 0.01)):  # the floor and the wall
        far = [math.hypot(q[2 - k] - centre, q[1] - 0.5) for q in last if abs(q[k] - plane) < 1e-9]
        wide = math.sqrt(0.1 ** 2 - (0.1 - deep) ** 2)
        check(len(far) > 10 and wide - 0.015 < max(far) < wide + 0.003, k, far, wide)


def test_deeper(t):
    """A brush that is pressed in further at one position also paints with the points that are pressed now."""
    brush, path, paint = t.at("steps.txt"), t.at("steps.path"), t.at("steps.paint.h5")
    line(brush, [(0.05 * i, 0, 0.02 * i) for i in range(10)])
    line(path, [(0.2, 0.5, max(0.91, 1.1 - 0.001 * i)) for i in range(400)])
    for force in ("1", "1000"):  # full pressure from the beginning, and nearly none
        t.run("haptic", "--path", path, "--tool", brush, "--paint", paint, "--pen-radius", "0.01", "--full-force", force, t.model)
        xs = {round(q["place"][0], 2) for s in t.strokes(paint) for q in s["points"]}
        check(xs == {0.2, 0.25, 0.3, 0.35, 0.4}, xs)  # of heights up to 0.08
        os.remove(paint)


def test_probe(t):
    """The page of a probe gets its distance, and the colour of the distance."""
    viewer = t.at("probe")
    os.mkdir(viewer)
    with open(os.path.join(viewer, "index.html"), "w", encoding="ascii"):
        pass
    p = subprocess.Popen([t.ebpo, "haptic", "--probe", "--view", "--viewer", viewer, "--port", "0", "--device", "viewer",
                          t.model], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    port = int(re.search(r"127\.0\.0\.1:(\d+)/", p.stderr.readline())[1])
    page = request(port, "GET /live", "Sec-Fetch-Site: same-origin")[1]
    press(port, 0.5, 1.02)
    seen, end = b"", time.monotonic() + 5
    while not re.search(rb'"depth":0\.02,"colour":"#[0-9a-f]{6}"', seen) and time.monotonic() < end:
        seen += page.recv(65536)
    p.send_signal(signal.SIGTERM)
    err = p.communicate(timeout=60)[1]
    check(p.returncode == 0 and re.search(rb'"depth":0\.02,"colour":"#[0-9a-f]{6}"', seen), p.returncode, err, seen[-300:])


def test_full_disk(t, recovers):
    """The loop continues when the paint cannot be saved. It is saved when there is space again."""
    paint, limit = t.at(f"full-{recovers}.paint.h5"), (20000, resource.RLIM_INFINITY)
    p = t.start(paint, "--device", "udp:0", "--seconds", "40", "--pen-radius", "0.0005", "--full-force", "1")
    device = Device(p)
    resource.prlimit(p.pid, resource.RLIMIT_FSIZE, limit)
    device.draw(p, 2.2)
    check(p.poll() is None, "the loop ended")
    saved = t.point_count(paint)  # the file is complete, but old
    if recovers:
        resource.prlimit(p.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        device.draw(p, 1, lambda now: now > 0.4 and t.point_count(paint) > saved)
    else:
        p.send_signal(signal.SIGTERM)
    device.send((0, 0, 0), kind=3)
    out, err = p.communicate(timeout=60)
    got = json.loads(out)
    # The first save fails after a second, or 1,000 steps; a busy machine omits some of the 2,200 steps.
    check(got["paint"]["failed_saves"] > 0 and got["haptic"]["steps"] > 1200, got["paint"], got["haptic"]["steps"])
    check(err.count("the device continues") == 1 and ("saved again" in err) == recovers, err)
    check(p.returncode == (0 if recovers else 1) and ("failure" in got["paint"]) != recovers, p.returncode, err)
    check(("the paint since the last save is lost" in err) != recovers, err)
    now = t.point_count(paint)
    check(now > saved if recovers else now == saved, saved, now)


def test_saved_elsewhere(t):
    """If the paint file cannot be saved at the end, the paint is saved beside it, or in the folder for temporary files."""
    folder, other = t.at("folder"), t.at("other")
    for name in (folder, other):
        os.mkdir(name)
    for moved in (False, True):
        paint = os.path.join(folder, f"{moved}.paint.h5")
        p = t.start(paint, "--device", "udp:0", "--seconds", "40", env={**os.environ, "TMPDIR": other})
        device = Device(p)
        device.draw(p, 0.4)
        if moved:
            os.rename(folder, t.at("moved"))
        else:
            os.utime(paint)  # as if another program had changed it
        device.draw(p, 0.4)  # the paint may have been saved just before the change
        p.send_signal(signal.SIGTERM)
        out, err = p.communicate(timeout=60)
        made = f"{other if moved else folder}/{moved}.paint.h5.unsaved-{p.pid}"
        check(p.returncode == 1 and f"the paint is in {made} instead" in err, p.returncode, err)
        got = json.loads(out)["paint"]
        check(got["points"] == t.point_count(made) > 0, got)


def test_sync_failures(t, faults):
    """If a disk fails once, the paint is saved again; if it fails always, the command reports this at the end, too."""
    path = t.at("sync.txt")
    with open(path, "w", encoding="ascii") as out:
        out.write("".join(f"{i / 1000} 0.3 {0.97 if 100 < i < 300 else 1.2}\n" for i in range(1500)))
    for calls in ("1", "1+"):
        p = t.start(t.at(f"sync-{calls}.paint.h5"), "--path", path,
                    env={**os.environ, "LD_PRELOAD": faults, "EBPO_TEST_FAULT": f"fsync:{calls}:5"})
        out, err = p.communicate(timeout=60)
        got = json.loads(out)["paint"]
        check(err.count("the device continues") == 1 and got["points"] > 0, err, got)
        fails = calls == "1+"
        check(p.returncode == fails and ("could not be synced" in got.get("failure", "")) == fails, p.returncode, got)


def request(port, first, *fields):
    """Sends a request to the viewer. Returns (first bytes of the response, socket)."""
    s = socket.create_connection(("127.0.0.1", port), timeout=20)
    lines = (first + " HTTP/1.1", f"Host: 127.0.0.1:{port}", *fields)
    s.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
    return s.recv(4096), s


def press(port, x, z=0.99):
    body = f"press {x} 0.5 {z}"
    head, s = request(port, "POST /device", f"Origin: http://127.0.0.1:{port}", f"Content-Length: {len(body)}\r\n\r\n{body}")
    s.close()
    check(b" 204 " in head, head)
    time.sleep(0.2)


def ends(page):
    """Returns true if the server ends the connection in a few seconds."""
    end = time.monotonic() + 5
    while time.monotonic() < end:
        try:
            if not page.recv(65536):
                return True
        except ConnectionError:
            return True
    return False


def test_view(t):
    """Other sites get no events and cannot frame the page. The pen is lifted when the last page has left. If the
    server fails, the device continues."""
    paint, viewer = t.at("view.paint.h5"), t.at("viewer")
    os.mkdir(viewer)
    with open(os.path.join(viewer, "index.html"), "w", encoding="ascii") as out:
        out.write("<p>the page</p>")
    p = t.start(paint, "--view", "--viewer", viewer, "--port", "0", "--device", "viewer", "--seconds", "40")
    port = int(re.search(r"127\.0\.0\.1:(\d+)/", p.stderr.readline())[1])
    for site, status in (("cross-site", b" 403 "), ("same-site", b" 403 "), ("same-origin", b" 200 ")):
        head, page = request(port, "GET /live", "Sec-Fetch-Site: " + site)
        check(status in head and b"\r\nContent-Security-Policy: frame-ancestors 'self'\r\n" in head, site, head)
    press(port, 0.4, 1.05)
    press(port, 0.4)
    page.close()
    time.sleep(0.3)
    page = request(port, "GET /live")[1]
    press(port, 0.45)
    unlimited = resource.prlimit(p.pid, resource.RLIMIT_NOFILE, (1, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    socket.create_connection(("127.0.0.1", port)).close()
    ended = ends(page)
    resource.prlimit(p.pid, resource.RLIMIT_NOFILE, unlimited)
    p.send_signal(signal.SIGTERM)
    out, err = p.communicate(timeout=60)
    check(p.returncode == 0 and "the server of the viewer cannot run: Invalid argument" in err, p.returncode, err)
    check(ended, "the connection of a page stays open after the server has failed")
    check(json.loads(out)["paint"]["strokes"] == 2, "the pen was not lifted", out)


def main(ebpo, faults=None):
    with tempfile.TemporaryDirectory() as folder:
        t = Test(ebpo, folder)
        test_replay(t)
        test_erase(t)  # of the strokes that test_replay has painted
        others = (lambda _: test_full_disk(t, True), lambda _: test_full_disk(t, False),
                  lambda _: test_kill(t, faults), test_second_writer, test_stylus, test_lifted_pen,
                  lambda _: test_unplugged(t, False), lambda _: test_unplugged(t, True),
                  test_saved_elsewhere, test_view, test_probe, test_brush, test_corner, test_deeper, test_gap)
        if faults:
            others += (lambda _: test_sync_failures(t, faults),)
        with ThreadPoolExecutor(3) as pool:  # they wait for their devices most of the time
            for result in [pool.submit(test, t) for test in others]:
                result.result()


main(*sys.argv[1:])
