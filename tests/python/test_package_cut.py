#!/usr/bin/env python3
"""Checks that a model cut into eight files returns the results of the whole: at random points, on faces, on caps.

    test_package_cut.py EBPO EBPO_INPUTS EBPO_GENERATE SOURCES MODELS
"""
import os
import subprocess
import sys

from package_support import COMMAND, Case, np, run

import ebpo
from catalogue_support import by_command, caps_of, cut_by_sample, on_triangles, same
from ebpo.catalogue import Where

MODEL = os.path.join(sys.argv[5], "bunny_closed.ply")
AT_MOST = 20_000  # points of each kind


class RealParts(Case):
    @classmethod
    def setUpClass(cls):
        subprocess.run([COMMAND, "convert", "-q", MODEL, "whole.ebpo.h5"], check=True)
        cls.whole = ebpo.open("whole.ebpo.h5")
        cls.catalogue = cut_by_sample("whole.ebpo.h5", "cut")[1]
        vertices, faces = cls.whole.mesh(order="source")
        cls.corners = vertices.astype(float)[faces]
        caps = caps_of(cls.catalogue, cls.corners)
        rng = np.random.default_rng(11)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        cls.length = float(np.linalg.norm(high - low))
        cls.caps = on_triangles(caps)
        cls.points = {"random": rng.uniform(low - cls.length / 8, high + cls.length / 8, (AT_MOST, 3)),
                      "faces": rng.permutation(on_triangles(cls.corners))[:AT_MOST],
                      "caps": rng.permutation(cls.caps)[:AT_MOST]}

    def test_faces_are_dealt_out(self):
        self.assertEqual(len(self.catalogue), 8)
        numbers = np.concatenate([np.load(entry.numbers) for entry in self.catalogue.entries])
        np.testing.assert_array_equal(np.sort(numbers), np.arange(self.whole.info.face_count))

    def test_inside(self):
        for kind, p in self.points.items():
            results, expected = self.catalogue.locate(p), self.whole.locate(p)
            np.testing.assert_array_equal(results["where"], expected.where, kind)
            np.testing.assert_array_equal(results["winding"], expected.winding, kind)
            same(by_command("inside", self.catalogue, p), results)
            for where in {"faces": [Where.ON], "caps": [Where.ON, Where.IN], "random": [Where.IN, Where.OUT]}[kind]:
                self.assertGreater((results["where"] == where).sum(), 100, (kind, where))

    def test_distance(self):
        for kind, p in self.points.items():
            results, expected = self.catalogue.distance(p), self.whole.distance(p)
            np.testing.assert_array_equal(results["distance"], expected.distance, kind)
            np.testing.assert_allclose(results["point"], expected.point, rtol=0, atol=1e-14 * self.length)
            same(by_command("distance", self.catalogue, p, "--memory", "16M"), results)
            other = results["face"] != expected.face  # another face at the same distance, with a common corner
            a, b = self.corners[results["face"][other]], self.corners[expected.face[other]]
            shared = (a[:, :, None] == b[:, None]).all(axis=3).any(axis=(1, 2))
            self.assertTrue(shared.all(), kind)

    def test_rays(self):
        """Rays to corners, edges and the interior of faces: several faces are hit at one t."""
        for kind, o in self.points.items():
            d = np.random.default_rng(12).permutation(self.points["faces"])[:len(o)] - o[:AT_MOST]
            o, d = o[d.any(axis=1)], d[d.any(axis=1)]
            results, expected = self.catalogue.ray(o, d), self.whole.ray(o, d)
            same(by_command("ray", self.catalogue, np.concatenate([o, d], axis=1)), results)
            np.testing.assert_array_equal(results["t"], expected.t, kind)
            np.testing.assert_array_equal(results["side"] == 0, expected.side == 0, kind)
            self.assertGreater((results["face"] == expected.face).mean(), .8, kind)


if __name__ == "__main__":
    run()
