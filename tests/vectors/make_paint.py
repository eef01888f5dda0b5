#!/usr/bin/env python3
"""Makes the files of format-spec/vectors/paint by the small writer: make_paint.py FOLDER

Those that pass belong to vectors/passed/05_two_levels.ebpo.h5, a tetrahedron with maps: MODEL.
"""
import copy
import json
import pathlib
import sys

from paint_writer import Array, I64, write

MODEL = "538d48a6ac529f6753455a7f5b21a5447fe9a0161355102d0fbbbcb639db8297"


def root(**counts):
    return {"format": "EBP-Octree paint 1", "format_version_major": I64(1), "format_version_minor": I64(0),
            "generator": "make_paint.py", "model_sha256": MODEL, "face_numbers": "source",
            "layer_count": 0, "note_count": 0, "stroke_count": 0, "point_count": 0, **counts}


def layer(**other):
    return {"attributes": {"title": "", "author": "", "date": "", "description": "", "colour": 0xd62728ff,
                           "opacity": 255, "visible": 1, **other}}


def note(**other):
    return {"attributes": {"title": "", "author": "", "date": "", "body": "", "layer": 0, "face": 0,
                           "weights": [0.0, 0.0], "place": [0.0, 0.0, 0.0], **other}}


def one_stroke():
    """A stroke of two points in one layer."""
    return {"attributes": root(layer_count=1, stroke_count=1, point_count=2),
            "groups": {"layers": {"groups": {"0000": layer(title="Cracks")}},
                       "strokes": {"arrays": {"layer": Array("u4", [0]), "kind": Array("u4", [0]),
                                              "colour": Array("u1", [[214, 39, 40, 255]]), "radius": Array("f8", [0.25]),
                                              "time": Array("u8", [0]), "points": Array("u4", [2])}},
                       "points": {"arrays": {"face": Array("u4", [0, 0]), "weights": Array("u4", [[0, 2 ** 29], [2 ** 30, 0]]),
                                             "place": Array("f8", [[0.0, 0.5, 0.0], [1.0, 0.0, 0.0]]),
                                             "size": Array("u2", [2 ** 15, 1]), "pressure": Array("u2", [65535, 0]),
                                             "time": Array("u4", [0, 20])}}}}


def with_note():
    """A note in two lines, an erasing stroke, two layers that take turns, one of them hidden."""
    f = one_stroke()
    f["attributes"].update(layer_count=2, note_count=1, stroke_count=3, point_count=4, model_name="two_levels.ebpo.h5", unit="mm")
    f["groups"]["layers"]["groups"]["0001"] = layer(title="Retuschen \u2014 \u4fee\u5fa9", author="A. B.", date="2026-11-26", opacity=128,
                                                    visible=0, description="one\u2028two", colour=0)
    f["groups"]["notes"] = {"groups": {"0000": note(title="Here", body="First line\u2028second line", layer=1, face=2,
                                                    weights=[5.0, 2.0 ** 30 - 5], place=[0.25, 0.0, -0.0], date="2026-11-26T21:43:05Z")}}
    f["groups"]["strokes"]["arrays"] = {
        "layer": Array("u4", [1, 0, 1]), "kind": Array("u4", [0, 1, 0]),
        "colour": Array("u1", [[0, 0, 0, 0], [0, 0, 0, 0], [1, 2, 3, 4]]), "radius": Array("f8", [2.0 ** -200, 1e-3, 2.0 ** 200]),
        "time": Array("u8", [0, 2 ** 53, 1795729385000]), "points": Array("u4", [1, 2, 1])}
    f["groups"]["points"]["arrays"] = {
        "face": Array("u4", [3, 2 ** 32 - 2, 0, 1]), "weights": Array("u4", [[1, 2], [0, 0], [2 ** 29, 2 ** 29], [0, 0]]),
        "place": Array("f8", [[0.0, 0.1, 0.2], [-2.0 ** 200, 5e-324, 2.0 ** 200], [1.0, 1.0, 1.0], [0.0, -0.0, 0.0]]),
        "size": Array("u2", [1, 2, 3, 2 ** 15]), "pressure": Array("u2", [0, 1, 2, 3]), "time": Array("u4", [0, 2 ** 32 - 1, 1, 0])}
    return f


def with_others():
    """Attributes, groups and arrays of other names, which do not matter; a later minor version."""
    f = one_stroke()
    f["attributes"].update({"format_version_minor": I64(7), "x-example.org-mood": "good"})
    f["groups"]["x-example.org"] = {"attributes": {"depth": [1.5, 2.5]}}
    f["groups"]["points"]["arrays"]["x-tilt"] = Array("u2", [1, 2], filter=1)
    f["groups"]["strokes"]["arrays"]["x-name"] = Array("u4", [7])
    return f


