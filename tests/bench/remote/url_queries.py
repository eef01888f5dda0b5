"""The queries by URL: the rows that are measured for each side."""
import array
import json
import math
import random
import re
import shutil
import subprocess
import time

BUDGET = "256M"
NEAR = 1e-4     # diagonals
VIEW_FROM = 0.03
KEPT = 588e3    # bytes that `fetch --box` keeps
CONNECTIONS = 32  # maximum of the command, used to count dependent round trips
TRIES = 3


class Side:
    """A build in its checkout, with its files of the large and the small model."""
    def __init__(self, name, build, large, small):
        self.name, self.build, self.files = name, build, {"large": large, "small": small}
        self.ebpo, self.root = build / "tools/ebpo", build.parent

    def run(self, *command):
        return subprocess.run([self.ebpo, *map(str, command)], check=True, capture_output=True,
                              text=True, stdin=subprocess.DEVNULL).stdout

    def link(self, which):
        return f"{self.name.replace(' ', '_')}_{which}.ebpo.h5"


# --- positions ---

def unit(dice):
    z, turn = 2 * dice.random() - 1, 2 * math.pi * dice.random()
    flat = math.sqrt(1 - z * z)
    return [flat * math.cos(turn), flat * math.sin(turn), z]


def numbers(*values):
    return " ".join(repr(x) for x in values)


class Places:
    """Random positions on a model: where random lines through the ball around the model enter the surface.

    They are uniform by area on the part that is visible from outside, and always the same for one model.
    """
    def __init__(self, side, which, count, work):
        self.work, self.side, self.file = work, side, side.files[which]
        info = json.loads(side.run("info", "--json", self.file))
        self.diagonal = math.dist([0, 0, 0], info["box_size"])
        self.size = info["box_size"]
        self.centre = [o + s / 2 for o, s in zip(info["box_origin"], self.size)]
        dice, rays = random.Random(1), []
        for _ in range(16 * count):
            d, a, r = unit(dice), unit(dice), self.diagonal / 2
            side_step = [x - y * sum(p * q for p, q in zip(a, d)) for x, y in zip(a, d)]
            rays.append(([c - 2 * r * x + r * s for c, x, s in zip(self.centre, d, side_step)], d))
        queries = work / f"rays_{which}.txt"
        queries.write_text("".join(numbers(*o, *d) + "\n" for o, d in rays))
        hits = map(json.loads, side.run("ray", "--json", "--memory", "2G", self.file,
                                        queries).splitlines())
        self.found = [([o + hit["t"] * x for o, x in zip(origin, d)], d)
                      for (origin, d), hit in zip(rays, hits) if hit][:count]
        if len(self.found) < count:
            raise RuntimeError(f"{self.file}: only {len(self.found)} positions of {count}")

    def near(self, name, begin, count):
        """Write a file of points at most NEAR diagonals from the surface."""
        path = self.work / name
        lines = []
        for i in range(begin, begin + count):
            shift = [NEAR * self.diagonal * random.Random(i).random() * x
                     for x in unit(random.Random(i))]
            lines.append(numbers(*(p + s for p, s in zip(self.found[i][0], shift))) + "\n")
        path.write_text("".join(lines))
        return path

    def deep(self, count):
        """Write a file for each of the points with the greatest distance inside, of 1,000 random points in the box."""
        dice, path = random.Random(3), self.work / "deep.txt"
        points = [[c + (dice.random() - 0.5) * s for c, s in zip(self.centre, self.size)] for _ in range(1000)]
        path.write_text("".join(numbers(*p) + "\n" for p in points))
        found = [json.loads(line)["distance"] for line in self.side.run(
            "distance", "--json", "--memory", "2G", self.file, path).splitlines()]
        paths = [self.work / f"deep_{i}.txt" for i in range(count)]
        for out, i in zip(paths, sorted(range(1000), key=found.__getitem__)):
            out.write_text(numbers(*points[i]) + "\n")
        return paths

    def rays(self, name, side):
        """Write a file of side x side rays from one eye, in a square that the model fills."""
        path, eye = self.work / name, [c + e * self.diagonal for c, e in zip(self.centre, (0.3, 0.4, 1.2))]
        at = [(i / (side - 1) - 0.5) * 0.6 * self.diagonal for i in range(side)]
        path.write_text("".join(numbers(*eye, self.centre[0] + x - eye[0], self.centre[1] + y - eye[1],
                                        self.centre[2] - eye[2]) + "\n" for y in at for x in at))
        return path

    def crowd(self, name, count):
        """Write a file of points around all positions, up to 100 times as far from the surface as the near points."""
        path, dice = self.work / name, random.Random(2)
        path.write_text("".join(
            numbers(*(p + 10**-(2 + 2 * dice.random()) * self.diagonal * x
                      for p, x in zip(self.found[i % len(self.found)][0], unit(dice)))) + "\n"
            for i in range(count)))
        return path

    def view(self, i):
        """Return an eye outside of the model, and the point at which it looks."""
        at, d = self.found[i]
        return [p - VIEW_FROM * self.diagonal * x for p, x in zip(at, d)], at

    def box(self, i):
        """Return the cube around a position of which `ebpo subset` keeps about KEPT bytes."""
        low, high, out = 0, 0.1 * self.diagonal, self.work / "box.ebpo.h5"
        for _ in range(14):
            half = (low + high) / 2
            box = [round(x + s * half, 3) for s in (-1, 1) for x in self.found[i][0]]
            self.side.run("subset", "-q", "--box", ",".join(map(repr, box)), self.file, out)
            kept = out.stat().st_size
            if abs(kept - KEPT) < 0.01 * KEPT:
                break
            low, high = (half, high) if kept < KEPT else (low, half)
        return ",".join(map(repr, box)), kept


