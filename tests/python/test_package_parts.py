#!/usr/bin/env python3
"""Tests parts of files as arrays, several models, conversion, other packages; docstrings and guide."""
import ast
import doctest
import errno
import gc
import importlib
import json
import pathlib
import re
import subprocess
import sys
import time
import types

from package_support import COMMAND, EXTRAS, Case, model, np, points, run

import ebpo

PACKAGE = pathlib.Path(ebpo.__file__).parent
GUIDE = pathlib.Path(sys.argv[4]) / "docs/guide/python.md"
MODULES = sorted(path.stem for path in PACKAGE.glob("*.py") if path.stem not in ("__init__", "_declared"))


class Parts(Case):
    def test_volumes_follow_the_rule(self):
        """A box in a box, where the winding number is 2, and two boxes that coincide."""
        def measured(boxes, rule):
            vertices = [[(low, high)[i >> k & 1] for k in range(3)] for low, high in boxes for i in range(8)]
            sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
            faces = [[8 * n + a, 8 * n + b, 8 * n + c] for n in range(len(boxes)) for s in sides
                     for a, b, c in (s[:3], (s[0], *s[2:]))]
            return ebpo.convert((np.array(vertices, float), np.array(faces)), "boxes.ebpo.h5", rule=rule, overwrite=True).measure()
        for rule, volume in ("nonzero", 1000), ("positive", 1000), ("evenodd", 936):
            mass = measured([(0, 10), (3, 7)], rule)
            self.assertAlmostEqual(mass.volume, volume)
            self.assertAlmostEqual(mass.integral, 1064)
            self.assertEqual(mass.volume_bounds, (mass.volume, mass.volume))
        mass = measured([(0, 1), (0, 1)], "nonzero")
        self.assertTrue(np.isnan(mass.volume) and mass.volume_bounds[0] <= 1 <= mass.volume_bounds[1])
        self.assertAlmostEqual(mass.integral, 2)

    def test_info(self):
        printed = json.loads(subprocess.run([COMMAND, "info", "--json", "scan.ebpo.h5"], check=True,
                                         capture_output=True).stdout) if model("scan") else {}
        info = model("scan").info
        self.assertIn(str(info.face_count), json.dumps(printed))
        self.assertIn(info.content_sha256, json.dumps(printed))
        self.assertTrue(info.solid and info.rule is ebpo.Rule.NONZERO)
        self.assertEqual(info.parts, {"planes", "mesh", "maps"})
        self.assertEqual(len(info.levels), info.level_count)
        self.assertEqual(info.levels[0]["gray_count"], 1)
        with self.assertRaises(AttributeError):
            info.nothing

    def test_mesh_is_the_source(self):
        made = ebpo.convert("scan.ply", "again.ebpo.h5")
        source = made.mesh(order="source")
        extracted = pathlib.Path("back.ply")
        subprocess.run([COMMAND, "extract", "-q", "again.ebpo.h5", extracted, "--mesh"], check=True)
        body = extracted.read_bytes().partition(b"end_header\n")[2]
        self.assertTrue(body.startswith(source.vertices.tobytes()))
        faces = np.frombuffer(body[source.vertices.nbytes:], np.dtype([("n", "u1"), ("v", "<i4", 3)]))
        np.testing.assert_array_equal(faces["v"], source.faces)
        mesh, maps = made.mesh(), made.maps()
        np.testing.assert_array_equal(mesh.vertices, source.vertices[maps.vertex])
        del made
        gc.collect()
        self.assertFalse(mesh.vertices.flags.writeable)
        np.testing.assert_array_equal(maps.vertex[mesh.faces], source.faces[maps.face])

    def test_attributes(self):
        m = model("coloured")
        attributes = m.attributes
        self.assertIn("vertex:red", attributes)
        text = pathlib.Path("coloured.ply").read_bytes()
        for name in attributes:
            facts, values = attributes.facts(name), attributes[name]
            self.assertEqual(len(values), facts["rows"])
            if isinstance(values, np.ndarray):
                self.assertEqual(values.dtype, facts["dtype"])
            if facts["range"] and facts["rows"] and not facts["list"] and len(facts["names"]) == 1:
                self.assertEqual((np.nanmin(values), np.nanmax(values)), facts["range"])
            self.assertIn(name.partition(":")[2].encode(), text)
        np.testing.assert_array_equal(attributes["red"], attributes["vertex:red"])
        with self.assertRaises(KeyError):
            attributes["nothing"]
        mesh, colours = m.mesh(), attributes["vertex:red"].astype(float)
        hit = m.distance(mesh.vertices)
        sampled = m.sample("red", hit.point, hit.face)
        self.assertEqual(sampled.shape, (len(mesh.vertices), 1))
        used = np.unique(mesh.faces)
        _, unique = np.unique(mesh.vertices[used], axis=0, return_index=True)
        if len(unique) == len(used):
            np.testing.assert_array_equal(sampled[used, 0], colours[used])
        self.assertTrue(np.isnan(m.sample("red", [[0, 0, 0.]], [-1])).all())
        with self.assertRaises(ebpo.AbsentError):
            m.sample("nothing", hit.point, hit.face)

    def test_surface(self):
        m = ebpo.open(pathlib.Path(__file__).parents[2] / "format-spec/vectors/passed/70_surface_with_subtrees.ebpo.h5")
        eye = m.info.box_origin + 1.5 * m.info.box_size
        whole, coarse = m.surface(), m.surface(level=0)
        near, far = (m.surface(eye=eye, pixels=pixels, faces=True) for pixels in (0.01, 100))
        self.assertEqual((coarse.patches, far.patches, near.patches), (1, 1, 0))
        self.assertEqual(near.model_faces, m.info.face_count)
        self.assertTrue(0 < whole.error < coarse.error and 0 < far.pixels <= 100 and near.pixels == 0)
        self.assertTrue(np.isnan(whole.pixels) and whole.colours.shape == whole.vertices.shape)
        for s in (whole, coarse, near, far):  # closed: each directed edge has an opposite one
            _, same = np.unique(s.vertices, axis=0, return_inverse=True)
            a, b = same[s.faces].ravel(), same[np.roll(s.faces, -1, axis=1)].ravel()
            np.testing.assert_array_equal(np.sort(a * len(same) + b), np.sort(b * len(same) + a))
            np.testing.assert_allclose(np.linalg.norm(s.normals, axis=1), 1, atol=1e-6)
        with self.assertRaises(ebpo.AbsentError):
            model("scan").surface()
        with self.assertRaises(ValueError):
            m.surface(pixels=1)

    def test_levels(self):
        m = model("scan")
        for number in range(4):
            level = m.level(number)
            a, b, c = (level.vertices[level.faces[:, i]] for i in range(3))
            six = np.bincount(level.node, np.einsum("ij,ij->i", a, np.cross(b, c)), len(level.octcode))
            np.testing.assert_allclose(six / 6, level.volume, rtol=1e-9, atol=1e-12)
            self.assertEqual((level.type == ebpo.NodeType.GRAY).sum(), m.info.levels[number]["gray_count"])
        with self.assertRaises(ebpo.ArgumentError):
            m.level(99)
        self.assertIsNone(m.level(0).colour)
        mesh = m.mesh()
        rows = np.zeros(len(mesh.vertices), [("xyz", "<f4", 3), ("rgb", "u1", 3)])
        rows["xyz"], rows["rgb"] = mesh.vertices, (255, 0, 10)
        faces = np.zeros(len(mesh.faces), [("n", "u1"), ("v", "<u4", 3)])
        faces["n"], faces["v"] = 3, mesh.faces
        channels = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
        pathlib.Path("red.ply").write_bytes(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
            f"property float x\nproperty float y\nproperty float z\n{channels}element face {len(faces)}\n"
            "property list uchar uint vertex_indices\nend_header\n".encode() + rows.tobytes() + faces.tobytes())
        self.assertEqual(set(map(tuple, model("red").level(2).colour.tolist())), {(255, 0, 10)})

    def test_subtrees(self):
        m = model("scan")
        whole, mesh, maps = m.subtree(), m.mesh(), m.maps()
        np.testing.assert_array_equal(whole.vertices[whole.faces], mesh.vertices[mesh.faces])
        np.testing.assert_array_equal(whole.source, maps.face)
        gray = np.flatnonzero((whole.type == ebpo.NodeType.GRAY) & (whole.children != ebpo.Subtree.NO_CHILDREN))
        for node in gray[:50]:
            first = whole.children[node]
            np.testing.assert_array_equal(whole.octcode[first:first + 8], whole.octcode[node] * 8 + np.arange(8))
        part = m.subtree(m.octcode([.9, .1, .1], 3))
        np.testing.assert_array_equal(part.vertices[part.faces], (mesh.vertices[mesh.faces])[part.file_faces])
        leaf = int(np.flatnonzero(part.type == ebpo.NodeType.LEAF)[0])
        self.assertTrue(len(part.faces_of(leaf)) > 0)
        n, d = ebpo.half_spaces(whole.planes[:100])
        self.assertTrue((abs(n).sum(axis=1) == 511).all())
        kept, planes = part.octcode.copy(), whole.planes[:5].copy()
        arrays = part.octcode, whole.planes
        del part, whole, m
        gc.collect()
        np.testing.assert_array_equal(arrays[0], kept)
        np.testing.assert_array_equal(arrays[1][:5], planes)
        shallow = model("scan").subtree(levels=1)
        self.assertIsNone(shallow.faces)
        self.assertEqual(shallow.node_count, 9)
        with self.assertRaises(ebpo.ArgumentError):
            model("scan").subtree(5)

    def test_converting(self):
        for name, options, switches in (("scan", {}, []), ("scan", {"parts": "-maps"}, ["--parts", "-maps"]),
                                        ("coloured", {"parts": ["-mesh"]}, ["--parts", "-mesh"]),
                                        ("coloured", {"parts": "mesh,attributes,colours,leaf-planes"},
                                         ["--parts", "mesh,attributes,colours,leaf-planes"]),
                                        ("open_box", {"fill_holes": True}, ["--fill-holes"]),
                                        ("coloured", {"unit": "mm", "codec": "deflate"},
                                         ["--unit", "mm", "--codec", "deflate"]),
                                        ("coloured", {"parts": "-maps,+surface"}, ["--parts=-maps,+surface"]),
                                        ("coloured", {"parts": ["-mesh"]}, ["--parts=-mesh"])):
            subprocess.run([COMMAND, "convert", "-q", *switches, f"{name}.ply", "by_command.ebpo.h5"], check=True)
            ebpo.convert(f"{name}.ply", "by_python.ebpo.h5", overwrite=True, **options)
            self.assertEqual(pathlib.Path("by_python.ebpo.h5").read_bytes(),
                             pathlib.Path("by_command.ebpo.h5").read_bytes(), name)
        mesh = model("scan").mesh(order="source")
        self.assertEqual(ebpo.convert(mesh, "dated.ebpo.h5", date="2026-03-01").info.face_count, len(mesh.faces))
        for wrong in ("-mesh,+surface", "mesh,+surface", "envelopes,maps", "-none", ""):
            with self.assertRaisesRegex(ValueError, "^parts: "):
                ebpo.convert(mesh, "never.ebpo.h5", parts=wrong)
        with self.assertRaisesRegex(ValueError, "2026-02-30"):
            ebpo.convert(mesh, "never.ebpo.h5", date="2026-02-30")
        made = ebpo.convert(mesh, "arrays.ebpo.h5")
        self.same(made.mesh(), model("scan").mesh())
        double = ebpo.convert((mesh.vertices.astype(float), mesh.faces.tolist()), "doubles.ebpo.h5", parts="-maps")
        self.assertEqual(double.mesh().vertices.dtype, np.float64)
        text = "v 691234.567 5334567.891 0\nv 691235.567 5334567.891 0\nv 691234.567 5334568.902 1\nf 1 2 3\n"
        pathlib.Path("utm.obj").write_text(text + "l 1 2\n")
        with self.assertWarnsRegex(UserWarning, "^utm.obj: not read: points, lines"):
            utm = ebpo.convert("utm.obj", "utm.ebpo.h5")
        self.assertEqual(sorted(utm.mesh().vertices.tolist()),
                         sorted([float(x) for x in line.split()[1:]] for line in text.splitlines()[:3]))
        stages = []
        ebpo.convert("scan.ply", "stages.ebpo.h5", progress=lambda stage, *_: stages.append(stage))
        self.assertGreater(len(set(stages)), 2)
        with self.assertRaises(ebpo.Cancelled):
            ebpo.convert("scan.ply", "never.ebpo.h5", progress=lambda *_: False)
        with self.assertRaises(ebpo.NotSolidError):
            ebpo.convert("open_box.ply", "never.ebpo.h5", require_solid=True)
        with self.assertRaises(TypeError):
            ebpo.convert("scan.ply", "never.ebpo.h5", nonsense=1)
        with self.assertRaises(FileExistsError) as caught:
            ebpo.convert("scan.ply", "arrays.ebpo.h5")
        self.assertEqual((caught.exception.errno, caught.exception.filename), (errno.EEXIST, "arrays.ebpo.h5"))
        self.assertEqual(made.mesh().faces.shape, ebpo.open("arrays.ebpo.h5").mesh().faces.shape, "not replaced")
        with self.assertWarnsRegex(UserWarning, "furlong"):
            self.assertEqual(ebpo.convert("scan.ply", "unit.ebpo.h5", unit="furlong").info.unit, "furlong")
        with self.assertRaises(TypeError):  # selections are not supported here
            ebpo.convert("scan.ply", "never.ebpo.h5", percent=5)
        for wrong in ({"rule": "none"}, {"codec": "none at all"}, {"parts": "mess"}, {"parts": ["-maps", "-mess"]},
                      {"parts": "-maps,mesh"}, {"parts": "maps,envelopes"}, {"parts": "mesh,colours"}, {"parts": ""}):
            with self.assertRaisesRegex(ValueError, "not '"):
                ebpo.convert("scan.ply", "never.ebpo.h5", **wrong)
        self.assertEqual(ebpo.convert("scan.ply", "dated.ebpo.h5", date="2026-03-01", overwrite=True).info.date, "2026-03-01")
        for wrong in ("2026-02-30", "1.3.2026"):
            with self.assertRaisesRegex(ValueError, "^date: "):
                ebpo.convert("scan.ply", "never.ebpo.h5", date=wrong)
        for wrong in ((mesh.vertices, mesh.faces + 10**6), (mesh.vertices, mesh.faces[:, :2])):
            with self.assertRaises(ValueError):
                ebpo.convert(wrong, "never.ebpo.h5")
        with self.assertRaises(OSError):
            ebpo.convert("scan.ply", "no/such/folder.ebpo.h5")
        self.assertFalse(pathlib.Path("never.ebpo.h5").exists())

    def test_colliding(self):
        m = model("scan")
        c = ebpo.Collider(m, m)
        away, partly = np.eye(4), np.eye(4)
        away[0, 3], partly[0, 3] = 5, .5
        self.assertIs(c.relation(pose_b=away), ebpo.Relation.DISJOINT)
        self.assertIs(c.relation(), ebpo.Relation.EQUAL)
        self.assertIs(c.relation(pose_b=ebpo.pose(scale=.3)), ebpo.Relation.B_INSIDE_A)
        pairs, contacts = c.pairs(pose_b=partly), c.contacts(pose_b=partly)
        crossing = pairs.kind == ebpo.PairKind.CROSSING
        self.assertEqual(crossing.sum(), len(contacts.points))
        np.testing.assert_array_equal(pairs.face_a[crossing], contacts.face_a)
        self.assertLess(abs(m.distance(contacts.points.reshape(-1, 3)).distance).max(), 1e-9)
        first = c.first(pose_b=partly)
        self.assertIn(first[:2], list(zip(pairs.face_a, pairs.face_b)))
        self.assertEqual(sum(len(line) - 1 for line in c.polylines(pose_b=partly)), crossing.sum())
        gap = c.distance(pose_b=away)
        self.assertEqual(gap.lo, gap.hi)
        self.assertAlmostEqual(np.linalg.norm(gap.point_a - gap.point_b), gap.hi, places=12)
        out = c.separation([-1, 0, 0], pose_b=partly)
        self.assertTrue(out.lo == out.hi > 0)
        moved = ebpo.pose(translation=[-out.hi * 1.001, 0, 0])
        self.assertIn(c.relation(pose_a=moved, pose_b=partly), (ebpo.Relation.DISJOINT, ebpo.Relation.TOUCHING))
        with self.assertRaises(ValueError):
            c.relation(pose_b=np.ones((4, 4)))
        with self.assertRaises(ebpo.ArgumentError):
            c.relation(pose_b=ebpo.pose(rotation=np.diag([1, 1, -1])))
        turned = ebpo.pose(quaternion=[0, 0, 1, 1], scale=2, translation=[1, 2, 3])
        matrix = np.array([[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1.]])
        self.assertAlmostEqual(c.distance(pose_b=turned).hi, c.distance(pose_b=matrix).hi, places=12)

    def test_scenes(self):
        model("scan")
        pathlib.Path("two.scene.json").write_text(json.dumps({
            "ebpo_scene": "1.0", "models": {"ball": {"file": "scan.ebpo.h5"}},
            "instances": [{"name": "here", "model": "ball"},
                          {"name": "there", "model": "ball", "pose": {"translation": [1, 0, 0]}},
                          {"name": "far", "model": "ball", "pose": {"translation": [9, 0, 0]}}]}))
        scene = ebpo.open_scene("two.scene.json", memory="64M")
        self.assertEqual((scene.models, scene.instances), (["ball"], ["here", "there", "far"]))
        clashes = scene.clashes(count=True, relate=True)
        self.assertEqual([(row["a"], row["b"]) for row in clashes], [(0, 1)])
        self.assertEqual(clashes[0]["kind"], ebpo.ClashKind.PROTRUDING)
        pairs = scene.collide("here", "there")
        self.assertEqual(clashes[0]["crossing"], (pairs.kind == ebpo.PairKind.CROSSING).sum())
        self.assertEqual(scene.pose("there")[0, 3], 1)
        self.assertTrue(scene.box()[1, 0] > 9)
        self.assertEqual(len(scene.pairs()), 1)
        both = ebpo.boolean("A | B | C", [scene], volume=True).volume[0]
        self.assertLess(both, 3 * model("scan").volume)
        self.assertEqual(both, ebpo.boolean("B | C | D", [model("scan"), scene], volume=True,
                                            poses=[None, None, None, None], time=7).volume[0])
        moved = ebpo.boolean("B - C", [scene, model("scan")], poses=[None, ebpo.pose(translation=[5, 0, 0]), None, None])
        self.assertGreater(moved.vertices[:, 0].min(), 3)
        with self.assertRaisesRegex(ValueError, "3 models, but 1 poses"):
            ebpo.boolean("A", [scene], poses=[None])
        def stepped(step, device):   # waits until the faces near the device are loaded
            end = time.monotonic() + 60
            while (result := step(device)).face < 0 or result.flags & 2:
                self.assertLess(time.monotonic(), end)
            return result

        haptic = ebpo.Haptic(scene, [9, 0, 3], radius=.1, time=0)   # above the third ball
        result = stepped(haptic.step, [9, 0, .75])
        self.assertEqual((result.instance, result.stopped), (2, False))
        self.assertGreater(result.proxy[2], .9)
        probe = ebpo.Haptic(scene, [0, 0, 5], probe=True)
        self.assertEqual(stepped(probe.step_probe, [10, 0, 0]).instance, 2)
        with self.assertRaisesRegex(ValueError, "time belongs to a scene"):
            ebpo.Haptic(model("scan"), [0, 0, 5], time=1)
        scene.close()   # the objects keep the models
        self.assertEqual(haptic.step([9, 0, .75]).instance, 2)
        with self.assertRaisesRegex(ValueError, "closed"):
            ebpo.Haptic(scene, [9, 0, 3])
        with self.assertRaises(ebpo.FormatError):
            pathlib.Path("bad.scene.json").write_text("{}")
            ebpo.open_scene("bad.scene.json")

    def test_other_packages(self):
        """Packages that are not installed are replaced by objects that accept the same arguments."""
        m, taken = model("scan"), {}

        class Trimesh:
            def __init__(self, vertices, faces, process=True):
                self.vertices, self.faces, self.process = vertices, faces, process

        class PolyData:
            def __init__(self, vertices, faces):
                self.points, self.faces, self.cell_data = vertices, faces, taken

        for name, kind in (("trimesh", Trimesh), ("pyvista", PolyData)):
            if name not in sys.modules:
                sys.modules[name] = types.SimpleNamespace(Trimesh=Trimesh, PolyData=PolyData)
                self.addCleanup(sys.modules.pop, name)
        mesh, source = m.to_trimesh(), m.mesh(order="source")
        self.same((mesh.vertices, mesh.faces), source)
        self.assertIs(mesh.process, False)
        np.testing.assert_array_equal(m.to_pyvista().faces.reshape(-1, 4)[:, 1:], source.faces)
        self.assertEqual(len(m.to_pyvista(2).faces), 4 * len(taken["octcode"]))
        like, P = m.as_trimesh(), points(300)
        np.testing.assert_array_equal(like.contains(P), m.inside(P))
        np.testing.assert_array_equal(like.signed_distance(P), -m.distance(P).distance)
        closest, distance, face = like.nearest.on_surface(P)
        np.testing.assert_array_equal(distance, abs(m.distance(P).distance))
        corners = like.vertices[like.faces[face]]
        self.assertLess(abs(np.linalg.norm(closest - P, axis=1) - distance).max(), 1e-12)
        self.assertTrue((closest <= corners.max(axis=1) + 1e-12).all())
        o, d = 3 * P, -P
        locations, rays, faces = like.ray.intersects_location(o, d)
        self.assertLess(abs(m.distance(locations).distance).max(), 1e-12)
        once = like.ray.intersects_location(o, d, multiple_hits=False)
        np.testing.assert_array_equal(like.ray.intersects_first(o, d)[once[1]], once[2])
        self.same(like.ray.intersects_id(o, d, return_locations=True), (faces, rays, locations))
        self.assertTrue(like.ray.intersects_any(o, d).all() and like.is_watertight)
        np.testing.assert_allclose(like.bounds, [source.vertices.min(0), source.vertices.max(0)])

    def test_h5py(self):
        try:
            import h5py
        except ImportError:
            self.skipTest("no h5py")
        import ebpo.h5
        model("scan")
        try:
            ebpo.h5.enable()
        except ImportError as error:
            self.skipTest(str(error))
        with h5py.File("scan.ebpo.h5", "r") as file:
            self.assertEqual(file["/levels/01/types"].shape, (1,))
            self.assertEqual(len(file["/mesh/faces"][:]), model("scan").info.face_count)


