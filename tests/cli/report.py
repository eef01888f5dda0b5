#!/usr/bin/env python3
"""report.py TOOL INPUTS FEATURES: compares the values of `ebpo report` with other commands, with values computed
here, and with each other. The page contains the same data and loads nothing. tests/web/report_page.mjs tests
what the page draws.
"""
import csv
import html.parser
import json
import math
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

TOOL, INPUTS = (os.path.abspath(a) for a in sys.argv[1:3])
FEATURES = sys.argv[3].split(",")
POINTS, SEED = 400, 7
MASK = 2**64 - 1
VOID = {"meta"}


def run(*arguments, data=None):
    return subprocess.run([TOOL, *map(str, arguments)], input=data, check=True,
                          stdout=subprocess.PIPE).stdout


def report(folder, *arguments, seed=SEED):
    run("report", "-q", "--points", POINTS, "--seed", seed, "-o", folder, *arguments)
    with open(folder / "report.csv", encoding="utf-8", newline="") as f:
        rows = list(csv.DictReader(f))
    return rows, json.loads((folder / "report.json").read_text(encoding="utf-8"))


def value(text):
    return None if text == "" or not math.isfinite(float(text)) else float(text)


# --- the three files agree ---

def from_json(reported):
    """Returns (method, level, parameter, quantity) -> value, like the lines of the CSV."""
    found = {}
    of = {q["name"]: q for q in reported["quantities"]}
    for m in reported["methods"]:
        places = [("", "", m)] + [(str(l["level"]), "", l)
                                  for l in m["levels"]] + [("", f"{d['microseconds']}us", d)
                                                           for d in m["deadlines"]]
        places += [("", "=".join([k, repr_c(n[k])]), n) for n in m["targets"]
                   for k in ("max_error", "target_bytes") if k in n]
        places += [("", f"memory/{b['part']}", b) for b in m["budgets"]]
        for level, parameter, statistics in places:
            found.update({(m["name"], level, parameter, k): v for k, v in statistics.items()
                          if k in of})
    return found, of


def repr_c(v):
    return "%.17g" % v


def agree(rows, reported):
    found, of = from_json(reported)
    lines = {(r["method"], r["level"], r["parameter"], r["quantity"]): r for r in rows}
    assert len(lines) == len(rows) and lines.keys() == found.keys(), lines.keys() ^ found.keys()
    for key, line in lines.items():
        assert (value(line["value"]) == found[key]
                and line["unit"] == of[key[3]]["unit"]), (key, line)
    return of


class Well(html.parser.HTMLParser):
    """Checks that tags are closed in order and that the page loads nothing; collects scripts and style by their id."""

    def __init__(self):
        super().__init__()
        self.open, self.name, self.texts = [], None, {}

    def handle_starttag(self, tag, attributes):
        assert tag not in ("link", "iframe", "object", "img"), tag
        attributes = dict(attributes)
        assert not {"src", "href"} & attributes.keys(), attributes
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("script", "style"):
            self.name = attributes.get("id", f"{tag}{len(self.texts)}")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def handle_data(self, data):
        if self.open[-1:] in (["script"], ["style"]):
            self.texts[self.name] = self.texts.get(self.name, "") + data


def page_holds(folder, reported, pictures):
    """The page has the report's data, the given number of pictures of levels, and no address. Without
    Chart.js there is no page."""
    path = folder / "report.html"
    assert path.exists() == ("page" in FEATURES)
    if not path.exists():
        return
    parser = Well()
    page = path.read_text(encoding="utf-8")
    parser.feed(page)
    parser.close()
    assert parser.open == [], parser.open
    assert json.loads(parser.texts["report"]) == reported
    drawn = json.loads(parser.texts["drawn"])
    expected = pictures if "png" in FEATURES else 0
    assert (sum(map(len, drawn["levels"])) == expected
            and ("portrait" in drawn) <= (expected > 0)), drawn.keys()
    assert all(uri.startswith("data:image/png;base64,") for levels in drawn["levels"]
               for uri in levels.values())
    own = page.replace(parser.texts["chart"], "").replace(parser.texts["drawn"], "")
    assert "<long>" not in own, "a name is interpreted as a tag"
    assert not re.search(r"url\(|@import|https?://|\{\{", own)


