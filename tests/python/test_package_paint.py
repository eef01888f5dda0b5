#!/usr/bin/env python3
"""Paint from Python is the command's paint, and comes back from its file."""
import json
import pathlib
import subprocess

from package_kit import COMMAND, Case, model, np, run

import ebpo

WAY = np.array([[np.cos(a), np.sin(a), .1, .5 + a / 4] for a in np.linspace(0, 2, 30)])


class Painting(Case):
    def painted(self):
        m = model("scan")
        paint = ebpo.Paint(m)
        for title in ("First", "Zweite \u00fc"):
            layer = paint.add_layer(title=title, opacity=200)
        laid = paint.lay(m, WAY, layer=layer, radius=.05, colour=0x112233ff)
        self.assertEqual(laid["strokes"], 1)
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
        told = json.loads(subprocess.run([COMMAND, "paint", "--json", "scan.paint.h5"], check=True,
                                         capture_output=True).stdout)
        self.assertIn('"First"', json.dumps(told))
        with self.assertRaises(ebpo.FormatError):
            ebpo.Paint.open(b"no such file" * 50)

    def test_answers(self):
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
        paint.lay(m, WAY, layer=0, radius=.05)
        self.assertEqual((len(paint.layers), len(paint.notes), len(paint.strokes)), (1, 0, 1))
        with self.assertRaisesRegex(TypeError, "radii"):
            paint.lay(m, WAY, radii=2)
        with self.assertRaisesRegex(ValueError, "shape"):
            paint.lay(m, WAY[:, :3], radius=1)
        with self.assertRaises(ebpo.ArgumentError):
            paint.lay(m, WAY, layer=5, radius=.1)
        with self.assertRaises(ebpo.ArgumentError):
            paint.check(model("coloured"))
        with self.assertRaises(ZeroDivisionError):
            paint.measure(m, progress=lambda *_: 1 / 0)


if __name__ == "__main__":
    run()
