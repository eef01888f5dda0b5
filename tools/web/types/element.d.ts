// Types of "ebpo-viewer". Importing this module defines the element <ebpo-viewer>.

/** Result of a point query. Distances are in the file's unit. */
export interface PointResult {
  point: [number, number, number];
  /** Undefined for surfaces, which have no inside. */
  where?: 'in' | 'out' | 'on' | 'maybe';
  /** Distance to the nearest face, if `exact`. */
  distance?: number;
  nearest?: [number, number, number];
  /** Guaranteed bounds of the distance. */
  lo: number;
  hi: number;
  exact: boolean;
}

/** The root attributes of a file, by the names of the format's specification. `solid` and `parts` are derived from the attributes. */
export interface EbpoInfo {
  face_count: number;
  vertex_count: number;
  level_count: number;
  box_origin: [number, number, number];
  box_size: [number, number, number];
  content_sha256: string;
  unit?: string;
  solid: boolean;
  parts: Set<string>;
  [attribute: string]: unknown;
}

/** One of several models: an <ebpo-part>, or an item of the list for load(). */
export interface EbpoPart {
  /** In an <ebpo-part>, always an address. */
  src: string | URL | Blob;
  /** X,Y,Z or X,Y,Z,QX,QY,QZ,QW or X,Y,Z,QX,QY,QZ,QW,SCALE. */
  pose?: string;
  /** The file's name by default. */
  name?: string;
  /** #RRGGBB. */
  colour?: string;
  hidden?: boolean;
}

/** Facts of several models or a scene. */
export interface EbpoSceneInfo {
  /** Box of all instances at all times, in the scene's coordinates. */
  box_origin: [number, number, number];
  box_size: [number, number, number];
  /** Times in seconds; equal when nothing moves. */
  from: number;
  to: number;
  /** With the facts of each file, or the error message of a file that could not be opened. */
  models: { name: string; info?: EbpoInfo; error?: string }[];
  instances: { name: string; model: string; layer?: string }[];
}

/** Result of a point query for one instance; `point` and `nearest` are in the scene's coordinates. */
export interface ScenePointResult extends PointResult {
  instance: string;
  model: string;
}

export interface EbpoViewerEventMap extends Omit<HTMLElementEventMap, 'error' | 'progress' | 'load'> {
  /** The file's header has been read. */
  load: CustomEvent<EbpoInfo | EbpoSceneInfo>;
  progress: CustomEvent<{ got: number; want: number; quiet: number }>;
  /** All data for this view has been loaded. */
  idle: CustomEvent<{ traffic: { requests: number; bytes: number } }>;
  /** `model`: the model's name, when several are shown. */
  error: CustomEvent<{ code: string; message: string; model?: string }>;
  /** The camera has moved. */
  view: CustomEvent<{ view: string }>;
  point: CustomEvent<PointResult | ScenePointResult>;
}

/**
 * Attributes for one model: src, view, level, detail, clip, box, point, colour, theme, cell-faces, alt. For several models, <ebpo-part> children, or scene, up and remote
 * replace src; further attributes are time, hide and colours. Attributes of the view have the form of the viewer's address.
 */
export declare class EbpoViewerElement extends HTMLElement {
  /** The address of worker.js, if it is not beside the module. Set it before the first element exists. */
  static worker: string | URL | undefined;
  readonly info: EbpoInfo | EbpoSceneInfo | undefined;
  readonly parts: EbpoPart[];
  src: string | null;
  view: string;
  load(what: string | URL | Blob): Promise<EbpoInfo>;
  load(parts: EbpoPart[]): Promise<EbpoSceneInfo>;
  home(): void;
  query(point: [number, number, number]): Promise<PointResult>;
  query(point: [number, number, number], instance: string): Promise<ScenePointResult>;
  addEventListener<K extends keyof EbpoViewerEventMap>(type: K, listener: (this: EbpoViewerElement, event: EbpoViewerEventMap[K]) => void, options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'ebpo-viewer': EbpoViewerElement;
  }
}