# --- against other commands ---

def against_info(reported, folder):
    for m in reported["methods"]:
        info = json.loads(run("info", "--json", folder / f"{m['name']}.ebpo.h5"))
        derived = [l["derived_volume"]
                   for l in json.loads(run("measure", "--json", "--derived",
                                           folder / f"{m['name']}.ebpo.h5"))["levels"]]
        assert m["file_bytes"] == info["bytes"]["file"] and m["head_bytes"] == info["bytes"]["head"]
        assert m["all_planes"] == sum(l["planes"] + l["leaf_planes"] for l in info["levels"])
        solid = abs(info["report"]["volume"])
        for mine, theirs, volume in zip(m["levels"], info["levels"], derived, strict=True):
            assert mine["level"] == theirs["level"]
            for a, b in (("bytes", "stored_bytes"), ("cumulative_bytes",) * 2, ("gray",) * 2,
                         ("leaf",) * 2, ("planes",) * 2, ("leaf_planes",) * 2):
                assert mine[a] == theirs[b], (m["name"], a, mine[a], theirs[b])
            assert mine["envelope_volume"] == volume <= theirs["envelope_volume"] * (1 + 1e-9)
            if reported["model"]["kind"] == "solid" and solid > 0:
                assert math.isclose(mine["excess"], 100 * (volume - solid) / solid, rel_tol=1e-9,
                                    abs_tol=1e-9)
            assert (mine["read_bytes"] >= mine["cumulative_bytes"] - info["bytes"]["head"]
                    and mine["reads"] >= 1)


def unit_numbers(state):
    while True:
        state = (state + 0x9e3779b97f4a7c15) & MASK
        z = ((state ^ state >> 30) * 0xbf58476d1ce4e5b9) & MASK
        z = ((z ^ z >> 27) * 0x94d049bb133111eb) & MASK
        yield ((z ^ z >> 31) >> 11) / 2**53


def uniform_points(model):
    numbers = unit_numbers(SEED)
    axes = [(low, high) for low, high in zip(model["min"], model["max"])] * POINTS
    return [(1 - t) * low + t * high for (low, high), t in zip(axes, numbers)]


def quantile(values, share):
    return sorted(values)[max(math.ceil(share * len(values)), 1) - 1]


def queries(reported, folder):
    numbers = uniform_points(reported["model"])
    text = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in zip(numbers[::3], numbers[1::3],
                                                             numbers[2::3])).encode()
    for m in reported["methods"]:
        file = folder / f"{m['name']}.ebpo.h5"
        for l in m["levels"]:
            if reported["model"]["kind"] == "solid":
                results = run("inside", "--max-level", l["level"], file, data=text).decode()
                assert l["maybe_uniform"] == sum(line.startswith("MAYBE")
                                                 for line in results.splitlines()) / POINTS
                assert 0 <= l["maybe_near"] <= 1
            reported_widths = run("distance", "--json", "--max-level", l["level"], file, data=text).decode()
            widths = [a["hi"] - a["lo"] for a in map(json.loads, reported_widths.splitlines())]
            assert (l["width_median"] == quantile(widths, 0.5)
                    and l["width_p99"] == quantile(widths, 0.99))
            assert math.isclose(l["width_mean"], sum(widths) / POINTS, rel_tol=1e-12)
        for due in m["deadlines"]:
            assert (0 <= due["deadline_exact"] <= 1
                    and due["deadline_took_median"] <= due["deadline_took_p99"] <= due["deadline_took_max"])


def shapes(reported, folder):
    """Certified error bounds hold for the vertices of the envelopes, by exact distances. The limit is a
    lower bound."""
    for m in reported["methods"]:
        file = folder / f"{m['name']}.ebpo.h5"
        farthest = math.inf
        for l in m["levels"]:
            run("extract", "-q", file, folder / "level.ply", "--level", l["level"])
            results = run("distance", "--json", file, folder / "level.ply")
            reach = max([0, *(json.loads(line)["distance"]
                              for line in results.decode().splitlines())])
            slack = 1e-6 * reported["model"]["diagonal"]
            assert (reach <= l["hausdorff_hi"] + slack), (m["name"], l["level"], reach,
                                                          l["hausdorff_hi"])
            assert l["hausdorff_hi"] <= farthest, "farther than the level before"
            farthest = l["hausdorff_hi"]
            assert (0 <= l["hausdorff_lo"] <= l["hausdorff_hi"]
                    and l["distance_mean"] <= l["distance_rms"] * (1 + 1e-12) <= l["hausdorff_hi"] + slack)
            if l["limit_volume"] is not None:
                assert l["limit_volume"] <= l["envelope_volume"] * (1 + 1e-9)
                assert (l["excess_to_limit"] is None
                        or math.isclose(l["excess_to_limit"], l["excess"] / l["limit_excess"],
                                        rel_tol=1e-12))
        (folder / "level.ply").unlink()


