/** Reads and queries EBP-Octree files (.ebpo.h5) in browsers and Node.
 *
 * Faces have two indices. The *source index* is the face's index in the source; queries, `sample` and pairs use it. The *file
 * index* is the face's row in the file; it is called `number` in subtrees, views and View.leafFaces(). In files without source
 * indices (part `maps`), both are equal. `maps()` gives the source index of each file index. `mesh()` and `attribute()` have rows in the order of source
 * indices, or, with order 'file', of file indices. Row i of the source order has source index i, unless faces of the source are
 * missing in the file (degenerate faces, subsets). */

export interface Range { offset: number; size: number }

/** A source of bytes. `read` resolves to the bytes of all ranges, which it should fetch at the same time. */
export interface Source {
  size: number;
  name?: string;
  /** Text that changes when the file does; "" or undefined: not known. */
  version?: string;
  read(ranges: Range[], signal?: AbortSignal): Promise<Uint8Array[]>;
}

export interface OpenOptions {
  /** Budget of the model in bytes, as `memory` of ebpo_model_options. 0: the default of the library. */
  memory?: number;
  /** Levels 0 to `level` stay in memory. -1: chosen by the budget. */
  level?: number;
  /** True: the whole file is read and the model is made in memory, for the fastest queries. Default: true for bytes in
   * memory, false for other sources. */
  whole?: boolean;
  /** Maximum size of the WebAssembly memory in bytes. Default: 4 GiB. */
  heap?: number;
  signal?: AbortSignal;
  /** For URLs: headers of requests, a function in place of fetch(), and whether servers without ETag and Last-Modified
   * are accepted. */
  headers?: Record<string, string>;
  fetch?: typeof fetch;
  unversioned?: boolean;
  /** Another model, whose WebAssembly memory is shared, for ebpo/collide. */
  beside?: Model;
}

export interface LevelInfo {
  gray: number; leaves: number; white: number; black: number; planes: number; leafPlanes: number; faces: number;
  pruned: number; grayVolume: number; leafVolume: number;
}

export interface Info {
  generator: string; sourceName: string; sourceFormat: string; unit: string; crs: string; date: string;
  rule: 'nonzero' | 'evenodd' | 'positive';
  contentSha256: string;
  version: [number, number];
  solid: boolean; pruned: boolean; hasMesh: boolean;
  /** True for a closed 2-manifold of one component and positive volume: unless faces intersect, the outside is in front of all faces. */
  outward: boolean;
  /** Volume of the mesh: the integral of the winding number. */
  volume: number;
  /** True if coordinates are doubles. */
  doubles: boolean;
  /** contentSha256 of the original of a subset. */
  subsetOf?: string;
  /** Level of the subtrees' roots; 0: none. */
  subtreeLevel: number;
  /** Root cell. */
  origin: [number, number, number]; size: [number, number, number];
  vertices: number; faces: number; sourceFaces: number; addedFaces: number; parts: number; fileBytes: number;
  levels: LevelInfo[];
  attributes: AttributeInfo[];
}

/** An array of attributes, as ebpo_attribute_facts (ebpo/file.h). `names`: names of its columns, separated by one space;
 * `columns`: 0 for lists of different lengths; `range`: minimum and maximum of all values. */
export interface AttributeInfo {
  element: string; names: string; type: 'int8' | 'uint8' | 'int16' | 'uint16' | 'int32' | 'uint32' | 'float32' | 'float64';
  rows: number; columns: number; list: boolean; range?: [number, number];
}

export interface Stats {
  memory: number; memoryPeak: number; budget: number; resident: boolean; cutLevel: number; hits: number; loads: number;
  evicted: number; bytesRead: number; reads: number; suppliedBytes: number;
  /** Number of times that bytes were requested from the source; all ranges of a time are requested together. */
  roundTrips: number;
  /** Size of the WebAssembly memory in bytes. */
  heap: number;
}

/** Points: three numbers each. Rays: six numbers each, origin and direction. */
export type Numbers = ArrayLike<number>;

