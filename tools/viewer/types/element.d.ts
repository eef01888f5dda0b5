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

export interface EbpoViewerEventMap extends Omit<HTMLElementEventMap, 'error' | 'progress' | 'load'> {
  /** The head is there. */
  load: CustomEvent<EbpoInfo>;
  progress: CustomEvent<{ got: number; want: number; quiet: number }>;
  /** Nothing more comes for this view. */
  idle: CustomEvent<{ traffic: { requests: number; bytes: number } }>;
  error: CustomEvent<{ code: string; message: string }>;
  /** The user has moved the camera. */
  view: CustomEvent<{ view: string }>;
  point: CustomEvent<PointAnswer>;
}

/** Attributes: src, view, level, detail, clip, box, point, colour, theme, walls, alt; all but src and alt as in the viewer's address. */
export declare class EbpoViewerElement extends HTMLElement {
  /** Where worker.js is, if it does not lie beside the module. To be set before the first element is there. */
  static worker: string | URL | undefined;
  readonly info: EbpoInfo | undefined;
  src: string | null;
  view: string;
  load(what: string | URL | Blob): Promise<EbpoInfo>;
  home(): void;
  ask(point: [number, number, number]): Promise<PointAnswer>;
  addEventListener<K extends keyof EbpoViewerEventMap>(type: K, listener: (this: EbpoViewerElement, event: EbpoViewerEventMap[K]) => void, options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'ebpo-viewer': EbpoViewerElement;
  }
}
