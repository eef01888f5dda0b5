// Converts a whole file to the JSON that read_ebpo.py prints. As a program: node as_json.js FILE
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { openEbpo } from '../index.js';

// Returns an array in the form of read_ebpo.py: a list, or for more than 1,000 values the SHA-256 of the little-endian values.
function listed(values, Type) {
  if (values === undefined)
    return null;
  const typed = Type === BigUint64Array ? Type.from(Array.from(values, BigInt)) : Type.from(values);
  if (typed.length > 1000)
    return 'sha256 ' + createHash('sha256').update(new Uint8Array(typed.buffer)).digest('hex');
  return Array.from(typed, Number);
}

function asJson(info, levels, mesh, maps) {
  const level = (l) => ({
    level: l.level, gray_volume: l.summary.gray_volume, leaf_volume: l.summary.leaf_volume,
    types: listed(l.types, Uint16Array), plane_counts: listed(l.planeCounts, Uint8Array), planes: listed(l.planes, Uint32Array),
    leaf_winding: listed(l.leafWinding, Int32Array), black_winding: listed(l.blackWinding, Int32Array), white_winding: listed(l.whiteWinding, Int32Array),
    leaf_first: listed(l.leafFirst && l.summary.leaf ? l.leafFirst : undefined, BigUint64Array), leaf_new: listed(l.leafNew, Uint32Array),
    leaf_ref_count: listed(l.leafRefCount, Uint32Array), leaf_refs: listed(l.leafRefs, Uint32Array),
    leaf_plane_counts: listed(l.leafPlaneCounts, Uint8Array), leaf_planes: listed(l.leafPlanes, Uint32Array),
    ...(l.grayColours && { gray_colours: listed(l.grayColours, Uint32Array) }),
  });
  return {
    kind: info.kind, winding_rule: info.winding_rule, coordinate_type: info.coordinate_type, levels: levels.map(level),
    mesh: { level: null, vertices: listed(mesh?.vertices, info.coordinate_type === 'float64' ? Float64Array : Float32Array),
      faces: listed(mesh?.faces, Uint32Array), vertex_source: listed(maps?.vertexSource, Uint32Array), face_source: listed(maps?.faceSource, Uint32Array) },
  };
}

/** Reads and checks the whole file. Returns the same value as read_ebpo.py. */
export async function readAll(bytes, name) {
  const file = await openEbpo(bytes, { name });
  const levels = await file.levels(0, file.info.level_count - 1, { faces: true });
  const mesh = file.info.parts.has('mesh') ? await file.mesh() : undefined, maps = file.info.parts.has('maps') ? await file.maps() : undefined;
  if (mesh)
    file.checkOrder(levels);
  await file.verifyContent();
  return asJson(file.info, levels, mesh, maps);
}

if (process.argv[1] === new URL(import.meta.url).pathname)
  console.log(JSON.stringify(await readAll(readFileSync(process.argv[2]), process.argv[2]), null, 1));