def most_labels():
    """As many layers as there may be, and no strokes."""
    return {"attributes": root(layer_count=1024, face_numbers="file"),
            "groups": {"layers": {"groups": {f"{i:04d}": layer(title=str(i)) for i in range(1024)}}}}


PASSED = {"01_empty": lambda: {"attributes": root()}, "02_one_stroke": one_stroke, "03_layers_and_notes": with_note,
          "04_names_of_others": with_others, "05_most_layers": most_labels}


def changed(make, change):
    f = copy.deepcopy(make())
    change(f)
    return f


def set_root(**values):
    return lambda f: f["attributes"].update(values)


def set_array(group, name, array):
    return lambda f: f["groups"][group]["arrays"].update({name: array})


def without(*path):
    def change(f):
        for name in path[:-1]:
            f = f[name]
        del f[path[-1]]
    return change


def set_in(value, *path):
    def change(f):
        for name in path[:-1]:
            f = f[name]
        f[path[-1]] = value
    return change


LAYER = ("groups", "layers", "groups", "0000", "attributes")
NOTE = ("groups", "notes", "groups", "0000", "attributes")
NAN, INF = float("nan"), float("inf")
# name: (file, what is changed)
FAILED = {
    "format_other": (one_stroke, set_root(format="EBP-Octree in HDF5")),
    "format_missing": (one_stroke, without("attributes", "format")),
    "version_later": (one_stroke, set_root(format_version_major=I64(2))),
    "version_unsigned": (one_stroke, set_root(format_version_major=1)),
    "version_minor_negative": (one_stroke, set_root(format_version_minor=I64(-1))),
    "generator_missing": (one_stroke, without("attributes", "generator")),
    "generator_long": (one_stroke, set_root(generator="g" * 64)),
    "model_sha256_upper": (one_stroke, set_root(model_sha256="A" * 64)),
    "model_sha256_short": (one_stroke, set_root(model_sha256="a" * 63)),
    "model_name_long": (one_stroke, set_root(model_name="n" * 256)),
    "unit_with_newline": (one_stroke, set_root(unit="m\nm")),
    "face_numbers_other": (one_stroke, set_root(face_numbers="faces")),
    "layers_too_many": (most_labels, set_root(layer_count=1025)),
    "layer_count_signed": (one_stroke, set_root(layer_count=I64(1))),
    "layer_missing": (one_stroke, set_root(layer_count=2)),
    "layer_title_missing": (one_stroke, without(*LAYER, "title")),
    "layer_title_long": (one_stroke, set_in("t" * 256, *LAYER, "title")),
    "layer_title_not_text": (one_stroke, set_in(7, *LAYER, "title")),
    "layer_title_control": (one_stroke, set_in("a\x85b", *LAYER, "title")),
    "layer_opacity": (one_stroke, set_in(256, *LAYER, "opacity")),
    "layer_visible": (one_stroke, set_in(2, *LAYER, "visible")),
    "layer_colour": (one_stroke, set_in(2 ** 32, *LAYER, "colour")),
    "note_layer": (with_note, set_in(2, *NOTE, "layer")),
    "note_face": (with_note, set_in(2 ** 32 - 1, *NOTE, "face")),
    "note_weights_broken": (with_note, set_in([0.5, 0.0], *NOTE, "weights")),
    "note_weights_sum": (with_note, set_in([2.0 ** 30, 1.0], *NOTE, "weights")),
    "note_weights_nan": (with_note, set_in([NAN, 1.0], *NOTE, "weights")),
    "note_place_of_two": (with_note, set_in([0.0, 0.0], *NOTE, "place")),
    "note_place_infinite": (with_note, set_in([0.0, INF, 0.0], *NOTE, "place")),
    "note_missing": (with_note, set_root(note_count=2)),
    "notes_without_group": (one_stroke, set_root(note_count=1)),
    "strokes_too_many": (one_stroke, set_root(stroke_count=2 ** 20 + 1)),
    "strokes_fewer_rows": (one_stroke, set_root(stroke_count=2)),
    "stroke_array_missing": (one_stroke, without("groups", "strokes", "arrays", "kind")),
    "stroke_layer": (one_stroke, set_array("strokes", "layer", Array("u4", [1]))),
    "stroke_kind": (one_stroke, set_array("strokes", "kind", Array("u4", [2]))),
    "stroke_erases_in_colour": (one_stroke, set_array("strokes", "kind", Array("u4", [1]))),
    "stroke_radius_0": (one_stroke, set_array("strokes", "radius", Array("f8", [0.0]))),
    "stroke_radius_nan": (one_stroke, set_array("strokes", "radius", Array("f8", [NAN]))),
    "stroke_radius_large": (one_stroke, set_array("strokes", "radius", Array("f8", [2.0 ** 201]))),
    "stroke_time": (one_stroke, set_array("strokes", "time", Array("u8", [2 ** 53 + 1]))),
    "stroke_points_0": (with_note, set_array("strokes", "points", Array("u4", [0, 2, 2]))),
    "stroke_points_sum": (one_stroke, set_array("strokes", "points", Array("u4", [1]))),
    "stroke_points_wrap": (with_note, set_array("strokes", "points", Array("u4", [2 ** 32 - 1, 4, 1]))),
    "stroke_colour_of_three": (one_stroke, set_array("strokes", "colour", Array("u1", [[1, 2]]))),
    "points_too_many": (one_stroke, set_root(point_count=2 ** 24 + 1)),
    "points_without_strokes": (one_stroke, set_root(stroke_count=0)),
    "point_face": (one_stroke, set_array("points", "face", Array("u4", [0, 2 ** 32 - 1]))),
    "point_face_signed": (one_stroke, set_array("points", "face", Array("u4", [0, 0], signed=True))),
    "point_face_u8": (one_stroke, set_array("points", "face", Array("u8", [0, 0]))),
    "point_weights": (one_stroke, set_array("points", "weights", Array("u4", [[0, 0], [2 ** 30, 1]]))),
    "point_weights_wrap": (one_stroke, set_array("points", "weights", Array("u4", [[0, 0], [2 ** 32 - 1, 1]]))),
    "point_place_nan": (one_stroke, set_array("points", "place", Array("f8", [[0.0, NAN, 0.0], [0.0, 0.0, 0.0]]))),
    "point_place_far": (one_stroke, set_array("points", "place", Array("f8", [[0.0, 2.0 ** 201, 0.0], [0.0, 0.0, 0.0]]))),
    "point_size_0": (one_stroke, set_array("points", "size", Array("u2", [0, 1]))),
    "point_size_large": (one_stroke, set_array("points", "size", Array("u2", [2 ** 15 + 1, 1]))),
    "chunk_sum": (one_stroke, set_array("points", "face", Array("u4", [0, 0], sum=1))),
    "chunk_beyond_end": (one_stroke, set_array("points", "face", Array("u4", [0, 0], move=10 ** 6))),
    "chunk_mask": (one_stroke, set_array("points", "face", Array("u4", [0, 0], mask=1))),
    "chunk_deflate": (one_stroke, set_array("points", "face", Array("u4", [0, 0], filter=1))),
}


