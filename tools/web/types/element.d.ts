// Types of "ebpo-viewer": the element <ebpo-viewer>, which importing this module defines.

/** What is known of a point. Distances are in the file's unit. */
export interface PointAnswer {
  point: [number, number, number];
  /** undefined for surfaces, which have no inside */
  where?: 'in' | 'out' | 'on' | 'maybe';
  /** to the nearest face, if `exact` */
  distance?: number;
  nearest?: [number, number, number];
  /** the distance is certain to lie between these */
  lo: number;
  hi: number;
  exact: boolean;
}

/** The root attributes of a file, by the names of the format's specification, and what is made of them. */
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

/** One of several models: an <ebpo-part>, or of load(). */
export interface EbpoPart {
  /** in an <ebpo-part> an address */
  src: string | URL | Blob;
  /** X,Y,Z or X,Y,Z,QX,QY,QZ,QW or that and a scale */
  pose?: string;
  /** the file's, if it is left out */
  name?: string;
  /** #RRGGBB */
  colour?: string;
  hidden?: boolean;
}

/** Of several models, or a scene. */
export interface EbpoSceneInfo {
  /** of all that can be shown, at all times, in the scene's coordinates */
  box_origin: [number, number, number];
  box_size: [number, number, number];
  /** seconds; equal where nothing moves */
  from: number;
  to: number;
  /** with what is known of each, or why it could not be opened */
  models: { name: string; info?: EbpoInfo; error?: string }[];
  instances: { name: string; model: string; layer?: string }[];
}

/** Of one instance; `point` and `nearest` in the scene's coordinates. */
export interface ScenePointAnswer extends PointAnswer {
  instance: string;
  model: string;
}

export interface EbpoViewerEventMap extends Omit<HTMLElementEventMap, 'error' | 'progress' | 'load'> {
  /** The head is there. */
  load: CustomEvent<EbpoInfo | EbpoSceneInfo>;
  progress: CustomEvent<{ got: number; want: number; quiet: number }>;
  /** Nothing more comes for this view. */
  idle: CustomEvent<{ traffic: { requests: number; bytes: number } }>;
  /** `model`: its name, where it is one of several. */
  error: CustomEvent<{ code: string; message: string; model?: string }>;
  /** The user has moved the camera. */
  view: CustomEvent<{ view: string }>;
  point: CustomEvent<PointAnswer | ScenePointAnswer>;
}

/**
 * Attributes: src, view, level, detail, clip, box, point, colour, theme, walls, alt; in place of src, <ebpo-part>s in it or scene, up, remote; of several models time, hide, colours.
 * Those of a view are as in the viewer's address.
 */
export declare class EbpoViewerElement extends HTMLElement {
  /** Where worker.js is, if it does not lie beside the module. To be set before the first element is there. */
  static worker: string | URL | undefined;
  readonly info: EbpoInfo | EbpoSceneInfo | undefined;
  readonly parts: EbpoPart[];
  src: string | null;
  view: string;
  load(what: string | URL | Blob): Promise<EbpoInfo>;
  load(parts: EbpoPart[]): Promise<EbpoSceneInfo>;
  home(): void;
  ask(point: [number, number, number]): Promise<PointAnswer>;
  ask(point: [number, number, number], instance: string): Promise<ScenePointAnswer>;
  addEventListener<K extends keyof EbpoViewerEventMap>(type: K, listener: (this: EbpoViewerElement, event: EbpoViewerEventMap[K]) => void, options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'ebpo-viewer': EbpoViewerElement;
  }
}
