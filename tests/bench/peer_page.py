#!/usr/bin/env python3
"""Measures this library and Python packages in one run, and writes docs/measured/peers.md. peers.py calls it.

Each package runs in a process (peer_packages.py) on the same core, and the processes take turns. peer_judge.py counts
wrong results for the first model.
"""
import argparse
import json
import os
import pathlib
import shlex
import statistics
import subprocess
import sys
import tempfile

import numpy as np

import ebpo

import peer_packages
from measured import machine
from peer_judge import Judge
from query_page import Page, figure, reflow

HERE = pathlib.Path(__file__).resolve().parent
SLOW = 2e-5  # seconds per query; a package that takes longer gets a tenth of the queries, ten times longer a hundredth
STRUCTURES = {"inside": ["inside"], "nearest": ["nearest"], "rays": ["rays"], "pairs": ["contact", "gap"]}
INPUTS = {"inside": ["uniform", "near"], "nearest": ["uniform", "near"], "rays": ["uniform", "near"],
          "contact": ["slight", "deep", "none", "far"], "gap": ["none"]}
HARD = {"inside": ["hard"], "nearest": ["hard"], "rays": ["hard"], "contact": ["touching"], "gap": []}
TITLES = {"inside": "inside", "nearest": "nearest point", "rays": "first hit", "contact": "contact", "gap": "distance"}


