"""Commands and their outputs, for tests in which calls fail (faults.py) or programs are killed (killed.py).

In a command, NAME.ply and similar names are inputs that make_inputs makes. URL is the URL of model.ebpo.h5. Names
that begin with OUT are outputs. An output that ends with a slash is a folder, which is replaced atomically. put_old
makes the outputs that exist before a run.
"""
import dataclasses
import os
import shutil
import subprocess

OLD = b"what was there before\n"
POINTS = "0 0 0\n0.3 0.2 0.1\n2 2 2\n-0.5 0.1 0.9\n1 0 0\n"
RAYS = "0 0 -5 0 0 1\n1 0 -5 0 0.1 1\n-5 0.1 0 1 0 0\n"
BOXES = "0 0 0 1 1 1\n-2 -2 -2 0 0 0\n"
HAND = "3 0 0\n2 0 0\n1 0 0\n0 0 0\n0 1 0\n"
SCENE = """{"ebpo_scene": "1.0", "models": {"m": {"file": "model.ebpo.h5"}},
"instances": [{"name": "a", "model": "m"},
{"name": "b", "model": "m", "pose": {"translation": [0.5, 0, 0]}}]}"""
MOVES = """{"ebpo_scene": "1.0", "models": {"m": {"file": "model.ebpo.h5"}},
"routes": {"r": {"keys": [{"time": 0, "pose": {"translation": [4, 0, 0]}},
{"time": 1, "pose": {"translation": [0.5, 0, 0]}}]}}, "instances": [{"name": "a", "model": "m"},
{"name": "b", "model": "m", "route": "r"}]}"""
OBJ = """g one
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
g two
v 5 0 0
v 6 0 0
v 5 1 0
v 5 0 1
f 5 7 6
f 5 6 8
f 6 7 8
f 7 5 8
"""
PLY = """ply
format ascii 1.0
comment TextureFile image.png
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 2 0 3
"""
TEXTS = {"points.txt": POINTS, "rays.txt": RAYS, "boxes.txt": BOXES, "hand.txt": HAND,
         "a.scene.json": SCENE, "moves.scene.json": MOVES, "groups.obj": OBJ, "image.ply": PLY,
         "image.png": "the bytes of an image"}


@dataclasses.dataclass(frozen=True)
class Command:
    text: str
    outputs: tuple = ()
    need: str = ""  # a feature that the build must have
    times_printed: bool = False  # the printed text differs from run to run
    times_written: bool = False  # outputs differ from run to run; only their sizes are compared
    fresh: bool = False  # outputs must not exist before, nor their folders
    replaces: bool = False  # exception: this folder, a report, may exist
    seconds: bool = False  # the command takes seconds: only a twentieth of the calls fails


