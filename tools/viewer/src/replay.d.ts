/** The types of the data of a replay, as a page has them: the models of `recording/replay` in Python. */

type Numbers = ArrayLike<number>;

interface Column {
  scale: number;
  first: number;
  deltas: number[];
  gaps: [number, number][];
}

/** A column with its differences as text: U+0020 and on stand for 0, -1, 1, -2, 2 and so on. */
interface TextColumn {
  scale: number;
  first: number;
  deltas: string;
  gaps: [number, number][];
}

interface JointMotion {
  type: "revolute" | "prismatic";
  axis: [number, number, number];
  column: number;
  multiplier: number;
  offset: number;
}

interface ShapeBase {
  pose: number[];
  color: [number, number, number];
  /** 0 to 1; missing: 1. */
  opacity?: number;
}
interface BoxShape extends ShapeBase {
  kind: "box";
  size: [number, number, number];
}
interface CylinderShape extends ShapeBase {
  kind: "cylinder";
  radius: number;
  length: number;
}
interface EllipsoidShape extends ShapeBase {
  kind: "ellipsoid";
  half: [number, number, number];
}
interface CapsuleShape extends ShapeBase {
  kind: "capsule";
  radius: number;
  length: number;
}
interface MeshShape extends ShapeBase {
  kind: "mesh";
  mesh: string;
}
type Shape = BoxShape | CylinderShape | EllipsoidShape | CapsuleShape | MeshShape;

interface MeshData {
  scale: number;
  points: number[];
  triangles: number[];
}

interface LinkData {
  name: string;
  parent?: number;
  origin: number[];
  joint?: JointMotion;
  shapes: Shape[];
}

interface BodyData {
  name: string;
  pose: number[];
  track?: number;
  appears?: number;
  disappears?: number;
  shapes: Shape[];
}

/** The look of the plane z = 0. */
interface GroundData {
  color: [number, number, number];
  /** The colour of every other square. */
  checker?: [number, number, number];
  /** The side of a square in m. */
  square?: number;
}

interface PatchData {
  x: number;
  y: number;
  size: [number, number];
  friction: number;
}

interface SceneData {
  robot: string;
  links: LinkData[];
  bodies: BodyData[];
  patches?: PatchData[];
  meshes: Record<string, MeshData>;
  /** What is drawn in another way than the model states it. */
  notes?: string[];
  ground?: GroundData;
}

interface EventData {
  time: number;
  until?: number;
  words: string;
  planned?: boolean;
}

interface ContactData {
  time: number;
  until: number;
  link: number;
  body: number;
  position: [number, number, number];
  /** The largest mean over 50 ms, in N; missing if neither of the two gives way. */
  force?: number;
  /** That of the whole contact, in N s. */
  impulse: number;
  /** The direction of the mean force on the link. */
  normal?: number[];
  /** The time between two forces in s. */
  period?: number;
  forces?: Column;
  /** x, y and z of the mean contact point over each period; missing in older replays. */
  places?: [Column, Column, Column];
}

interface SignalData {
  expectation: number;
  name: string;
  unit: string;
  time?: Column;
  values: Column;
  lower?: number;
  upper?: number;
  start: number;
  end?: number;
}

interface ChannelData {
  group: string;
  name: string;
  unit: string;
  /** True for values that a controller asked for; the measured ones have the same group and name. */
  commanded?: boolean;
  time?: TextColumn;
  values: TextColumn;
}

/** Pictures as PNG in base64; one of `every` that were taken. */
interface CameraData {
  sensor: string;
  every: number;
  pictures: { time: number; png: string }[];
}

/** Ranges are steps: those of the first scan, then differences from the scan before; -1: no return, -2: too near. */
interface ScanData {
  sensor: string;
  link: number;
  pose: number[];
  first_angle: number;
  increment: number;
  rays: number;
  range: number;
  time: Column;
  scale: number;
  ranges: number[];
  every_scan: number;
  every_ray: number;
}

interface CircleMark {
  kind: "circle";
  expectation?: number;
  link?: number;
  x: number;
  y: number;
  z: number;
  radius: number;
}
interface PolygonMark {
  kind: "polygon";
  expectation?: number;
  link?: number;
  points: [number, number][];
}
interface PolylineMark {
  kind: "polyline";
  expectation?: number;
  link?: number;
  points: [number, number, number][];
  /** m beside it that are allowed. */
  tolerance?: number;
  /** A view need not show all of it. */
  is_aside?: boolean;
}
interface ArrowMark {
  kind: "arrow";
  expectation?: number;
  link?: number;
  x: number;
  y: number;
  yaw: number;
  /** rad to both sides. */
  tolerance?: number;
}
type MarkData = CircleMark | PolygonMark | PolylineMark | ArrowMark;

interface Replay {
  scene: SceneData;
  joint_names: string[];
  frames: { time: Column; base: Column[]; joints: Column[]; commanded?: (Column | null)[]; speed: Column; tilt: Column; tracks: Column[][] };
  contacts: ContactData[];
  contacts_left_out: number;
  events?: EventData[];
  signals: SignalData[];
  marks: MarkData[];
  channels: ChannelData[];
  scans?: ScanData[];
  commanded_path?: [number, number, number][];
  cameras?: CameraData[];
}
