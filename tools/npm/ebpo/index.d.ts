/** Reads and queries EBP-Octree files (.ebpo.h5) in browsers and Node. */

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
  /** Root cell. */
  origin: [number, number, number]; size: [number, number, number];
  vertices: number; faces: number; sourceFaces: number; parts: number; fileBytes: number;
  levels: LevelInfo[];
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
export interface DistanceOptions extends InsideOptions { maxDistance?: number; unsigned?: boolean }
export interface NearestOptions extends QueryOptions { radius?: number; most?: number }
export interface RayOptions extends QueryOptions {
  tMax?: number;
  /** Triangles that count: front: hit from outside. */
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

/** Nodes of a level, in the order of their octcodes; members as in ebpo_stream_node (ebpo/stream.h). `colour`:
 * red + 256 green + 65,536 blue; 0xffffffff: none. */
export interface StreamLevel {
  level: number; bytes: number; volume: number;
  octcode: BigUint64Array; type: Uint8Array; winding: Int32Array; cell: Float64Array; nodeVolume: Float64Array;
  colour: Uint32Array; planeCount: Uint32Array; planes: Float64Array;
  vertexCount?: Uint32Array; vertices?: Float64Array; polygonCount?: Uint32Array; polygonFirst?: Uint32Array; corners?: Uint32Array;
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
  boxTriangles(min: Numbers, max: Numbers, options?: QueryOptions): Promise<Triangles>;
  measure(options?: QueryOptions): Promise<Mass>;
  mesh(options?: QueryOptions): Promise<Mesh>;
  /** Streams the levels, coarse to fine. */
  levels(options?: QueryOptions & { planes?: boolean; polygons?: boolean }): AsyncGenerator<StreamLevel, void>;
  level(level: number, options?: QueryOptions & { cellFaces?: boolean }): Promise<LevelPolygons>;
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
