#!/usr/bin/env python3
"""Checks that paint from Python equals the command's paint and is read back from its file."""
import json
import pathlib
import subprocess
from concurrent.futures import ThreadPoolExecutor

from package_support import COMMAND, Case, model, np, run

import ebpo

WAY = np.array([[np.cos(a), np.sin(a), .1, .5 + a / 4] for a in np.linspace(0, 2, 30)])


class Painting(Case):
    def painted(self):
        m = model("scan")
        paint = ebpo.Paint(m)
        for title in ("First", "Zweite \u00fc"):
            layer = paint.add_layer(title=title, opacity=200)
        drawn = paint.draw(m, WAY, layer=layer, radius=.05, colour=0x112233ff)
        self.assertEqual(drawn["strokes"], 1)
        paint.add_note(m, [0, 0, 3], layer=0, title="Top", body="here")
        return m, paint

    def test_files_and_bytes(self):
        m, paint = self.painted()
        paint.save("scan.paint.h5")
        for again in (ebpo.Paint.open("scan.paint.h5"), ebpo.Paint.open(pathlib.Path("scan.paint.h5").read_bytes())):
            again.check(m)
            self.assertEqual([layer["title"] for layer in again.layers], ["First", "Zweite \u00fc"])
            self.assertEqual(again.layers, paint.layers)
            one, other = again.strokes[0], paint.strokes[0]
            self.assertEqual(one[:5], other[:5])
            self.assertEqual(one.points.tobytes(), other.points.tobytes())
            note = again.notes[0]
            self.assertEqual((note["title"], note["body"], note["layer"]), ("Top", "here", 0))
            np.testing.assert_allclose(note["at"]["place"], m.distance([0, 0, 3]).point)
        printed = json.loads(subprocess.run([COMMAND, "paint", "--json", "scan.paint.h5"], check=True,
                                         capture_output=True).stdout)
        self.assertIn('"First"', json.dumps(printed))
        with self.assertRaises(ebpo.FormatError):
            ebpo.Paint.open(b"no such file" * 50)

    def test_two_changes_of_one_file(self):
        """Of two paints that are opened and saved at the same time, the second is refused. Changes in turn are kept."""
        m, paint = self.painted()
        paint.save("two.paint.h5")
        one, other = ebpo.Paint.open("two.paint.h5"), ebpo.Paint.open("two.paint.h5")
        one.add_layer(title="One")
        other.add_layer(title="Other")
        one.save("two.paint.h5")
        for late in other, paint:
            with self.assertRaisesRegex(ebpo.IOFailure, "another program has changed the file since it was read"):
                late.save("two.paint.h5")
        other.save("copy.paint.h5")
        self.assertEqual([layer["title"] for layer in ebpo.Paint.open("two.paint.h5").layers][2:], ["One"])

        def add(number):
            with ebpo.Paint.change("turns.paint.h5", m) as changed:
                changed.add_layer(title=f"L{number}")

        with ThreadPoolExecutor(6) as pool:
            list(pool.map(add, range(12)))
        commands = [subprocess.Popen([COMMAND, "paint", "-q", "turns.paint.h5", "--layer", "0", "--title", f"C{i}"])
                    for i in range(2)]
        add(12)
        self.assertEqual([command.wait() for command in commands], [0, 0])
        titles = {layer["title"] for layer in ebpo.Paint.open("turns.paint.h5").layers}
        self.assertEqual(len(titles), 13)
        with self.assertRaises(ZeroDivisionError), ebpo.Paint.change("turns.paint.h5") as changed:
            changed.add_layer(title="never")
            with self.assertRaisesRegex(ebpo.IOFailure, "has been changing the file"):
                with ebpo.Paint.change("turns.paint.h5", wait=.1):
                    pass
            1 / 0
        with self.assertRaisesRegex(ValueError, "ended with an exception"):
            changed.save("never.paint.h5")
        self.assertEqual(len(ebpo.Paint.open("turns.paint.h5").layers), 13)
        self.assertEqual([*pathlib.Path().glob(".*.lock")], [])

    def test_results(self):
        m, paint = self.painted()
        faces = paint.cover(m, 0)
        self.assertGreater(len(faces), 10)
        mesh = m.mesh(order="source")
        np.testing.assert_array_equal(faces["corner"], mesh.vertices[mesh.faces[faces["face"].astype(int)]])
        near = m.distance(faces["corner"].reshape(-1, 3)).distance
        self.assertTrue((near == 0).all())
        areas = paint.measure(m)
        self.assertTrue(areas.all["lo"] <= areas.all["value"] <= areas.all["hi"])
        self.assertEqual([bool(value) for value in areas.layers["value"]], [False, True])
        self.assertEqual(areas.strokes["value"][0], areas.layers["value"][1])
        self.assertLess(areas.all["hi"], faces["corner"].size)

    def test_changes(self):
        m, paint = self.painted()
        paint.remove_stroke(0)
        self.assertEqual(paint.strokes, [])
        paint.remove_layer(0)
        paint.draw(m, WAY, layer=0, radius=.05)
        self.assertEqual((len(paint.layers), len(paint.notes), len(paint.strokes)), (1, 0, 1))
        with self.assertRaisesRegex(TypeError, "radii"):
            paint.draw(m, WAY, radii=2)
        with self.assertRaisesRegex(ValueError, "shape"):
            paint.draw(m, WAY[:, :3], radius=1)
        with self.assertRaises(ebpo.ArgumentError):
            paint.draw(m, WAY, layer=5, radius=.1)
        with self.assertRaises(ebpo.ArgumentError):
            paint.check(model("coloured"))
        with self.assertRaises(ZeroDivisionError):
            paint.measure(m, progress=lambda *_: 1 / 0)


if __name__ == "__main__":
    run()
