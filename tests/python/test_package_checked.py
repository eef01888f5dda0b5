#!/usr/bin/env python3
"""Checks that every integer, text and array reaches C unchanged, or is rejected.

Tests all declared functions and all members of structs, in the order of the headers. Then tests the package's
functions.
"""
import ctypes
import os
import pathlib
import unittest.mock

from package_support import Case, model, np, points, run

import ebpo
import ebpo.collide
import ebpo.model
from ebpo import _checked, _declared as declared
from ebpo._library import lib, made, of_members

NUL, LONE = "a\0b", "a\udc80b"
STRUCTS = [kind for kind in vars(declared).values() if isinstance(kind, type) and kind is not _checked.Structure
           and issubclass(kind, _checked.Structure)]


def range_of(kind):
    bits, signed = 8 * ctypes.sizeof(kind), kind(-1).value < 0
    return (-2**(bits - 1), 2**(bits - 1) - 1) if signed else (0, 2**bits - 1)


def cases_of(kind):
    """Return a valid value, and (value, exception) of invalid values. None and [] for addresses and structs."""
    if kind in _checked.INTEGERS:
        low, high = range_of(kind)
        bad = [(low - 1, ValueError), (high + 1, ValueError), (2**64 + 1, ValueError), (np.uint64(2**64 - 1), ValueError)
               if high < 2**64 - 1 else (-1, ValueError), (1.0, TypeError), (np.float64(1), TypeError), ("1", TypeError),
               (2**9999, ValueError)]
        return 0, bad
    if kind in _checked.REALS:
        return 0.0, [(2**9999, ValueError), (2**53 + 1, ValueError), (np.int64(2**53 + 1), ValueError), ("1", TypeError),
                     (1j, TypeError), (None, TypeError)]
    if kind is ctypes.c_bool:
        return False, [(2, ValueError), (-1, ValueError), ("no", TypeError), (0.0, TypeError)]
    if kind is ctypes.c_char_p:
        return b"", [(NUL, ValueError), (NUL.encode(), ValueError), (LONE, ValueError), (1, TypeError)]
    if issubclass(kind, ctypes.Array) and kind._type_ is ctypes.c_char:
        return b"", [(NUL, ValueError), (LONE, ValueError), ("x" * kind._length_, ValueError), (1, TypeError)]
    if issubclass(kind, ctypes.Array) and not issubclass(kind._type_, (ctypes.Structure, ctypes._CFuncPtr)):
        good, bad = cases_of(kind._type_)
        return [good] * kind._length_, [([good] * (kind._length_ - 1) + [value], error) for value, error in bad] + [
            ([good] * (kind._length_ + 1), ValueError)]
    return None, []


def shown(value):
    return f"2**{value.bit_length()}" if isinstance(value, int) else repr(value)[:40]


def known(kind):
    """Return True for types that are checked, or whose values no user sets."""
    return bool(_checked.converter(kind)) or kind is ctypes.c_void_p or \
        issubclass(kind, (ctypes._CFuncPtr, _checked.Structure))


class Declared(Case):
    def test_functions(self):
        tried = 0
        for name, (_, kinds, names, _) in declared.FUNCTIONS.items():
            self.assertEqual(len(kinds), len(names), name)
            good = [cases_of(kind)[0] for kind in kinds]
            for i, kind in enumerate(kinds):
                self.assertTrue(known(kind), (name, kind))
                for value, error in cases_of(kind)[1]:
                    with self.assertRaises(error, msg=f"{name}({names[i]}={shown(value)})") as caught:
                        getattr(lib, name)(*good[:i], value, *good[i + 1:])
                    self.assertIn(names[i], str(caught.exception))
                    tried += 1
        self.assertGreater(tried, 300)

    def test_members(self):
        tried = 0
        for kind in STRUCTS:
            for name, member in kind._fields_:
                self.assertTrue(known(member), (kind, name, member))
                good, bad = cases_of(member)
                if bad:
                    setattr(made(kind), name, good)
                for value, error in bad:
                    with self.assertRaises(error, msg=f"{kind.__name__}.{name} = {shown(value)}"):
                        setattr(made(kind), name, value)
                    tried += 1
            with self.assertRaises(TypeError):
                made(kind, nonsense=1)
        self.assertGreater(tried, 2000)

    def test_equal_values_are_equal(self):
        options = made(declared.ebpo_inside_options)
        for value in (3, np.int8(3), np.uint64(3), np.array(3), ebpo.Where(3)):
            options.level = value
            self.assertEqual(options.level, 3)
        for value in (True, np.True_, 1):
            self.assertEqual(made(declared.ebpo_lod_options, cell_faces=value).cell_faces, True)
            options.level = value
            self.assertEqual(options.level, 1)
        for value in (1, np.float32(1), np.int64(1), True):
            self.assertEqual(made(declared.ebpo_pose, scale=value).scale, 1.0)
        layer = made(declared.ebpo_paint_layer, title="Ä", author=b"x", date=None, description=pathlib.Path("y"))
        self.assertEqual((layer.title, layer.author, layer.date, layer.description), ("Ä".encode(), b"x", None, b"y"))
        with self.assertRaises(TypeError):
            of_members(declared.ebpo_haptic_options, {"points": 1})
        with self.assertRaises(TypeError):
            of_members(declared.ebpo_paint_pen, {"progress": 1})