# --- rows ---

class Row:
    """Commands that run one by one. command: their text on the page; arguments: the arguments of each."""
    def __init__(self, name, what, command, arguments, which="large", least_round_trips=True):
        self.name, self.what, self.command = name, what, command
        self.arguments, self.which, self.least_round_trips = arguments, which, least_round_trips


def rows(large, small, work, singles, views):
    """Return all rows of queries by URL."""
    each = [large.near(f"near_{i}.txt", i, 1) for i in range(singles)]
    hundred, fifty = large.near("near_100.txt", 0, 100), small.near("near_50.txt", 0, 50)
    box, kept = large.box(0)
    seen = [[numbers(*p).replace(" ", ",") for p in large.view(i)] for i in range(views)]

    def points(command, files, *options):
        return [[command, *options, "URL", file] for file in files]
    budget = ["--memory", BUDGET]
    shown = f"ebpo {{}} --memory {BUDGET} URL {{}}"
    table = [Row(f"{c} one", f"one {c} near the surface", shown.format(c, "POINT"),
                 points(c, each, *budget)) for c in ("distance", "inside")]
    table += [Row(f"{c} 100", f"100 near points: {c}", shown.format(c, "POINTS"),
                  points(c, [hundred], *budget)) for c in ("distance", "inside")]
    table += [Row(f"{c} 50 small", f"50 near points of the small model: {c}",
                  shown.format(c, "POINTS"), points(c, [fifty], *budget), "small")
              for c in ("distance", "inside")]
    table += [
        Row("distance deep small", "one distance deep inside the small model", shown.format("distance", "POINT"),
            points("distance", small.deep(singles), *budget), "small"),
        Row("ray eye small", "100 rays from one eye to the small model", shown.format("ray", "RAYS"),
            points("ray", [small.rays("rays_100.txt", 10)], *budget), "small"),
        Row("box", f"`fetch --box` that keeps {kept:,} B", f"ebpo fetch -q --box {box} URL OUT",
            [["fetch", "-q", "--box", box, "URL", "OUT"]]),
        Row("view", f"nodes of a view from {VIEW_FROM} diagonals away",
            "ebpo view --eye EYE --look AT --seen-only --pixels 16 URL",
            [["view", "--eye", eye, "--look", at, "--seen-only", "--pixels", "16", "URL"]
             for eye, at in seen]),
        *(Row(f"levels {to}", f"levels 0 to {to}, types and planes", f"ebpo levels --max-level {to} URL",
              [["levels", "--max-level", to, "URL"]]) for to in (5, 8)),
        Row("info", "`info`", "ebpo info URL", [["info", "URL"]], least_round_trips=False),
        Row("extract", "`extract --mesh`", "ebpo extract --mesh URL OUT", [["extract", "--mesh", "URL", "OUT.ply"]],
            least_round_trips=False),
        Row("no budget", "one inside, without `--memory`", "ebpo inside URL POINT",
            points("inside", each[:1]), least_round_trips=False)]
    return {row.name: row for row in table}


