"""The programs that tests/bench/query.py queries, and the models with their queries.

The programs are this library's and the peers'. Each keeps its model in memory between queries.
"""
import array
import collections
import json
import math
import os
import pathlib
import shlex
import statistics
import subprocess
import sys

PEERS = ["ebpo", "embree", "cgal"]
CGAL_MOST = 2000000  # the most faces for queries of CGAL
NAMES = {"ebpo": "ours", "embree": "Embree", "cgal": "CGAL"}


class Bench:
    def __init__(self, options):
        self.options = options
        self.build = pathlib.Path(options.build)
        self.ebpo = self.build / "tools" / "ebpo"
        self.work = pathlib.Path(options.work or self.build / "bench-query")
        self.work.mkdir(parents=True, exist_ok=True)
        self.load = []

    def rounds(self, model):
        return self.options.rounds if model.faces < 2000000 else max(1, self.options.rounds // 2)

    def command(self, *words, core=None):
        """Run a command. core: None: the measured core; False: any core."""
        core = self.options.core if core is None else core
        words = [str(w) for w in words]
        words = words if core is False else ["taskset", "-c", str(core)] + words
        if self.options.verbose:
            print("+", shlex.join(words), file=sys.stderr)
        self.load.append(os.getloadavg()[0])
        return words

    def run(self, *words, core=None):
        words = self.command(*words, core=core)
        done = subprocess.run(words, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{shlex.join(words)}: {done.stderr.strip() or done.returncode}")
        return done.stdout

    def ours(self, model, query, *arguments, points="uniform", core=None):
        """Run a query with `ebpo bench`. points: a word, or a file of points."""
        kind = ["--raw"] if pathlib.Path(points).suffix == ".raw" else ["--seed", 1]
        return json.loads(self.run(self.ebpo, "bench", model.file, "--query", query, "--points",
                                   points, *kind, "--json", *arguments, core=core))

    def program(self, peer):
        return self.build / "tests" / "bench" / "peers" / f"peer_{peer}"

    def peers(self, model):
        return [p for p in PEERS
                if self.program(p).exists() and (p != "cgal" or model.faces < CGAL_MOST)]


class Server:
    """A program that keeps a model in memory.

    Its result is None when the program does not support the query (CGAL needs closed manifolds).
    """

    def __init__(self, bench, peer, model, *arguments, core=None):
        self.bench, self.peer, self.model = bench, peer, model
        self.arguments, self.core = arguments, core
        self.process = None

    def __enter__(self):
        source = self.model.file if self.peer == "ebpo" else self.model.ply
        words = self.bench.command(self.bench.program(self.peer), source, "serve",
                                   *self.arguments, core=self.core)
        self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait()

    def run_query(self, query, points, *words):
        try:
            print(query, points, *words, file=self.process.stdin, flush=True)
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if line:
            return json.loads(line)
        print(f"query.py: {self.peer}, {self.model.name}: {self.process.stderr.read().strip()}",
              file=sys.stderr)
        return None


class Model:
    def __init__(self, bench, ply):
        self.bench, self.ply, self.name = bench, pathlib.Path(ply), pathlib.Path(ply).stem
        self.file = bench.work / f"{self.name}.ebpo.h5"
        if not self.file.exists() or self.file.stat().st_mtime < self.ply.stat().st_mtime:
            bench.run(bench.ebpo, "convert", "-q", self.ply, self.file, core=False)
        self.info = json.loads(bench.run(bench.ebpo, "info", "--json", self.file, core=False))
        self.faces = self.info["faces"]
        self.diagonal = math.hypot(*self.info["box_size"])

    def queries_of(self, points, count, rays=False):
        """Return a file of `count` queries, which is made once.

        A cheap query makes it: rays without length, or inside with the first levels.
        """
        raw = self.bench.work / f"{self.name}.{points}{'.rays' if rays else ''}.{count}.raw"
        if not raw.exists():
            self.bench.ours(self, *(["ray-any", "--tmax", 0] if rays else ["inside", "--max-level", 1]),
                            "--count", count, "--memory", "256MiB", "--save-points", raw,
                            points=points, core=False)
        return raw

    def crossings_of(self, raw):
        """Return the number of different t of each ray's hits."""
        hits = self.bench.work / f"{raw.stem}.hits"
        self.bench.run(self.bench.ebpo, "ray", "--all", "--raw", "-o", hits, self.file, raw, core=False)
        values, words = array.array("d", hits.read_bytes()), array.array("Q", hits.read_bytes())
        crossings, at = [], 0
        while at < len(words):
            end = at + 1 + 3 * words[at]
            crossings.append(len(set(values[at + 1:end:3])))
            at = end
        return crossings

    def equal_rays(self, count):
        """Return files of uniform and of degenerate rays: of each number of crossings, as many of both kinds, the
        first ones.
        """
        files = [self.queries_of(points, count, True) for points in ("uniform", "degenerate")]
        crossings = [self.crossings_of(raw) for raw in files]
        common = collections.Counter(crossings[0]) & collections.Counter(crossings[1])
        chosen = []
        for raw, numbers in zip(files, crossings):
            rays, left = raw.read_bytes(), common.copy()
            chosen.append(raw.with_suffix(".equal.raw"))
            with open(chosen[-1], "wb") as out:
                for i, number in enumerate(numbers):
                    if left[number]:
                        left[number] -= 1
                        out.write(rays[48 * i:48 * (i + 1)])
        return chosen

    def hard(self, rays, count):
        raw = self.bench.work / f"{self.name}.hard{'.rays' if rays else ''}.{count}.raw"
        self.bench.run(self.bench.build / "tests" / "bench" / "exact_judge", "make", self.file,
                       "rays" if rays else "points", count, raw, core=False)
        return raw


def grown(bench, what):
    """Return BASE.ply:M: `ebpo-generate` divides the base's faces into four until there are at least M."""
    base, faces = what.rsplit(":", 1)
    target = bench.work / f"{pathlib.Path(base).stem}_{faces}.ply"
    if not target.exists():
        bench.run(bench.build / "samples" / "ebpo-generate", "--base", base, "--faces", faces,
                  target, core=False)
    return target


def middle(reports, name="mean_cpu_ns"):
    """Return the median, or None when a program has no result."""
    values = [r[name] for r in reports if r]
    return statistics.median(values) if values else None


# ---- results ----

def inside_of(path):
    return pathlib.Path(path).read_bytes()


def hits_of(path):
    """Return distances or ray parameters, and faces, of 16 bytes each."""
    data = pathlib.Path(path).read_bytes()
    values, faces = array.array("d", data)[0::2], array.array("q", data)[1::2]
    return values, faces


def lengths_of(path):
    """Return the lengths of the rays' directions."""
    data = array.array("d", pathlib.Path(path).read_bytes())
    return [math.hypot(*data[i + 3:i + 6]) for i in range(0, len(data), 6)]


def differences(query, ours, theirs, tolerance, lengths=None):
    """Return the number of different results.

    inside: points on the surface are ignored. ray-any: hit or no hit. ray-all: number of hits.
    distance, ray: a difference above `tolerance`, or only one has a result. `lengths`: factors of ray parameters.
    """
    if query == "inside":
        return sum(a != b for a, b in zip(inside_of(ours), inside_of(theirs)) if a != 2)
    (a, a_faces), (b, b_faces) = hits_of(ours), hits_of(theirs)
    tolerance = 0.5 if query == "ray-all" else tolerance
    units = lengths if query == "ray" and lengths else [1] * len(a)
    none = [(x < 0) != (y < 0) for x, y in zip(a_faces, b_faces)]
    return sum(n or (f >= 0 and not abs(abs(x) - y) * u <= tolerance)
               for n, f, x, y, u in zip(none, a_faces, a, b, units))