class Package(Case):
    def refused(self, error, function, *arguments, **options):
        with self.assertRaises(error, msg=f"{arguments} {options}") as caught:
            function(*arguments, **options)
        self.assertTrue(str(caught.exception))

    def test_paths(self):
        """No file is made or replaced under a name that is cut at a NUL."""
        m = model("cube")
        paint = ebpo.Paint(m)
        pathlib.Path("precious.txt").write_text("precious")
        before = sorted(os.listdir())
        mesh = np.eye(4)[:, :3], np.array([[0, 1, 2]])
        for name in ("precious.txt\0.paint.h5", b"precious.txt\0", pathlib.Path("precious.txt\0"), "precious.txt\ud800"):
            for function, *rest in ((paint.save,), (ebpo.Paint.open,), (ebpo.open,), (ebpo.open_scene,),
                                    (lambda name: ebpo.convert(mesh, name),),
                                    (lambda name: ebpo.convert(name, "out.ebpo.h5"),),
                                    (lambda name: ebpo.convert(mesh, "out.ebpo.h5", temp_dir=name),)):
                if not (function is ebpo.open and isinstance(name, bytes)):  # bytes are the contents of a file here
                    self.refused(ValueError, function, name, *rest)
        self.assertEqual((sorted(os.listdir()), pathlib.Path("precious.txt").read_text()), (before, "precious"))
        for text in (NUL, LONE):
            self.refused(ValueError, paint.add_layer, title=text)
            self.refused(ValueError, paint.add_note, m, [0, 0, 1], body=text)
            self.refused(ValueError, m.sample, text, [[0, 0, 1.]], [0])
            self.refused(ValueError, ebpo.convert, mesh, "out.ebpo.h5", unit=text)
            self.refused(ValueError, ebpo.open, "http://127.0.0.1:1/" + text)
            self.refused(ValueError, ebpo.open, "http://127.0.0.1:1/", user=text)
            self.refused(ValueError, ebpo.open, "http://127.0.0.1:1/", cache_folder="a\0b")
            self.refused(ValueError, ebpo.open, "http://127.0.0.1:1/", headers={"A": text})
        self.assertEqual(paint.layers, [])

    def test_integers(self):
        m = model("cube")
        p, paint, mesh = points(3), ebpo.Paint(m), (np.eye(4)[:, :3], np.array([[0, 1, 2]]))
        for number in (-1, 2**64 + 1, 2**64):
            for function in (m.subtree, lambda n: m.subtree(memory=n), paint.remove_layer,
                             paint.remove_note, paint.remove_stroke, lambda n: paint.cover(m, n),
                             lambda n: ebpo.open("cube.ebpo.h5", memory=n), lambda n: m.near(p[0], count=n),
                             lambda n: ebpo.open("cube.ebpo.h5", max_expansion=n), lambda n: paint.add_layer(colour=n),
                             lambda n: paint.measure(m, fineness=n), lambda n: ebpo.convert(mesh, "o.ebpo.h5", seed=n),
                             lambda n: ebpo.convert(mesh, "o.ebpo.h5", memory=n), lambda n: ebpo.Collider(m, m, memory=n)):
                self.refused(ValueError, function, number)
        for number in (-1, 2**32, 2**64 + 1):
            for function in (m.inside, m.locate, m.winding, m.distance):
                self.refused(ValueError, function, p, threads=number)
            for function in (m.ray, m.ray_any, m.ray_all):
                self.refused(ValueError, function, p, p, threads=number)
            self.refused(ValueError, m.measure, threads=number)
            self.refused(ValueError, ebpo.open, "cube.ebpo.h5", threads=number)
            self.refused(ValueError, ebpo.Collider, m, m, threads=number)
            self.refused(ValueError, ebpo.convert, mesh, "o.ebpo.h5", threads=number)
        for number in (-1, 21):
            self.refused(ValueError, m.octcode, p[0], number)
        for number in (2**32, -2**40, 2**31):
            self.refused(ValueError, m.locate, p, level=number)
            self.refused(ValueError, m.octcode, p[0], number)
            self.refused(ValueError, m.level, number)
            self.refused(ValueError, m.subtree, levels=2 * number)
        for wrong in (1.0, "1", np.float32(2)):
            self.refused(TypeError, m.subtree, wrong)
            self.refused(TypeError, m.locate, p, level=wrong)
            self.refused(TypeError, m.locate, p, threads=wrong)
        self.refused(ValueError, paint.add_layer, opacity=256)
        self.refused(ValueError, ebpo.convert, mesh, "o.ebpo.h5", fill_holes=2)
        self.refused(TypeError, ebpo.convert, mesh, "o.ebpo.h5", fill_holes="no")
        self.refused(TypeError, ebpo.open, "cube.ebpo.h5", memory=1e9)
        self.refused(TypeError, ebpo.Haptic, m, [0, 0, 2], radiuss=1.)
        for seconds in (-1, float("inf"), float("nan"), 1e300, "1"):
            self.refused((ValueError, TypeError), m.locate, p, deadline=seconds)
            self.refused((ValueError, TypeError), ebpo.Collider(m, m).relation, deadline=seconds)
        self.assertEqual(m.subtree(np.uint64(1)).node_count, m.subtree(True).node_count)

    def test_callbacks_raise(self):
        """An exception in a callback that receives results is raised by the call, which returns no partial result."""
        m = model("cube")
        paint = ebpo.Paint(m)
        layer = paint.add_layer(title="x")
        paint.draw(m, [[.2, .5, 1, 1], [.8, .5, 1, 1]], layer=layer, radius=.1)
        collider, shifted = ebpo.Collider(m, m), ebpo.pose(translation=[.5, .25, .25])
        for module, name, query in ((ebpo.point_queries, "copied", lambda: m.triangles_in_box([0, 0, 0], [1, 1, 1])),
                                  (ebpo.collide, "copied", lambda: collider.pairs(pose_b=shifted)),
                                  (ebpo.collide, "copied", lambda: collider.contacts(pose_b=shifted)),
                                  (ebpo.collide, "copied", lambda: collider.polylines(pose_b=shifted)),
                                  (ctypes, "string_at", lambda: m.near([0, 0, 0])),
                                  (ctypes, "string_at", lambda: paint.cover(m, 0))):
            with unittest.mock.patch.object(module, name, side_effect=KeyboardInterrupt):
                with self.assertRaises(KeyboardInterrupt):
                    query()
            query()

    def test_arrays(self):
        m = model("cube")
        corners = np.eye(4)[:, :3]
        for faces, error in (([[0, 1, -1]], ValueError), ([[0, 1, 2**32]], ValueError), ([[0., 1, 2]], TypeError),
                             (np.array([[0, 1, 2**63]], np.uint64), ValueError), ([[True, False, True]], TypeError),
                             ([[0, 1, 2**70]], ValueError), ([["0", "1", "2"]], TypeError)):
            self.refused(error, ebpo.convert, (corners, faces), "o.ebpo.h5")
        for faces, error in (([2**63], ValueError), (np.array([2**63], np.uint64), ValueError), ([0.5], TypeError)):
            self.refused(error, m.sample, "red", [[0, 0, 1.]], faces)
        for codes, error in (([-1], ValueError), ([2**32], ValueError), ([1.5], TypeError)):
            self.refused(error, ebpo.half_spaces, codes)
        far = 2**53 + 1
        for bad, error in (([[far, 0, 0]], ValueError), (np.array([[far, 0, 0]]), ValueError), ([[10**400, 0, 0]], ValueError),
                           (np.array([[2**64 - 1, 0, 0]], np.uint64), ValueError), ([["1", "2", "3"]], TypeError),
                           ([[1j, 0, 0]], TypeError), (np.array([["1", 0, 0]], object), TypeError),
                           (np.zeros((1, 3), bool), TypeError)):
            for function in (m.inside, m.distance, lambda p: m.ray(p, [0, 0, 1.]), lambda p: m.ray([0, 0, 1.], p),
                             lambda p: m.near(np.asarray(p)[0]), lambda p: m.faces_in_box(np.asarray(p)[0], [1., 1, 1]),
                             lambda p: m.octcode(np.asarray(p)[0], 1), lambda p: ebpo.pose(translation=p),
                             lambda p: ebpo.Haptic(m, np.asarray(p)[0]), lambda p: ebpo.Paint(m).add_note(m, np.asarray(p)[0]),
                             lambda p: ebpo.convert((np.repeat(p, 3, axis=0), [[0, 1, 2]]), "o.ebpo.h5")):
                self.refused(error, function, bad)
        self.assertEqual(m.inside([[2**53, 0, 0], [0, 0, 0]]).tolist(), m.inside([[2.**53, 0, 0], [0, 0, 0]]).tolist())
        self.same(m.distance(np.array([[1, 2, 3]], object)), m.distance([[1., 2, 3]]))
        self.refused(TypeError, m.ray, [0, 0, 1.], [0, 0, 1.], t_max="1")


if __name__ == "__main__":
    run()
