// Types of "ebpo-viewer/reader" and of "ebpo-reader", which is the same code. docs/guide/embedding.md describes their use.
import type { EbpoInfo } from './element.js';

export declare const WHITE: 0, BLACK: 1, LEAF: 2, GRAY: 3;
export type Point = ArrayLike<number>;
export type NodeType = 0 | 1 | 2 | 3;

export declare class EbpoError extends Error {
  constructor(code: EbpoError['code'], message: string, options?: ErrorOptions);
  readonly code: 'FORMAT' | 'VERSION' | 'NETWORK' | 'ABSENT' | 'ARGUMENT';
}

/** A source of bytes: one of these classes, or another object with these members. */
export interface Source {
  name: string;
  size: number;
  requests: number;
  bytes: number;
  open(bytes: number): Promise<Uint8Array>;
  read(offset: number, length: number): Promise<Uint8Array>;
}
export interface UrlOptions {
  /** Bytes of the first request. */
  ahead?: number;
  /** Longest time without a byte, in milliseconds; then the request is repeated. */
  timeout?: number;
  /** Keeps repeating requests while the connection is lost, instead of failing. */
  patient?: boolean;
  fetch?: typeof fetch;
}
export declare class UrlSource implements Source {
  constructor(url: string | URL, options?: UrlOptions);
  name: string;
  size: number;
  requests: number;
  bytes: number;
  open(bytes: number): Promise<Uint8Array>;
  read(offset: number, length: number): Promise<Uint8Array>;
  retry(): void;
  close(): void;
}
export declare class BlobSource implements Source {
  constructor(blob: Blob, name?: string);
  name: string;
  size: number;
  requests: number;
  bytes: number;
  open(bytes: number): Promise<Uint8Array>;
  read(offset: number, length: number): Promise<Uint8Array>;
}
export declare class BytesSource implements Source {
  constructor(bytes: ArrayBuffer | Uint8Array, name?: string);
  name: string;
  size: number;
  requests: number;
  bytes: number;
  open(bytes: number): Promise<Uint8Array>;
  read(offset: number, length: number): Promise<Uint8Array>;
}
export type Openable = string | URL | Blob | ArrayBuffer | Uint8Array | Source;
export declare function sourceOf(what: Openable, options?: UrlOptions): Source;

export interface OpenOptions extends UrlOptions {
  /** A decoder from loadZstd(), or a promise of a decoder. */
  zstd?: unknown;
  headBytes?: number;
  cacheBytes?: number;
}
export declare function openEbpo(what: Openable, options?: OpenOptions): Promise<EbpoFile>;
export declare function loadZstd(ZSTDDecoder?: unknown): Promise<unknown>;

/** A level's arrays. Arrays that the file does not have are undefined. */
export interface Level {
  level: number;
  groups: number;
  types: Uint16Array;
  planeCounts?: Uint8Array;
  planes?: Uint32Array;
  leafFirst?: ArrayLike<number>;
  leafNew?: ArrayLike<number>;
  [array: string]: unknown;
}
/** Nine numbers for each face. */
export type Faces = Float64Array & { numbers: Uint32Array; colours?: Uint8Array };

export declare class EbpoFile {
  readonly source: Source;
  readonly info: EbpoInfo;
  readonly traffic: { requests: number; bytes: number };
  readonly located: boolean;
  locate(): Promise<void>;
  bytesToLevel(level: number): number;
  levels(first: number, last: number, options?: { faces?: boolean }): Promise<Level[]>;
  addFaces(levels: Level[]): Promise<void>;
  nodeParts(wanted: { level: number; part: number }[], options?: { planes?: boolean }): Promise<unknown[]>;
  mesh(): Promise<{ vertices: Float32Array | Float64Array; faces: Uint32Array }>;
  facesByNumber(numbers: ArrayLike<number>): Promise<Float64Array & { colours?: Uint8Array }>;
  leafFaces(leaves: Node[]): Promise<Faces[]>;
  maps(): Promise<{ vertexSource: Uint32Array; faceSource: Uint32Array }>;
  /** Returns the indices of faces in the source mesh. */
  sourceFaces(numbers: ArrayLike<number>): Promise<Uint32Array>;
  checkOrder(levels: Level[]): void;
  verifyContent(): Promise<void>;
}

export interface Node {
  readonly parent: Node | undefined;
  readonly level: number;
  readonly octant: number;
  readonly at: [number, number, number];
  readonly type: NodeType;
  readonly rank: number;
}
/** A convex polytope in its cell, 0 .. 1 on each axis: polygon f has the corners corner[first[f]] .. corner[first[f + 1] - 1]. */
export interface Polytope {
  vertices: number;
  faces: number;
  x: Float64Array;
  first: ArrayLike<number>;
  corner: ArrayLike<number>;
  onCellFace: ArrayLike<number>;
}
export declare class Tree {
  constructor(info: EbpoInfo);
  readonly info: EbpoInfo;
  readonly root: Node | undefined;
  readonly depth: number;
  add(level: Level): void;
  /** Returns a tree for queries that shares the loaded levels and has no planes below them. */
  lean(): Tree;
  children(node: Node): Node[] | undefined;
  isPruned(node: Node): boolean;
  planes(node: Node): ArrayLike<number>;
  winding(node: Node): number;
  polytope(node: Node): Polytope;
  cellFace(node: Node, axis: number, side: 0 | 1): number;
  size(node: Node, axis: number): number;
}
export declare function growForQuery(file: EbpoFile, tree: Tree, nodes: Node[]): Promise<unknown>;
export declare function growForView(file: EbpoFile, tree: Tree, wants: { node: Node; levels: number }[], options?: { bytes?: number }): Promise<number>;

export declare function isInside(rule: string, winding: number): boolean;
export declare function inside(tree: Tree, p: Point, deepest?: number): { where: 'in' | 'out' | 'maybe'; node?: Node; winding?: number };
export declare function insideLeaf(tree: Tree, leaf: Node, p: Point, faces: Float64Array): { where: 'in' | 'out' | 'on'; winding?: number };
export declare function distanceInterval(tree: Tree, p: Point, deepest?: number): { lo: number; hi: number };
export declare function cellNear(tree: Tree, node: Node, p: Point): number;
export declare function nearestOnTriangle(p: Point, faces: ArrayLike<number>, at: number): [number, number, number, number];
export declare function nearestFace(tree: Tree, p: Point, facesOf: (leaves: Node[]) => Promise<Float64Array[]> | Float64Array[], deeper: (nodes: Node[]) => Promise<unknown>):
  Promise<{ distance: number; point: number[]; face?: number; corners?: Float64Array; leaves: number }>;

export declare function cube(): Polytope;
export declare function decodePlane(code: number): { n: [number, number, number]; d: number };
export declare function envelope(parent: Polytope, octant: number, codes: ArrayLike<number>): Polytope;
export declare function volume(polytope: Polytope): number;
export declare function orient3d(a: Point, b: Point, c: Point, d: Point): number;
export declare function axisCrossing(from: Point, to: number, axis: number, a: Point, b: Point, c: Point): number;
export declare function onTriangle(p: Point, a: Point, b: Point, c: Point): boolean;