def expected(f):
    """What is in a file that passes, in the words of read_paint.py."""
    a, g = f["attributes"], f.get("groups", {})

    def labels(name):
        return [part["attributes"] for part in g.get(name, {}).get("groups", {}).values()]
    layers = [{**one, "colour": f"#{one['colour']:08x}", "visible": bool(one["visible"])} for one in labels("layers")]
    notes = [{**one, "weights": [int(w) for w in one["weights"]]} for one in labels("notes")]
    strokes, at = [], 0
    if a["stroke_count"]:
        s = {name: part.rows for name, part in g["strokes"]["arrays"].items()}
        p = {name: part.rows for name, part in g["points"]["arrays"].items()}
        for i, count in enumerate(s["points"]):
            names = ("face", "weights", "place", "size", "pressure", "time")
            points = [{name: p[name][k] for name in names} for k in range(at, at + count)]
            strokes.append({"layer": s["layer"][i], "kind": ["paints", "erases"][s["kind"][i]], "radius": s["radius"][i],
                            "colour": "#" + "".join(f"{v:02x}" for v in s["colour"][i]), "time": s["time"][i], "points": points})
            at += count
    root_part = {name: a.get(name, "") for name in ("generator", "model_sha256", "model_name", "unit", "face_numbers")}
    return {**root_part, "layers": layers, "notes": notes, "strokes": strokes}


def damage(path, make, where):
    """A byte of a header is changed, or the end is cut off."""
    write(path, make())
    data = bytearray(path.read_bytes())
    if where is None:
        del data[-1]
    else:
        data[data.rindex(where) + 1] ^= 1
    path.write_bytes(data)


def main(folder):
    for part in ("passed", "failed"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    for name, make in PASSED.items():
        f = make()
        write(folder / "passed" / f"{name}.paint.h5", f)
        text = json.dumps(expected(f), indent=1, ensure_ascii=False)
        (folder / "passed" / f"{name}.json").write_text(text + "\n")
    for name, (make, change) in FAILED.items():
        write(folder / "failed" / f"{name}.paint.h5", changed(make, change))
    damage(folder / "failed" / "header_sum.paint.h5", one_stroke, b"Cracks")
    damage(folder / "failed" / "cut_short.paint.h5", one_stroke, None)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