class Text(Case):
    def test_docstrings_run(self):
        model("cube")
        mesh = np.array([[x, y, z] for z in (0., 1.) for y in (0., 1.) for x in (0., 1.)]), np.array(
            [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7],
             [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]])
        cube, ran = ebpo.convert(mesh, "cube.ebpo.h5", overwrite=True), 0
        for name in ["", *MODULES]:
            if not EXTRAS and name in ("collide", "painting", "scenes", "touching"):
                continue
            module = importlib.import_module(f"ebpo.{name}" if name else "ebpo")
            failed, tried = doctest.testmod(module, extraglobs={"cube": cube})
            self.assertEqual(failed, 0, name)
            ran += tried
        self.assertGreater(ran, 40 if EXTRAS else 20)

    def test_everything_has_a_docstring(self):
        for name in ebpo.__all__:
            thing = getattr(ebpo, name)
            self.assertTrue(thing.__doc__, name)
            for key, value in vars(thing).items() if isinstance(thing, type) else ():
                if isinstance(value, types.FunctionType) and not key.startswith("_"):
                    self.assertTrue(value.__doc__, f"{name}.{key}")
                    self.assertIn("return", value.__annotations__, f"{name}.{key}")

    def test_python_3_9(self):
        """The sources have only the syntax of Python 3.9."""
        for path in PACKAGE.glob("*.py"):
            ast.parse(path.read_text(), str(path), feature_version=(3, 9))

    def test_the_guide(self):
        """The guide's examples are valid Python, and every name in it exists."""
        text = GUIDE.read_text()
        code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
        ast.parse(code)
        for name in re.findall(r"\bebpo\.(\w+)", code):
            self.assertTrue(hasattr(ebpo, name) or name == "h5", name)
        for name in re.findall(r"\bm\.(\w+)", code):
            self.assertTrue(hasattr(ebpo.Model, name) or name == "info", name)
        for name in re.findall(r"\bm\.info\.(\w+)", code):
            self.assertIn(name, dir(model("scan").info))


if __name__ == "__main__":
    run()
