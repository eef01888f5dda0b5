import { writeFileSync } from 'node:fs';

// Writes a PLY file with two flat boxes side by side, with a crack of 0.02 between them and with their tops in one plane. The ball of a point on one box intersects
// the other box, but paint must not.
export function plates(path) {
  const n = 12, vertices = [], faces = [];
  for (const x0 of [-1.01, 0.01]) {
    const at = new Map(), vertex = (x, y, z) => {
      const key = `${x},${y},${z}`;
      if (!at.has(key))
        at.set(key, vertices.push([x0 + x / n, y / n, z * 0.05]) - 1);
      return at.get(key);
    };
    for (let i = 0; i < n; i++)
      for (let k = 0; k < n; k++)
        for (const z of [0, 1]) {
          const [a, b, c, d] = [vertex(i, k, z), vertex(i + 1, k, z), vertex(i + 1, k + 1, z), vertex(i, k + 1, z)];
          faces.push(...(z ? [[a, b, c], [a, c, d]] : [[a, c, b], [a, d, c]]));
        }
    const side = (a, b) => {
      const [p, q, r, s] = [vertex(...a, 0), vertex(...b, 0), vertex(...b, 1), vertex(...a, 1)];
      faces.push([p, q, r], [p, r, s]);
    };
    for (let i = 0; i < n; i++) {
      side([i, 0], [i + 1, 0]);
      side([n, i], [n, i + 1]);
      side([n - i, n], [n - i - 1, n]);
      side([0, n - i], [0, n - i - 1]);
    }
  }
  writeFileSync(path, `ply\nformat ascii 1.0\nelement vertex ${vertices.length}\nproperty double x\nproperty double y\nproperty double z\nelement face ${faces.length}\n` +
    `property list uchar int vertex_indices\nend_header\n${vertices.map((v) => v.join(' ')).join('\n')}\n${faces.map((f) => `3 ${f.join(' ')}`).join('\n')}\n`);
}