export interface QueryOptions { signal?: AbortSignal }
export interface InsideOptions extends QueryOptions {
  /** Use levels 0 to `level` only; results are then certain or MAYBE. */
  level?: number;
}
/** `maxDistance`: faces farther away are ignored; `unsigned`: distances are not negative inside. */
export interface DistanceOptions extends InsideOptions { maxDistance?: number; unsigned?: boolean }
/** `radius`: maximum distance; `most`: maximum number of faces. */
export interface NearestOptions extends QueryOptions { radius?: number; most?: number }
export interface RayOptions extends QueryOptions {
  tMax?: number;
  /** Triangles that count. front: triangles that are hit from outside; back: from inside. */
  sides?: 'both' | 'front' | 'back';
}

/** `where`: OUT, IN, ON or MAYBE. */
export interface InsideResult { where: Int8Array; winding: Int32Array }
/** Correctly rounded distances, negative inside solids; nearest points and normals [3]; faces, or NO_FACE; bounds. */
export interface DistanceResult {
  distance: Float64Array; point: Float64Array; normal: Float64Array; face: Uint32Array; lo: Float64Array; hi: Float64Array;
}
export interface NearestResult { distance: Float64Array; point: Float64Array; normal: Float64Array; face: Uint32Array }
/** Without a hit: t is Infinity and face is NO_FACE. `side`: 1 enters, -1 exits, 0 edges and vertices. */
export interface RayResult { t: Float64Array; face: Uint32Array; side: Int8Array }
/** The hits of ray i are begin[i] to begin[i + 1] - 1. */
export interface AllHits extends RayResult { begin: Uint32Array }
export interface Triangles { face: Uint32Array; corners: Float64Array }
export interface Mass {
  area: number; volume: number; centroid: Float64Array; inertia: Float64Array; volumeLo: number; volumeHi: number; integral: number;
}
export interface Mesh { vertices: Float32Array | Float64Array; faces: Uint32Array }
/** Source indices of the file's vertices and faces. */
export interface Maps { vertex: Uint32Array; face: Uint32Array }
export interface OrderOptions extends QueryOptions {
  /** Order of rows. Default: source. Files without source indices have only the order of the file. */
  order?: 'source' | 'file';
}

/** Values of an attribute: `columns` of each row. Lists of different lengths have `ends`, the number of values of this row and
 * all rows before it. */
export interface Attribute {
  values: Int8Array | Uint8Array | Int16Array | Uint16Array | Int32Array | Uint32Array | Float32Array | Float64Array;
  columns: number; ends?: Float64Array;
}

/** An image file that the source names. `use`: lines such as "map_Kd" and a material's name. `sha256`: hexadecimal; "": the
 * file was not found. `bytes`: the image file; empty or undefined: not kept. */
export interface Texture { name: string; use: string; sha256: string; bytes?: Uint8Array }

/** A subtree, as ebpo_subtree_nodes and ebpo_subtree_faces (ebpo/subtree.h). Members that the file or the request does not
 * have are undefined. `number`: file indices; `source`: source indices. */
export interface Subtree {
  level: number; levelFirst: BigUint64Array; octcode: BigUint64Array; type: Uint8Array; winding?: Int32Array; children: Uint32Array;
  planeFirst?: Uint32Array; planes: Uint32Array; aboveFirst?: Uint32Array; abovePlanes: Uint32Array;
  vertices?: Float32Array | Float64Array; faces?: Uint32Array; sharedCount?: number; number?: Uint32Array; source?: Uint32Array;
  listFirst?: Uint32Array; list?: Uint32Array;
}
export interface SubtreeOptions extends QueryOptions {
  /** Number of levels below the node, without faces. -1: all, with faces. */
  levels?: number;
  /** Limit in bytes; 0: none. */
  memory?: number;
  /** Default: true. */
  orLeafAbove?: boolean;
}

/** Nodes; members as in ebpo_stream_node (ebpo/stream.h). `colour`: red + 256 green + 65,536 blue; 0xffffffff: none. */
export interface StreamNodes {
  octcode: BigUint64Array; type: Uint8Array; winding: Int32Array; cell: Float64Array; nodeVolume: Float64Array;
  colour: Uint32Array; planeCount: Uint32Array; planes: Float64Array;
  vertexCount?: Uint32Array; vertices?: Float64Array; polygonCount?: Uint32Array; polygonFirst?: Uint32Array; corners?: Uint32Array;
}

/** Nodes of a level, in the order of their octcodes. */
export interface StreamLevel extends StreamNodes { level: number; bytes: number; volume: number }