def lines_and_budgets(reported):
    """A server sends at least the levels, and at most the file. Round trips are at least those of the first
    level. With less memory, less data stays in memory and more is loaded."""
    for m in reported["methods"]:
        trips = [l["line_trips"] for l in m["levels"]]
        sent = [l["line_bytes"] for l in m["levels"]]
        assert trips[0] >= 1 and sorted(trips) == trips and sorted(sent) == sent, (trips, sent)
        assert all(l["line_bytes"] >= min(l["cumulative_bytes"], m["file_bytes"])
                   and l["line_bytes"] <= m["file_bytes"] for l in m["levels"])
        kept = [l["level_memory_bytes"] for l in m["levels"]]
        assert sorted(kept) == kept and kept[0] > 0, kept
        assert [b["part"] for b in m["budgets"]] == [1, 2, 4, 8, 16]
        whole = m["budgets"][0]
        assert (whole["budget_bytes"] == m["memory_bytes"] and whole["budget_loads"] == 0
                and whole["budget_width_median"] == 0 and whole["budget_level"] is None)
        for b in m["budgets"][1:]:
            if b["budget_distance_ns"] is None:
                assert any("memory budgets" in note for note in m["notes"]), m["notes"]
            elif b["budget_level"] is not None:
                assert b["budget_width_median"] > 0 and b["budget_distance_ns"] > 0


def settings(inputs):
    """Several numbers of planes in one run give one method each, named after the number. Outputs are kept, and replaced."""
    folder = folder_of(inputs, "settings")
    arguments = ("--keep", "--no-pictures", "--max-level", "1", folder_of(inputs, "torus.ply"))
    for options, names, key, values in (
        (("--select", "inherit,offset", "--percent", "10,40"),
         ["inherit", "offset-10%", "offset-40%"], "percent", [None, 10, 40]),
        (("--select", "kmedoids", "--k-root", "8,1%"), ["kmedoids-K8", "kmedoids-K1%"], "k_root",
         [8, None])):
        rows, reported = report(folder, *options, *arguments)
        agree(rows, reported)
        assert [m["name"] for m in reported["methods"]] == names
        assert all(m["build_seconds"] > 0 for m in reported["methods"])
        assert all((folder / f"{name}.ebpo.h5").exists() for name in names)
        for m, v in zip(reported["methods"], values):
            assert v is None or m[key] == v, (m["name"], m.get(key))
    share = reported["methods"][1]["k_root"]
    assert abs(share - reported["model"]["faces"] / 100) < 1e-9, share


def beyond_doubles(inputs):
    """Excess does not depend on scale: it is the same at 1, 1e300 and 1e-250, where volumes exceed the range
    of doubles. Scales are powers of two, so that the cells are the same."""
    tables = []
    text = folder_of(inputs, "torus.ply").read_bytes()
    for scale in (1, 2.0**997, 2.0**-830):
        mesh = folder_of(inputs, "scaled.ply")
        mesh.write_bytes(scaled(text, scale))
        _, reported = report(folder_of(inputs, "scaled"), "--no-pictures", "--max-level", "2", mesh)
        tables.append([[l[k] for k in ("excess", "levels_excess", "limit_excess",
                                       "excess_to_limit")] for l in reported["methods"][0]["levels"]])
    for table in tables[1:]:
        for row, expected in zip(table, tables[0], strict=True):
            for a, b in zip(row, expected):
                assert (a is None) == (b is None) and (a is None or
                                                       math.isclose(a, b, rel_tol=1e-6)), (a, b)