class Server:
    """A process with one package and one model."""

    def __init__(self, package, mesh, file, environment):
        self.process = subprocess.Popen([sys.executable, HERE / "peer_packages.py", package, mesh, file], text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)

    def order(self, **words):
        self.process.stdin.write(json.dumps(words) + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        return json.loads(line) if line else {"fault": f"the process ended with {self.process.wait()}"}

    def end(self):
        self.process.stdin.close()
        self.process.wait()


# ---- queries ----

def floats(rows):
    """Round to single precision, so that every package gets the same query."""
    return np.asarray(rows, dtype=np.float32).astype(np.float64)


class Inputs:
    """Makes the queries of one model."""

    def __init__(self, vertices, faces, file, random):
        self.vertices, self.faces, self.file, self.random = vertices, faces, file, random
        self.low, self.high = vertices.min(axis=0), vertices.max(axis=0)
        self.diagonal = np.linalg.norm(self.high - self.low)

    def uniform(self, count):
        return floats(self.random.uniform(self.low, self.high, (count, 3)))

    def near(self, count):
        chosen = self.vertices[self.faces[np.sort(self.random.integers(0, len(self.faces), count))]]
        normals = np.cross(chosen[:, 1] - chosen[:, 0], chosen[:, 2] - chosen[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        return floats(chosen.mean(axis=1) + normals * self.random.uniform(-.01, .01, (count, 1)) * self.diagonal)

    def hard(self, count):
        """Points beside a face's centre or a vertex by rounding errors, and on axes through vertices."""
        faces = self.faces[self.random.integers(0, len(self.faces), count)]
        centres, vertices = floats(self.vertices[faces].mean(axis=1)), self.vertices[faces[:, 0]]
        beside = np.nextafter(vertices.astype(np.float32), np.float32(np.inf)).astype(float)
        axis = vertices.copy()
        axis[np.arange(count), np.arange(count) % 3] = self.uniform(count)[np.arange(count), np.arange(count) % 3]
        return np.where((np.arange(count) % 3 == 0)[:, None], centres,
                        np.where((np.arange(count) % 3 == 1)[:, None], beside, axis))

    def rays(self, kind, count):
        if kind != "hard":
            return {"origins": getattr(self, kind)(count), "directions": floats(self.random.normal(size=(count, 3)))}
        vertices = self.vertices[self.random.integers(0, len(self.vertices), count)]
        directions = np.eye(3)[self.random.integers(0, 3, count)]  # along an axis through a vertex
        return {"origins": np.where(directions > 0, floats(self.low - self.diagonal), vertices),
                "directions": directions}

    def poses(self, kind, count):
        """Return poses of a copy; the separation along a random direction is found by bisection."""
        out, beyond = [], {"slight": -.01, "deep": -.2, "none": .02}
        model = ebpo.open(self.file)
        pair = ebpo.Collider(model, model)
        for k in range(count):
            pose = np.eye(4)
            if kind == "touching":  # the highest vertex on an axis touches the lowest vertex of the copy
                values = self.vertices[:, k % 3]
                pose[:3, 3] = self.vertices[values.argmax()] - self.vertices[values.argmin()]
            else:
                angle, direction = self.random.uniform(0, 7), self.random.normal(size=3)
                pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
                direction /= np.linalg.norm(direction)
                if kind == "far":
                    pose[:3, 3] = 10 * self.diagonal * direction
                    out.append(pose)
                    continue
                lo, hi = 0., 2 * self.diagonal + np.linalg.norm(self.low + self.high)
                for _ in range(30):
                    pose[:3, 3] = direction * (lo + hi) / 2
                    lo, hi = ((lo, (lo + hi) / 2) if pair.first(pose_b=pose) is None
                              else ((lo + hi) / 2, hi))
                pose[:3, 3] = direction * (hi + beyond[kind] * self.diagonal)
            out.append(pose)
        return {"matrices": np.array(out)}

    def make(self, query, kind, count, poses):
        if query in ("contact", "gap"):
            return self.poses(kind, 3 if kind == "touching" else poses)
        return self.rays(kind, count) if query == "rays" else {"points": getattr(self, kind)(count)}


# ---- judgement ----

def count_wrong(query, truth, found, given, diagonal):
    """Return how many results are wrong. Values may differ by a millionth of the diagonal."""
    most = 1e-6 * diagonal
    if query in ("inside", "contact"):
        return int(((truth >= 0) & (found[query] != truth)).sum())
    if query == "gap":
        return int((abs(found["gap"] - np.sqrt(np.array(truth, dtype=float))) > most).sum())
    if query == "nearest":
        return int((abs(found["distance"] - np.sqrt(np.array(truth[0], dtype=float))) > most).sum())
    exact = np.array([np.inf if t is None else float(t) for t in truth[0]])
    both = np.isfinite(exact) & np.isfinite(found["t"])
    length = np.linalg.norm(given["directions"], axis=1)
    off = np.where(both, abs(np.where(both, found["t"], 0) - np.where(both, exact, 0)) * length > most, False)
    return int(((np.isfinite(exact) != np.isfinite(found["t"])) | off).sum())


# ---- one model ----

def measure(path, options, work, environment, packages, judged):
    """Return facts of a model, and a dictionary of cells."""
    file, mesh, given, saved = (work / f"{path.stem}{end}" for end in (".ebpo.h5", ".npz", ".given.npz", ".saved.npz"))
    began = os.times()
    subprocess.run([options.build / "tools/ebpo", "convert", path, file], check=True, capture_output=True)
    ended = os.times()
    whole = ebpo.open(file).mesh(order="source")
    vertices, faces = np.array(whole.vertices, dtype=float), np.array(whole.faces, dtype=np.int64)
    np.savez(mesh, vertices=vertices, faces=faces)
    inputs = Inputs(vertices, faces, file, np.random.default_rng(1))
    judge = Judge(vertices, faces) if judged else None
    cells, faults = {}, {}
    for structure, queries in STRUCTURES.items():
        servers = {name: Server(name, mesh, file, environment) for name in packages
                   if hasattr(peer_packages.PACKAGES[name][0], structure + "_structure")}
        for name, server in list(servers.items()):
            report = server.order(structure=structure)
            cells["load", structure, name] = report
            if "fault" in report:
                faults[name, structure] = report["fault"]
                servers.pop(name).end()
        for query in queries:
            able = [name for name in servers if hasattr(peer_packages.PACKAGES[name][0], query)]
            for kind in INPUTS[query] + HARD[query]:
                few = inputs.make(query, kind, options.judged, options.poses)
                np.savez(given, **few)
                truth = getattr(judge, query)(**few) if judge else None
                speed = {}
                for name in list(able):
                    report = servers[name].order(query=query, input=str(given), save=str(saved))
                    if "fault" in report:
                        faults[name, query] = report["fault"]
                        able.remove(name)
                        continue
                    speed[name] = report["seconds"] / len(next(iter(few.values())))
                    if judge:
                        cells["wrong", query, kind, name] = count_wrong(query, truth, np.load(saved), few, inputs.diagonal)
                print(path.stem, query, kind, {name: f"{1e6 * t:.3g} us" for name, t in speed.items()}, flush=True)
                if kind in INPUTS[query]:
                    turns(servers, query, kind, few, speed, inputs, options, given, cells)
        for server in servers.values():
            server.end()
    seconds = ended.children_user + ended.children_system - began.children_user - began.children_system
    return {"name": path.stem, "faces": len(faces), "convert": seconds, "faults": faults, "cells": cells}


def turns(servers, query, kind, few, speed, inputs, options, given, cells):
    """Measure the packages in turns. Cells become ours in seconds per query, and ratios to ours of the same round."""
    posed = query in ("contact", "gap")
    many = few if posed else inputs.make(query, kind, options.points, options.poses)
    files = {}
    for share in (1, 10, 100):
        files[share] = str(given.with_suffix(f".{share}.npz"))
        np.savez(files[share], **{name: rows[:max(1, len(rows) // (1 if posed else share))] for name, rows in many.items()})
    ratios, ours = {name: [] for name in speed}, []
    for _ in range(options.rounds):
        times = {}
        for name in speed:
            share = 1 if speed[name] < SLOW or name == "ebpo" else 10 if speed[name] < 10 * SLOW else 100
            report = servers[name].order(query=query, input=files[share])
            times[name] = report["seconds"] / len(next(iter(np.load(files[share]).values())))
        ours.append(times["ebpo"])
        for name, value in times.items():
            ratios[name].append(value / times["ebpo"])
    cells["time", query, kind, "ebpo"] = statistics.median(ours)
    cells.update({("time", query, kind, name): statistics.median(found) for name, found in ratios.items()
                  if name != "ebpo"})


# ---- page ----

def value_of(model, what, query, kind, name):
    """Return a time, or a cost of loading: in seconds or bytes for ours, divided by ours for a package; or None."""
    if what == "time":
        return model["cells"].get(("time", query, kind, name))
    member = {"load": "seconds", "memory": "bytes"}[what]
    load, ours = (model["cells"].get(("load", query, each), {}).get(member) for each in (name, "ebpo"))
    return load if name == "ebpo" or load is None else load / ours


def rows_of(queries, structure):
    """Return (title, what, query, kind) of each row of a table."""
    return ([(f"{TITLES[query]}, {kind}", "time", query, kind) for query in queries for kind in INPUTS[query]]
            + [(what, what, structure, "") for what in ("load", "memory")])


TABLES = {"Points and rays": (rows_of(["inside", "nearest", "rays"], "nearest"),
                              ["embreex", "fcpw", "libigl", "Open3D", "trimesh"]),
          "Two models": (rows_of(["contact", "gap"], "pairs"), ["libigl", "trimesh", "Coal", "manifold3d"])}


def in_unit(model, what, value):
    return value if value is None else value / model["faces"] if what == "memory" else 1e6 * value


def write_table(page, models, title, packages):
    rows, columns = TABLES[title]
    columns = [name for name in columns if name in packages]
    page.text(f"### {title}")
    page.table(["query", "ours"] + columns,
               [[label, ", ".join(figure(in_unit(m, what, value_of(m, what, query, kind, "ebpo"))) for m in models)]
                + [cell if set(cell) - set("-, ") else "-"
                   for cell in (", ".join(figure(value_of(m, what, query, kind, name)) for m in models)
                                for name in columns)]
                for label, what, query, kind in rows])


def missed(models, packages):
    """Return a line for each package that is better than ours in a row."""
    out = []
    for name in packages:
        found = [f"{label} {', '.join(figure(v) for v in values)}"
                 for rows, columns in TABLES.values() if name in columns
                 for label, what, query, kind in rows
                 for values in [[value_of(m, what, query, kind, name) for m in models]]
                 if min((v for v in values if v is not None), default=1) < 1]
        out += [f"- {name}: {'; '.join(found)}"] if found else []
    return out or ["- none"]


def write(models, packages, missing, options):
    page, first = Page(), models[0]
    others = [name for name in packages if name != "ebpo"]
    wrong = {name: sum(v for key, v in first["cells"].items() if key[0] == "wrong" and key[3] == name)
             for name in packages}
    times = [[min(found) for m in models for found in [[v for name in others for v in
             [value_of(m, what, query, kind, name)] if v is not None]]]
             for rows, _ in TABLES.values() for _, what, query, kind in rows if what == "time"]
    fastest = sum(times, [])
    page.text("# Packages from PyPI", "",
              f"- Of {len(fastest)} times, {sum(value > 1 for value in fastest)} are shorter than those of every package. "
              f"The fastest package takes {figure(min(fastest))} to {figure(max(fastest))} times as long.",
              f"- Rational arithmetic contradicts {wrong['ebpo']} results of ours and "
              f"{sum(wrong[name] for name in others)} of the packages.",
              f"- The file is made once, in {', '.join(figure(m['convert']) + ' s' for m in models)}; packages build their "
              "structures at each start.")
    page.text("## Missed goals", "", "The goal: no value of a package, divided by ours, is below 1.", "", *missed(models, packages))
    versions = sorted({f"{name} {report['version']}" for m in models for (what, *_, name), report in m["cells"].items()
                       if what == "load" and report.get("version")})
    page.text("## Measurement", "", "    " + options.made, "",
              f"{options.machine}. {', '.join(versions)}. "
              + (f"Not on PyPI for this Python: {', '.join(missing)}. " if missing else "")
              + f"Packages take turns on one core. Processor times, medians of {options.rounds} rounds; "
              "one call for all points, one for each pose. Embree (embreex, robust), fcpw (8 wide, "
              "scaled) and Open3D have single precision. libigl: `FastWindingNumberBVH`, `AABB`, `intersect_other`. "
              "trimesh: embreex, rtree, python-fcl. Coal: OBBRSS, `break_distance` 0. manifold3d: Boolean "
              "intersection.")
    subjects = " and ".join(f"{m['name']} ({m['faces']:,} faces)" for m in models)
    page.text("## Times", "",
              f"Models: {subjects}. *ours*: us per query or load, bytes per face; others: divided by ours. *near*: "
              "within 1 % of the diagonal of a face. *slight*, *deep*: penetration of 1 and 20 %; *none*: gap of 2 %; *far*: "
              "mostly the cost of Python ([C](collide.md)). *load*: ours from the file.")
    for title in TABLES:
        write_table(page, models, title, packages)
    lines = []
    for query in INPUTS:
        for kind in INPUTS[query] + HARD[query]:
            count = 3 if kind == "touching" else options.poses if query in ("contact", "gap") else options.judged
            found = [(name, first["cells"].get(("wrong", query, kind, name))) for name in packages]
            if any(value for _, value in found):
                lines.append(f"- {TITLES[query]}, {kind}, of {count}: "
                             + ", ".join(f"{name} {value}" for name, value in found if value))
    page.text("## Wrong results", "",
              f"Of {options.judged} queries of each kind (single precision; tolerance: a millionth of the diagonal) and "
              f"{options.poses} poses for {first['name']}; others: 0. *hard*: beside faces and vertices, or in line with one; "
              "*touching*: at a vertex.", "", *lines)
    faults = sorted({f"- {name}, {what}: {text}" for m in models for (name, what), text in m["faults"].items()})
    if faults:
        page.text("Errors of packages:", "", *faults)
    options.output.write_text(reflow("\n".join(page.lines)).rstrip() + "\n", encoding="utf-8")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("models", nargs="+", type=pathlib.Path)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--judged", type=int, default=1000)
    parser.add_argument("--poses", type=int, default=6)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--missing", action="append", default=[])
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    options = parser.parse_args()
    options.made = shlex.join(["tests/bench/peers.py", "BUILD", *(path.name for path in options.models), "--points",
                               str(options.points), "--judged", str(options.judged), "--poses", str(options.poses),
                               "--rounds", str(options.rounds), "-o", "docs/measured/peers.md"])
    return options


def main():
    options = arguments()
    options.machine = f"{machine()}, load average {os.getloadavg()[2]:.1f}"
    packages = [name for name, (_, needed) in peer_packages.PACKAGES.items() if not set(needed) & set(options.missing)]
    environment = dict(os.environ, OMP_NUM_THREADS="1", IGL_NUM_THREADS="1")
    with tempfile.TemporaryDirectory() as work:
        models = [measure(path, options, pathlib.Path(work), environment, packages, not k)
                  for k, path in enumerate(options.models)]
    write(models, packages, options.missing, options)


if __name__ == "__main__":
    main()