/** A perspective camera, as ebpo_observer (ebpo/view.h). Default: direction [0, 0, 0], which is all directions, up [0, 1, 0],
 * fov 45 degrees, 1280 x 720 pixels. */
export interface Observer { eye: Numbers; direction?: Numbers; up?: Numbers; fov?: number; width?: number; height?: number }

/** As ebpo_view_options (ebpo/view.h), with its default values. All priorities but 'level' need an observer. */
export interface ViewOptions {
  priority?: 'level' | 'distance' | 'pixels' | 'front-to-back';
  observer?: Observer; unseen?: 'last' | 'never'; pixels?: number; distance?: number; level?: number; bytes?: number; nodes?: number;
  /** These options cannot be changed. `faces`: the faces of leaves. */
  planes?: boolean; polygons?: boolean; windings?: boolean; memory?: number; faces?: boolean;
}

/** As ebpo_view_node (ebpo/view.h). The `complete` node is the last of eight siblings, which now replace their parent.
 * Faces of leaves, with the option faces: `faceCount` of each node, and for each face 9 numbers, the file index, and 1 if an
 * earlier leaf had the face. */
export interface ViewNodes extends StreamNodes {
  count: number; level: Uint8Array; complete: Uint8Array; seen: Uint8Array; distance: Float64Array; pixels: Float64Array;
  faceCount?: Uint32Array; faceCorners?: Float64Array; faceNumber?: Uint32Array; faceRepeated?: Uint8Array;
}

/** A mesh of the simplified surface; members as in ebpo_surface_mesh (ebpo/lod.h): 3 numbers of each vertex, normal and triangle,
 * 4 bytes of each vertex's colour; `faces`: number of faces of the model. `pixels` is NaN without an observer. */
export interface SurfaceMesh {
  vertices: Float64Array; normals: Float32Array; triangles: Uint32Array; colours?: Uint8Array;
  error: number; pixels: number; patches: number; faces: number;
}

/** Nodes in the order of their importance to an observer. */
export class ViewStream {
  private constructor();
  /** Returns the next nodes, at most `most` (default: 4,096), and only those before missing bytes; null: there are no more. */
  next(options?: QueryOptions & { most?: number }): Promise<ViewNodes | null>;
  /** Iterates over the results of next(). */
  [Symbol.asyncIterator](): AsyncGenerator<ViewNodes, void>;
  /** Why next() returned null: all nodes were returned, or the limit `bytes` or `nodes` is reached. */
  readonly end?: 'done' | 'bytes' | 'nodes';
  /** Sets other options, such as a moved observer. Options that are not given are kept. */
  change(options: ViewOptions): void;
  /** Returns the nodes that are not replaced, without faces. */
  cut(): ViewNodes;
  /** Makes a mesh for the observer from the part `surface`, as ebpo_view_stream_surface (ebpo/view.h); independent of next(). */
  surface(options?: QueryOptions): Promise<SurfaceMesh>;
  readonly stats: { nodes: number; cut: { white: number; black: number; leaves: number; gray: number }; waiting: number;
    pixels: number; bytesRead: number };
  dispose(): void;
}

/** Envelopes of a level as polygons; members as in ebpo_lod_nodes (ebpo/lod.h). */
export interface LevelPolygons {
  level: number; volume: number; vertices: Float64Array; triangles: Uint32Array;
  /** Number of corners and normal of each polygon. */
  corners: Uint8Array; normals: Float32Array;
  octcode: BigUint64Array; type: Uint8Array; winding: Int32Array; nodeVolume: Float64Array; vertexCount: Uint32Array;
  polygonCount: Uint32Array; colour: Uint32Array;
}