def scaled(ply, factor):
    """Writes a PLY with scaled coordinates, as ASCII doubles."""
    head, body = ply.split(b"end_header\n", 1)
    assert b"binary_little_endian" in head or b"ascii" in head, head
    count = int(re.search(rb"element vertex (\d+)", head).group(1))
    kind = "d" if b"double" in head else "f"
    if b"ascii" in head:
        lines = body.decode().splitlines()
        points = [[float(x) for x in line.split()[:3]] for line in lines[:count]]
        faces = [line.split() for line in lines[count:]]
    else:
        size = struct.calcsize("<3" + kind)
        points = list(struct.iter_unpack("<3" + kind, body[:size * count]))
        faces = [t for t in struct.iter_unpack("<B3i", body[size * count:])]
    made = (f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty double x\nproperty double "
            f"y\nproperty double z\nelement face {len(faces)}\n"
            "property list uchar int vertex_indices\nend_header\n")
    made += "".join("%.17g %.17g %.17g\n" % tuple(x * factor for x in p) for p in points)
    return (made + "".join(" ".join(map(str, f)) + "\n" for f in faces)).encode()


def targets(reported):
    for m in reported["methods"]:
        for n in m["targets"]:
            if "target_bytes" in n:
                assert n["subset_bytes"] <= n["target_bytes"], n
            elif n["subset_hausdorff_lo"] is not None:
                assert (n["subset_hausdorff_lo"] <= max(n["max_error"],
                                                      m["levels"][-1]["hausdorff_hi"]) * (1 + 1e-9)), n


# --- cases ---

def folder_of(inputs, name):
    return pathlib.Path(inputs) / name


def default(inputs):
    folder = folder_of(inputs, "r")
    arguments = ("--select", "inherit,kmedoids,offset,random", "--keep", "--no-pictures", "--targets",
                 "--max-level", "3", folder_of(inputs, "torus.ply"))
    rows, reported = report(folder, *arguments)
    of = agree(rows, reported)
    page_holds(folder, reported, 0)
    against_info(reported, folder)
    queries(reported, folder)
    shapes(reported, folder)
    targets(reported)
    lines_and_budgets(reported)
    assert ([m["name"] for m in reported["methods"]] == ["inherit", "kmedoids", "offset", "random"]
            and all(m["build_seconds"] > 0 for m in reported["methods"]))
    thesis_is_at_least(reported)
    again, _ = report(folder_of(inputs, "again"), *arguments, "--threads", "1")
    steady = [[r for r in all_rows if not of[r["quantity"]]["timed"]] for all_rows in (rows, again)]
    assert (steady[0] == steady[1] and len(steady[0]) > 100), [x for x in zip(*steady)
                                                               if x[0] != x[1]][:3]
    other, _ = report(folder_of(inputs, "other"), *arguments, seed=SEED + 1)
    assert [r for r in other
            if r["quantity"] == "maybe_uniform"] != [r for r in rows
                                                     if r["quantity"] == "maybe_uniform"]


def thesis_is_at_least(reported):
    """Every leaf, plane, face and vertex is sent once, and its cost is counted."""
    for m in reported["methods"]:
        total = m["levels"][-1]["thesis_cumulative_bytes"]
        mesh_size = reported["model"]["faces"] + reported["model"]["vertices"]
        least = sum(l["leaf"] for l in m["levels"]) + 8 * m["all_planes"] + 12 * mesh_size
        assert least <= total, (least, total)
        assert math.isclose(sum(l["thesis_bytes"] for l in m["levels"]), total)


