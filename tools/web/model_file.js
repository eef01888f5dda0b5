// An open model: its header, and the data for drawing, by the small module of the package "ebpo".
import { View, partsOf, viewModule } from './ebpo/view.js';
import { openWith } from './ebpo/model.js';
import { EbpoError } from './error.js';
import { KeptSource } from './kept_source.js';
import { sourceOf } from './source.js';

/** Bytes with which a file can be opened. */
export const HEAD_BYTES = 128 * 1024;

// Returns the header by the names of the format.
function infoOf(info) {
  const parts = new Set(partsOf(info));
  if (info.pruned)
    parts.add('pruned');
  return { kind: info.solid ? 'solid' : 'surface', solid: info.solid, closed: info.outward && !info.pruned, parts,
    mesh_volume: info.volume, box_origin: info.origin, box_size: info.size, vertex_count: info.vertices, face_count: info.faces,
    source_face_count: info.sourceFaces, mend_added_faces: info.addedFaces, winding_rule: info.rule, unit: info.unit || undefined, crs: info.crs || undefined, date: info.date || undefined,
    generator: info.generator, source_name: info.sourceName, source_format: info.sourceFormat, content_sha256: info.contentSha256, subset_of: info.subsetOf,
    subtree_level: info.subtreeLevel || undefined, level_count: info.levels.length,
    levels: info.levels.map((l) => ({ gray: l.gray, leaf: l.leaves, white: l.white, black: l.black, planes: l.planes, leaf_planes: l.leafPlanes, faces_new: l.faces, pruned: l.pruned,
      gray_volume: l.grayVolume, leaf_volume: l.leafVolume })) };
}

/** Returns an error of the package as an error of the viewer, with the file's name. */
export function errorOf(error, name) {
  if (error instanceof EbpoError || !error.status)
    return error;
  const code = error.status.replace('EBPO_E_', ''), where = [name, error.path].filter((text) => text && !error.message.includes(text));
  return new EbpoError(code === 'IO' ? 'NETWORK' : code, [...where, error.message].join(': '), { cause: error });
}

/**
 * Opens an address, a File or Blob, bytes, or a source. Options: those of UrlSource, and `module`, the compiled module or a promise of it; `cacheBytes`, the size
 * of the cache of decoded chunks; `headBytes`, the number of bytes of the first response to wait for.
 */
export async function openModel(what, { module = viewModule(), cacheBytes = 64 << 20, headBytes = HEAD_BYTES, ...options } = {}) {
  const source = sourceOf(what, { ahead: headBytes, ...options });
  try {
    await source.open(headBytes);
    const kept = new KeptSource(source);
    return new ModelFile(source, kept, await openWith(module, kept, { memory: cacheBytes }, View));
  } catch (error) {
    const known = errorOf(error, source.name);
    throw known.code === 'FORMAT' ? await otherFormat(source) ?? known : known;
  }
}

const BEGINNINGS = { PLY: /^ply\s/, OFF: /^(ST|C|N)*OFF\s/, STL: /^solid\s/, OBJ: /^(#[^\n]*\n\s*)*(mtllib|o|g|v|vn|vt)\s/, glTF: /^(glTF|\s*\{)/ };

// Returns the error of a mesh file that was opened instead of a model, or undefined.
async function otherFormat(source) {
  const bytes = await source.read(0, Math.min(source.size, 400)).catch(() => new Uint8Array(0)), text = String.fromCharCode(...bytes);
  const found = Object.keys(BEGINNINGS).find((name) => BEGINNINGS[name].test(text)) ?? (/\.stl$/i.test(source.name) && 'STL');
  return found ? new EbpoError('FORMAT', `${source.name}: this is a mesh file (${found}); convert it: ebpo convert MESH MODEL.ebpo.h5`) : undefined;
}

class ModelFile {
  constructor(source, kept, view) {
    Object.assign(this, { source, kept, view, info: infoOf(view.info), coloured: view.coloured });
    this.sums = view.sums && this.#named(view.sums); // rejects if data returned early do not agree with the file's list of checksums
    this.sums?.catch(() => {});
    this.levelBytes = this.info.levels.map(() => NaN); // bytes of the file for levels 0 to i, when they are known
  }

  /** Returns the requests made and bytes received so far. */
  get traffic() {
    return { requests: this.source.requests, bytes: this.source.bytes };
  }

  async #named(work) {
    try {
      return await work;
    } catch (error) {
      throw errorOf(error, this.source.name);
    }
  }

  /** Finds out the sizes of the levels. */
  async locate() {
    this.levelBytes = [...await this.#named(this.view.levelBytes())];
  }

  /** Reads nodes, as View.nodes(). */
  nodes(wanted, options) {
    return this.#named(this.view.nodes(wanted, options));
  }

  /** Reads the faces of leaves (nodes of tree.js), as View.leafFaces(). */
  async leafFaces(leaves) {
    if (!this.info.parts.has('mesh'))
      throw new EbpoError('ABSENT', `${this.source.name}: the file has no mesh; convert the model again with its mesh`);
    return this.#named(this.view.leafFaces(leaves.map(({ level, parent, octant, subtree = -1 }) => ({ level, group: parent?.rank ?? 0, octant, subtree }))));
  }

  /** Reads the table of patches, as View.patches(). */
  patches() {
    return this.#named(this.view.patches());
  }

  /** Reads patches as one mesh, as View.surface(). */
  surface(wanted, place) {
    return this.#named(this.view.surface(wanted, place));
  }

  /** Reads the caps of a surface with holes, as View.caps(). */
  caps(place) {
    return this.#named(this.view.caps(place));
  }

  close() {
    this.view.dispose();
  }
}
