// Types of <vdi-viewer>; docs/web.md says what each member means.
import type { Scene } from "./scene.js";

type Vector = [number, number, number];

/** A view: VTK's meanings, world units, the full vertical angle in degrees. */
export interface ViewerCamera {
  position: Vector;
  focal_point: Vector;
  view_up: Vector;
  view_angle?: number;
  parallel_scale?: number;
  window_center?: [number, number];
}

export interface ClippingPlane {
  origin: Vector;
  normal: Vector;
}

/** Of a VDI that keeps values: opacities at shares of `clim`; a `cmap` of null has the file's colours. */
export interface ViewerTransfer {
  cmap: string | null;
  clim: [number, number];
  /** x, opacity, x, opacity, ...: 0 to 1. */
  points: number[];
}

export interface ViewerValues {
  range: [number, number];
  /** By length, in bins of the range. */
  histogram: Float32Array;
  start: ViewerTransfer;
}

/** Factors of colours and of optical depths; shares of the bounds: x0, x1, y0, y1, z0, z1. */
export interface ViewerLook {
  brightness: number;
  opacity: number;
  clip: [number, number, number, number, number, number];
  transfer?: ViewerTransfer;
}

export interface ViewerStatus {
  state: "empty" | "loading" | "coarse" | "full" | "error";
  progress: number;
  message?: string;
  supersegments?: number;
  lists?: [number, number];
  pixels: number;
}

export interface ViewerPicture {
  width: number;
  height: number;
  /** Premultiplied RGBA, the top row first. */
  data: Uint8ClampedArray;
}

export interface ViewerEventMap {
  camerachange: CustomEvent<{ camera: ViewerCamera }>;
  lookchange: CustomEvent<{ look: ViewerLook }>;
  vditime: CustomEvent<{ time: number; step: number }>;
  framedrawn: CustomEvent<{ full: boolean; state: ViewerStatus["state"] }>;
  error: CustomEvent<{ message: string }>;
}

export class VDIViewer extends HTMLElement {
  readonly ready: Promise<VDIViewer>;
  src: string;
  get camera(): ViewerCamera | null;
  set camera(camera: ViewerCamera);
  get home(): ViewerCamera | null;
  set home(camera: ViewerCamera | null);
  get background(): string;
  set background(color: string | Iterable<number>);
  get look(): ViewerLook;
  set look(look: Partial<ViewerLook>);
  get clippingPlanes(): ClippingPlane[];
  set clippingPlanes(planes: Iterable<ClippingPlane>);
  scene: Scene | null;
  time: number | null;
  readonly values: ViewerValues | null;
  readonly transferFunction: { colors: Vector[]; scalar_range: [number, number] } | null;
  readonly status: ViewerStatus;
  readonly series: { times: number[]; length: number; nearest(time: number): number } | null;
  readonly set: { length: number; nearest: number } | null;
  readonly playing: boolean;
  play(options?: { rate?: number }): void;
  pause(): void;
  resetCamera(): void;
  load(source: string | URL | Uint8Array | Blob | ReadableStream): Promise<VDIViewer>;
  screenshot(size?: { width?: number; height?: number }): Promise<ViewerPicture>;
  addEventListener<K extends keyof ViewerEventMap>(
    type: K, listener: (this: VDIViewer, event: ViewerEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "vdi-viewer": VDIViewer;
  }
}