def files(inputs):
    a, b = folder_of(inputs, "a.ebpo.h5"), folder_of(inputs, "b.ebpo.h5")
    run("convert", "-q", "--max-level", "2", folder_of(inputs, "sphere.ply"), a)
    run("convert", "-q", "--max-level", "3", "--profile", "full",
        folder_of(inputs, "sphere.ply"), b)
    rows, reported = report(folder_of(inputs, "files"), "--name", "short", "--name", "<long> & 'odd'",
                        a, b)
    agree(rows, reported)
    page_holds(folder_of(inputs, "files"), reported, 7)
    assert ([len(m["levels"]) for m in reported["methods"]] == [3, 4]
            and reported["methods"][0]["build_seconds"] is None)
    for l in reported["methods"][0]["levels"]:
        assert l["levels_volume"] >= l["envelope_volume"] * (1 - 1e-9)
    _, whole = report(folder_of(inputs, "all"), "--targets", "--no-pictures", b)
    rows, reported = report(folder_of(inputs, "some"), "--targets", "--levels", "1-2", b)
    assert [l["level"] for l in reported["methods"][0]["levels"]] == [1, 2]
    page_holds(folder_of(inputs, "some"), reported, 2)
    # The error bound of the whole file is that of its last level, measured or not.
    ratios = [[n["subset_ratio"] for n in j["methods"][0]["targets"]] for j in (whole, reported)]
    last = whole["methods"][0]["levels"][-1]["hausdorff_hi"]
    assert (ratios[0] == ratios[1] and any(n.get("max_error", last) < last
                                           for n in reported["methods"][0]["targets"])), (ratios, last)


def surface(inputs):
    folder = folder_of(inputs, "surface")
    rows, reported = report(folder, "--keep", "--no-pictures", "--max-level", "2",
                        folder_of(inputs, "open_box.ply"))
    agree(rows, reported)
    page_holds(folder, reported, 0)
    against_info(reported, folder)
    queries(reported, folder)
    measured = json.loads(run("measure", "--json", folder / "inherit.ebpo.h5"))
    model = reported["model"]
    assert model["volume"] is None and model["volume_lo"] < measured["volume"] < model["volume_hi"], model
    assert all(model[k] == measured[k] for k in ("volume_lo", "volume_hi", "winding_integral")), (model, measured)
    for l in reported["methods"][0]["levels"]:
        assert (l["excess"] is None and l["maybe_uniform"] is None and l["inside_ns"] is None
                and l["width_median"] > 0 and l["hausdorff_hi"] >= 0)
    assert "exact_inside_ns" in reported["methods"][0] and reported["methods"][0]["exact_inside_ns"] is None


def single_leaf(inputs):
    folder = folder_of(inputs, "leaf")
    rows, reported = report(folder, "--keep", "--max-level", "0", folder_of(inputs, "tetrahedron.ply"))
    agree(rows, reported)
    page_holds(folder, reported, 1)
    against_info(reported, folder)
    level, = reported["methods"][0]["levels"]
    assert (level["gray"], level["leaf"]) == (0, 1)
    # 4 faces and 4 vertices once; each plane has a separate normal
    assert (level["leaf_planes"] > 0
            and level["thesis_bytes"] == 1 + 12 * 4 + 12 * 4 + 20 * level["leaf_planes"])
    assert abs(level["excess"]) < 10 and level["hausdorff_lo"] < 0.1 * reported["model"]["diagonal"]


def no_volume(inputs):
    flat = folder_of(inputs, "flat.ply")
    flat.write_text("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
                    "y\nproperty float z\nelement face 2\n"
                    "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 "
                    "1 2\n3 0 2 1\n", encoding="ascii")
    rows, reported = report(folder_of(inputs, "flat"), "--max-level", "1", flat)
    agree(rows, reported)
    page_holds(folder_of(inputs, "flat"), reported, 1)
    assert (reported["model"]["volume"] == 0 and all(l["excess"] is None
                                                 for l in reported["methods"][0]["levels"]))


def without_mesh(inputs):
    file = folder_of(inputs, "bare.ebpo.h5")
    run("convert", "-q", "--max-level", "2", "--parts", "-mesh", folder_of(inputs, "torus.ply"),
        file)
    rows, reported = report(folder_of(inputs, "bare"), file)
    agree(rows, reported)
    page_holds(folder_of(inputs, "bare"), reported, 3)
    method, = reported["methods"]
    assert method["exact_distance_ns"] is None and method["notes"]
    for l in method["levels"]:
        assert (l["hausdorff_hi"] is None and l["limit_volume"] is None and l["maybe_near"] is None
                and l["thesis_bytes"] is None)
        assert l["maybe_uniform"] is not None and l["width_median"] > 0 and l["levels_volume"] > 0


def main():
    with tempfile.TemporaryDirectory() as inputs:
        subprocess.run([INPUTS, inputs], check=True)
        for case in (default, settings, beyond_doubles, files, surface, single_leaf, no_volume, without_mesh):
            case(inputs)
            print(f"{case.__name__}: fine")


main()