/** An opened file. Methods that end in Sync throw an EbpoPendingError if they need bytes that are not in memory. */
export class Model {
  private constructor();
  readonly info: Info;
  readonly stats: Stats;
  inside(points: Numbers, options?: InsideOptions): Promise<InsideResult>;
  insideSync(points: Numbers, options?: InsideOptions): InsideResult;
  distance(points: Numbers, options?: DistanceOptions): Promise<DistanceResult>;
  distanceSync(points: Numbers, options?: DistanceOptions): DistanceResult;
  /** Bounds of winding numbers that differ by at most `width` (default: 1e-9) where double precision allows it, for surfaces with
   * border; solids have integers. */
  windingBounds(points: Numbers, options?: QueryOptions & { width?: number }): Promise<{ lo: Float64Array; hi: Float64Array }>;
  /** The nearest face, the nearest `most` faces, or all faces within `radius` of one point. */
  nearest(point: Numbers, options?: NearestOptions): Promise<NearestResult>;
  nearestSync(point: Numbers, options?: NearestOptions): NearestResult;
  /** First hits. */
  rays(rays: Numbers, options?: RayOptions): Promise<RayResult>;
  raysSync(rays: Numbers, options?: RayOptions): RayResult;
  /** 1 for each ray that hits a triangle, else 0. */
  raysAny(rays: Numbers, options?: RayOptions): Promise<Uint8Array>;
  raysAnySync(rays: Numbers, options?: RayOptions): Uint8Array;
  raysAll(rays: Numbers, options?: RayOptions): Promise<AllHits>;
  raysAllSync(rays: Numbers, options?: RayOptions): AllHits;
  boxFaces(min: Numbers, max: Numbers, options?: QueryOptions): Promise<Uint32Array>;
  boxFacesSync(min: Numbers, max: Numbers): Uint32Array;
  /** Stops when there are more than `most` triangles. */
  boxTriangles(min: Numbers, max: Numbers, options?: QueryOptions & { most?: number }): Promise<Triangles>;
  measure(options?: QueryOptions): Promise<Mass>;
  mesh(options?: OrderOptions): Promise<Mesh>;
  maps(options?: QueryOptions): Promise<Maps>;
  /** Returns the corners of faces, by file indices: 9 numbers of each face. */
  corners(numbers: ArrayLike<number>, options?: QueryOptions): Promise<Float32Array | Float64Array>;
  /** Reads an attribute of info.attributes by name, such as "vertex:red", or by the name of its column alone, vertices first.
   * Rows of vertices and faces are in the order of mesh(). */
  attribute(name: string, options?: OrderOptions): Promise<Attribute>;
  /** `bytes` false: does not read the image files. */
  textures(options?: QueryOptions & { bytes?: boolean }): Promise<Texture[]>;
  /** Attributes at points on faces, such as results of `distance`: a value for each point and name. `names` are separated by
   * commas, as in ebpo_sampler_new (ebpo/query.h). NaN for NO_FACE. The model keeps the attributes in memory. */
  sample(names: string, points: Numbers, faces: ArrayLike<number>, options?: QueryOptions): Promise<Float64Array>;
  /** Reads the subtree of the node with this octcode; 1: the whole tree. */
  subtree(octcode?: bigint | number, options?: SubtreeOptions): Promise<Subtree>;
  /** Returns the octcode of the cell of a level that contains the point; 0n: the point is outside the root cell. */
  octcode(point: Numbers, level: number): bigint;
  /** Streams the levels, coarse to fine. */
  levels(options?: QueryOptions & { planes?: boolean; polygons?: boolean }): AsyncGenerator<StreamLevel, void>;
  level(level: number, options?: QueryOptions & { cellFaces?: boolean }): Promise<LevelPolygons>;
  view(options?: ViewOptions): ViewStream;
  /** Reads the whole file and compares it with its checksums. */
  check(options?: QueryOptions): Promise<void>;
  dispose(): void;
}

/** Opens a URL, a File or Blob, bytes in memory, or a source. */
export function open(from: string | URL | Blob | ArrayBuffer | ArrayBufferView | Source, options?: OpenOptions): Promise<Model>;

export function memorySource(data: ArrayBuffer | ArrayBufferView): Source;
export function blobSource(blob: Blob): Source;
export function urlSource(url: string | URL, options?: Pick<OpenOptions, 'headers' | 'fetch' | 'unversioned'>, signal?: AbortSignal): Promise<Source>;

export const OUT: 0, IN: 1, ON: 2, MAYBE: 3;
export const NO_FACE: 4294967295;

/** `status`: name in the library, such as EBPO_E_FORMAT; `path` and `offset`: location of damage in the file. */
export class EbpoError extends Error { status: string; path: string; offset: number }
export class EbpoReadError extends EbpoError {}
export class EbpoFormatError extends EbpoError {}
export class EbpoVersionError extends EbpoError {}
export class EbpoLimitError extends EbpoError {}
export class EbpoArgumentError extends EbpoError {}
export class EbpoAbsentError extends EbpoError {}
export class EbpoPendingError extends EbpoError {}