COMMANDS = {
    "convert": Command("convert -q --threads 1 model.ply OUT", ("OUT",)),
    "convert bounded": Command("convert -q --threads 2 --memory 128MiB model.ply OUT", ("OUT",)),
    "convert images": Command("convert -q --threads 1 --embed-textures image.ply OUT", ("OUT",)),
    "convert components": Command("convert -q --threads 1 --split-components groups.obj OUT",
                                  ("OUT/",)),
    "convert groups": Command("convert -q --threads 1 --split-groups groups.obj OUT", ("OUT/",)),
    "check": Command("check -q --threads 1 --crossings -o OUT.ply model.ply", ("OUT.ply",)),
    "check places": Command("check -q --threads 1 --findings OUT.ply model.ply", ("OUT.ply",)),
    "verify": Command("verify -q model.ebpo.h5"),
    "info": Command("info model.ebpo.h5"),
    "levels": Command("levels --threads 1 model.ebpo.h5", times_printed=True),
    "view": Command("view -o OUT.ply model.ebpo.h5", ("OUT.ply",), times_printed=True),
    "measure": Command("measure --threads 1 model.ebpo.h5"),
    "subset": Command("subset --levels 0-3 model.ebpo.h5 OUT", ("OUT",), times_printed=True),
    "repack": Command("repack model.ebpo.h5 OUT", ("OUT",), times_printed=True),
    "recover": Command("recover -q --threads 1 -o OUT damaged.ebpo.h5", ("OUT",)),
    "fetch": Command("fetch -q URL OUT", ("OUT",), need="http"),
    "export xdmf": Command("export -q --levels 0-2 model.ebpo.h5 OUT.xdmf",
                           ("OUT.xdmf", "OUT.xdmf.h5")),
    "export vtkhdf": Command("export -q --levels 0-2 model.ebpo.h5 OUT.vtkhdf", ("OUT.vtkhdf",)),
    "export gltf": Command("export -q --levels 0-2 model.ebpo.h5 OUT.gltf",
                           ("OUT.gltf", "OUT.bin")),
    "export glb": Command("export -q --levels 0-2 model.ebpo.h5 OUT.glb", ("OUT.glb",)),
    "export obj": Command("export -q --levels 0-2 model.ebpo.h5 OUT.obj", ("OUT.obj",),
                          need="assimp"),
    "export stl": Command("export -q --level 2 model.ebpo.h5 OUT.stl", ("OUT.stl",),
                          need="assimp"),
    "extract": Command("extract -q --mesh model.ebpo.h5 OUT.ply", ("OUT.ply",)),
    "extract images": Command("extract -q --textures OUT image.ebpo.h5", ("OUT/image.png",),
                              fresh=True),
    "render": Command("render --size 32x32 model.ebpo.h5 OUT.png", ("OUT.png",), need="png"),
    "map grid": Command("map -q --threads 1 --grid 4,4,4 -o OUT.vtkhdf model.ebpo.h5",
                        ("OUT.vtkhdf",)),
    "map nrrd": Command("map -q --threads 1 --grid 4,4,4 -o OUT.nrrd model.ebpo.h5",
                        ("OUT.nrrd",)),
    "map plane": Command("map -q --threads 1 --plane z=50% --size 8x8 -o OUT.h5 model.ebpo.h5",
                         ("OUT.h5",)),
    "map picture": Command("map -q --threads 1 --plane z=50% --size 8x8 --picture OUT.png "
                           "model.ebpo.h5", ("OUT.png",), need="png"),
    "map scan": Command("map -q --threads 1 --from image.ply -o OUT.ply model.ebpo.h5",
                        ("OUT.ply",)),
    "inside": Command("inside --threads 1 model.ebpo.h5 points.txt"),
    "inside bounded": Command("inside --threads 1 --memory 1MiB parts.ebpo.h5 points.txt"),
    "distance": Command("distance --threads 1 model.ebpo.h5 points.txt"),
    "ray": Command("ray --all --threads 1 model.ebpo.h5 rays.txt"),
    "box": Command("box --threads 1 model.ebpo.h5 boxes.txt"),
    "haptic": Command("haptic --path hand.txt model.ebpo.h5", times_printed=True),
    "bench": Command("bench --count 5 --save-results OUT.a model.ebpo.h5", ("OUT.a",),
                     times_printed=True),
    "bench points": Command("bench --count 5 --save-points OUT.p model.ebpo.h5", ("OUT.p",),
                            times_printed=True),
    "collide": Command("collide --pose-b '0.5 0 0' -o OUT.h5 model.ebpo.h5 model.ebpo.h5",
                       ("OUT.h5",)),
    "collide ply": Command("collide --pose-b '0.5 0 0' -o OUT.ply model.ebpo.h5 model.ebpo.h5",
                           ("OUT.ply",)),
    "boolean": Command("boolean 'A - B' model.ebpo.h5 model.ebpo.h5 --pose 'B 0.5 0 0' --inside "
                       "points.txt"),
    "boolean cells": Command("boolean 'A - B' image.ebpo.h5 image.ebpo.h5 --pose 'B 0.5 0 0' "
                             "--cells --max-level 3 -o OUT.ebpo.h5", ("OUT.ebpo.h5",)),
    "boolean model": Command("boolean 'A - B' image.ebpo.h5 image.ebpo.h5 --pose 'B 0.5 0 0' "
                             "-o OUT.ebpo.h5", ("OUT.ebpo.h5",)),
    "boolean ply": Command("boolean 'A - B' image.ebpo.h5 image.ebpo.h5 --pose 'B 0.5 0 0' "
                           "--memory 128M --volume -o OUT.ply", ("OUT.ply",)),
    "scene check": Command("scene check a.scene.json"),
    "scene pairs": Command("scene pairs a.scene.json"),
    "scene plan": Command("scene plan a.scene.json"),
    "scene approach": Command("scene approach --threads 1 --tolerance 0.1 moves.scene.json"),
    "scene pack": Command("scene pack -q --threads 1 -o OUT a.scene.json", ("OUT/",)),
    "scene report": Command("scene report -q -o OUT.h5 a.scene.json", ("OUT.h5",),
                            times_written=True),
    "scene page": Command("scene report -q -o OUT.html a.scene.json", ("OUT.html",),
                          need="png", times_written=True, seconds=True),
    "scene picture": Command("scene report -q -o OUT.png a.scene.json", ("OUT.png",), need="png",
                             seconds=True),
    "report": Command("report -q --points 20 --no-pictures --leaf-faces 64 --max-level 1 -o OUT "
                      "image.ply", ("OUT/",), times_printed=True, times_written=True,
                      replaces=True, seconds=True),
}


