import type { Info, OpenOptions, QueryOptions, Source } from './index.js';

/** Nodes of a part of a level. `first`: ranks of the first white, black, leaf and gray node in the level. Arrays as in
 * ebpo_level (ebpo/file.h): types of each group, planes of each gray node and leaf, colours of each gray node. */
export interface NodePart {
  level: number; part: number; group: number; first: number[]; types: Uint16Array;
  planeCounts: Uint8Array; planes: Uint32Array; leafPlaneCounts: Uint8Array; leafPlanes: Uint32Array; grayColours?: Uint32Array;
}

/** A leaf: the number of its siblings' group in the level, its octant, and its subtree, or -1. */
export interface LeafAddress { level: number; group: number; octant: number; subtree: number }

/** Faces of a leaf: file indices (Model.maps() gives the source indices of queries), corners (9 numbers each), colours (red, green and blue of each corner). */
export interface LeafFaces { numbers: Uint32Array; corners: Float32Array | Float64Array; colours?: Uint8Array }

/** A patch of the simplified surface: position of its cell, error in the model's unit, number of triangles, and of faces that it
 * replaces; the patches of the node's children have the indices from `child` to `end`, exclusive. */
export interface SurfacePatch { level: number; at: number[]; error: number; triangles: number; faces: number; child: number; end: number }

/** Patches as one mesh: number of triangles, and of faces of the model among them; (coordinate - center) * scale; octahedral normals;
 * red, green, blue and 0 (255: no colour) of each vertex. */
export interface DrawnSurface { triangles: number; faces: number; position: Float32Array; normal: Int16Array; hue?: Uint8Array; index: Uint32Array }

/** A file opened for drawing. It has `info` and dispose() as Model has, and none of Model's queries. */
export class View {
  private constructor();
  readonly info: Info;
  /** True if faces or vertices have colours. */
  readonly coloured: boolean;
  /** Rejects if data that was returned before the list of chunk checksums arrived does not agree with the list; undefined: no list. */
  readonly sums?: Promise<void>;
  nodes(wanted: { level: number; part: number }[], options?: QueryOptions & { bytes?: number }): Promise<NodePart[]>;
  leafFaces(leaves: LeafAddress[], options?: QueryOptions): Promise<LeafFaces[]>;
  patches(options?: QueryOptions): Promise<SurfacePatch[]>;
  surface(wanted: { patch: number; faces: boolean }[], options: QueryOptions & { center: number[]; scale: number }): Promise<DrawnSurface>;
  /** The triangles that close the holes of a surface with the part `border`. */
  caps(options: QueryOptions & { center: number[]; scale: number }): Promise<DrawnSurface>;
  levelBytes(options?: QueryOptions): Promise<Float64Array>;
  dispose(): void;
}

/** Opens a file for drawing. `memory`: size of the cache of decoded data in bytes. */
export function openView(from: string | URL | Blob | ArrayBuffer | ArrayBufferView | Source, options?: OpenOptions): Promise<View>;
/** Returns the compiled module, which is loaded once. */
export function viewModule(): Promise<WebAssembly.Module>;
/** Names of the file's parts. */
export function partsOf(info: Info): string[];