def run_row(server, line, side, row, work, connections=None):
    """Run the commands one after the other, each in a new process. Return {requests, bytes, seconds or
    least_round_trips: [of each]}."""
    out, found = work / "out.ebpo.h5", {"requests": [], "bytes": [], "seconds": [], "least_round_trips": []}
    name = side.link(row.which)
    for command in row.arguments:
        words = {"URL": f"http://127.0.0.1:{line.port}/{name}", "OUT": out, "OUT.ply": out.with_suffix(".ply")}
        command = [str(words.get(word, word)) for word in command]
        if connections:
            command[1:1] = ["--http-connections", str(connections)]
        out.unlink(missing_ok=True)
        out.with_suffix(".ply").unlink(missing_ok=True)
        shutil.rmtree(f"{out}.part", ignore_errors=True)
        server.traffic(name)
        line.requests = []
        begin = time.perf_counter()
        said = side.run(*command)
        found["seconds"].append(time.perf_counter() - begin)
        count, size = server.traffic(name)
        found["requests"].append(count)
        found["bytes"].append(size)
        found["least_round_trips"].append(line.least_round_trips(connections or 1000))
        if not said and row.name != "box":
            raise RuntimeError(f"{side.name}, {row.name}: no result")
    return found


def measure(server, line, side, row, work):
    """Measures a row with the default connections, and its dependent round trips with 32."""
    found = run_row(server, line, side, row, work)
    found["round_trips"] = found.pop("least_round_trips")
    if row.least_round_trips:
        # other load of the machine only increases the number
        tries = [run_row(server, line, side, row, work, CONNECTIONS)["least_round_trips"] for _ in range(TRIES)]
        found["least_round_trips"] = [min(each) for each in zip(*tries)]
    return found


# --- local files ---

def local(side, file, seeds, count):
    """Measure a first result from a cold file, a path at full speed, and uniform points."""
    def bench(*options):
        return json.loads(side.run("bench", "--json", "--memory", BUDGET, *options, file))
    found = {}
    for query in "inside", "distance":
        found[query] = {
            "first": [bench("--query", query, "--points", "path", "--count", 1, "--seed", seed)
                      for seed in range(1, seeds + 1)],
            "path": bench("--query", query, "--points", "path", "--count", count, "--prefetch"),
            "uniform": bench("--query", query, "--points", "uniform", "--count", count // 200)}
    return found


def without_gaps(side, work):
    """Return the number of subtrees and the bytes that the 100 rays read of the local small model: no gaps between
    chunks. `rows` wrote the rays."""
    said = subprocess.run([side.ebpo, "ray", "--stats", "--memory", BUDGET, side.files["small"], work / "rays_100.txt"],
                          check=True, capture_output=True, text=True).stderr
    return [int(re.search(rf"\b{what} (\d+)", said)[1]) for what in ("loads", "bytes_read")]


def known_in_advance(server, side, work):
    """Return {query: [(needed subtrees, requests, bytes) of each command]} for queries of the small model that know all
    needed subtrees in advance and request them together. `rows` wrote the points."""
    name, points, found = side.link("small"), work / "points.bin", {}
    subprocess.run(["ninja", "-C", side.build, "tests/bench/needed_subtrees"], check=True, capture_output=True)
    for query, files in (("one distance deep inside", sorted(work.glob("deep_*.txt"))),
                         ("50 near points", [work / "near_50.txt"])):
        for file in files:
            points.write_bytes(array.array("d", map(float, file.read_text().split())).tobytes())
            server.traffic(name)
            said = subprocess.run([side.build / "tests/bench/needed_subtrees", side.files["small"], points, "256000000",
                                   f"http://127.0.0.1:{server.port}/{name}"],
                                  check=True, capture_output=True, text=True).stdout
            count = int(re.search(r"requested: (\d+)", said)[1])
            found.setdefault(query, []).append((count, *server.traffic(name)))
    return found


def same_results(side, line, which, points):
    """Return True when the results by URL equal those from the file."""
    url = f"http://127.0.0.1:{line.port}/{side.link(which)}"
    return all(side.run(command, "--memory", BUDGET, url, points)
               == side.run(command, "--memory", BUDGET, side.files[which], points)
               for command in ("inside", "distance"))