def write(folder, name, content):
    with open(os.path.join(folder, name), "wb") as f:
        f.write(content if isinstance(content, bytes) else content.encode("ascii"))


def read(path):
    """Return the contents of a file, or of a folder's files by name. None: it does not exist."""
    try:
        if os.path.isdir(path):
            return {os.path.relpath(os.path.join(folder, name), path):
                    read(os.path.join(folder, name))
                    for folder, _, names in os.walk(path) for name in names}
        with open(path, "rb") as f:
            return f.read()
    except FileNotFoundError:
        return None


def old(command, name):
    """Return the contents of an output before the run."""
    if command.replaces:
        return {"report.json": OLD}
    return None if command.fresh or name.endswith("/") else OLD


def put_old(command, folder):
    for name in command.outputs:
        path = os.path.join(folder, name)
        if name.endswith("/") or command.fresh:
            shutil.rmtree(os.path.join(folder, name.partition("/")[0]), ignore_errors=True)
        if command.replaces:
            os.mkdir(path)
            write(path, "report.json", OLD)
        elif old(command, name) is not None:
            write(folder, name, OLD)


def is_new(command, name, content, right):
    """Return True when an output is complete and correct. right: its contents after a run without faults."""
    if not command.times_written or content is None:
        return content == right
    if name.endswith("/"):
        return (content.keys() == right.keys() and OLD not in content.values() and
                all(c.rstrip()[-1:] == right[n].rstrip()[-1:] for n, c in content.items()
                    if not n.endswith(".csv")))
    return content != OLD and abs(len(content) - len(right)) <= 64 # the digits of seconds differ


def damaged(tool, folder, content):
    """Write damaged.ebpo.h5, with a damaged frame in a chunk that `recover` can compute again."""
    at = content.find(b"\x28\xb5\x2f\xfd")
    while at >= 0:
        changed = bytearray(content)
        changed[at + 9] ^= 0x55
        write(folder, "damaged.ebpo.h5", bytes(changed))
        path = os.path.join(folder, "damaged.ebpo.h5")
        if (subprocess.run([tool, "verify", "-q", path], capture_output=True).returncode == 1 and
                subprocess.run([tool, "recover", "-q", "-o", path + ".new", path],
                               capture_output=True).returncode == 0):
            os.unlink(path + ".new")
            return
        at = content.find(b"\x28\xb5\x2f\xfd", at + 4)
    raise SystemExit("no chunk could be damaged so that it can be repaired")


def make_inputs(tool, generate, folder, faces, leaf_faces="32"):
    """Make the inputs. Return the contents of model.ebpo.h5."""
    def path(name):
        return os.path.join(folder, name)

    os.makedirs(folder)
    for name, text in TEXTS.items():
        write(folder, name, text)
    subprocess.run([generate, "--base", "torus", "--faces", str(faces), path("model.ply")],
                   check=True, stdout=subprocess.DEVNULL)
    for name, source, options in (
            ("model", "model", ["--leaf-faces", leaf_faces]),
            ("parts", "model", ["--leaf-faces", leaf_faces, "--subtree-faces", "100"]),
            ("image", "image", ["--embed-textures"])):
        subprocess.run([tool, "convert", "-q", *options, path(source + ".ply"),
                        path(name + ".ebpo.h5")], check=True)
    content = read(path("model.ebpo.h5"))
    damaged(tool, folder, content)
    return content
