/** The types shared by the scripts of the page and the 3D viewer. */

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
  signals: SignalData[];
  marks: MarkData[];
  channels: ChannelData[];
  scans?: ScanData[];
  commanded_path?: [number, number, number][];
  cameras?: CameraData[];
}

/** Poses of all links and bodies at a time, seven numbers each; `here`: the bodies that have appeared. */
interface Moment {
  time: number;
  links: Float64Array;
  bodies: Float64Array;
  here: boolean[];
}

/** The latest scan of a lidar: `returns` points in the world, x, y and z each. */
interface ScanTrack {
  /** The number of the scan, -1 before the first one. */
  row: number;
  /** Its colour in the current scheme. */
  colour(colours: Colours): string;
  origin: number[];
  points: Float32Array;
  returns: number;
}

/** The forces of contacts as arrows. */
interface PushTrack {
  at(time: number): { from: number[]; to: number[] }[];
}

/** The run as the 3D viewer needs it; implemented by `Motion` of the page. */
interface Run {
  replay: Replay;
  scene: SceneData;
  base: Float64Array[];
  scans: ScanTrack[];
  pushes: PushTrack;
  count: number;
  start: number;
  end: number;
  row(time: number): number;
  at(time: number): Moment;
  /** x, y and z of the origin of a link in m at each moment. */
  trail(link: number): Float64Array[];
}

/** Another run, drawn as a ghost; implemented by `GhostMotion` of the page. */
interface GhostRun extends Run {
  /** The indices of its bodies that the open run does not have like this. */
  others: number[];
}

type Preset = "overview" | "front" | "side" | "top" | "behind";

/** A view of the run. */
interface View {
  /** Draws another run as a ghost; null: none. */
  compare(ghost: GhostRun | null): void;
  draw(moment: Moment, follow: boolean): void;
  /** Shows the path and the frame of a link; 0: the base, with its path alone. */
  choose(link: number): void;
  /** Draws these layers alone; see `LAYERS` of the page. */
  showLayers(shown: ReadonlySet<string>): void;
  /** Shows the whole path. */
  home(): void;
  /** Shows the whole path from a side. */
  from(preset: Preset): void;
  /** The size in m of a CSS pixel; null: it depends on the place. */
  metresPerPixel(): number | null;
  /** Returns x and y on the ground in m under a place of the canvas in CSS pixels; null: there is no ground. */
  under(x: number, y: number): [number, number] | null;
  resize(): void;
  dispose(): void;
}

type MakeView3D = (canvas: HTMLCanvasElement, run: Run, failed: ReadonlySet<number>, colours: Colours) => View;

// Set by the bundle of the 3D viewer.
declare var simActionView3D: MakeView3D | undefined;

interface Colours {
  ground: string;
  raised: string;
  line: string;
  text: string;
  faint: string;
  accent: string;
  bad: string;
  body: string;
  robot: string;
  floor: string;
  /** Of the lines of a plot, in their order. */
  lines: string[];
  ghost: string;
  dark: boolean;
}

interface ExpectationEntry {
  name: string;
  status: "passed" | "warned" | "inconclusive" | "not_exercised" | "failed";
  time: number | null;
  cutOff: boolean;
}

/** Another run that can be drawn as a ghost beside an open one. */
interface GhostEntry {
  label: string;
  /** The block with its replay; null: the page has no room for it. */
  replay: string | null;
  /** The sim time in s at which the motions part, and how; null: they move alike. */
  parting: { time: number; words: string } | null;
  /** Up to what they move alike. */
  alike: string;
  /** True if it is drawn from the start. */
  shown: boolean;
}

interface ScenarioEntry {
  id: string;
  kind: "scenario" | "sample" | "gate" | "variations";
  name: string;
  /** The number among scenarios of this name, from 1. */
  number: number;
  status: string;
  replay: string | null;
  /** The block with the data of its plot over parameters. */
  sweep: string | null;
  /** The sim time in s of the failure, if no expectation gives it. */
  moment: number | null;
  expectations: ExpectationEntry[];
  ghosts: GhostEntry[];
}

/** A quantity that can be plotted. */
interface Signal {
  /** The stable name of it in addresses. */
  key: string;
  group: string;
  name: string;
  /** The SI unit. */
  unit: string;
  /** Returns its values in SI units. */
  read: () => Partial<Curve> & { values: Float64Array };
}

/** A scenario with its variations, or a gate with its runs: an entry of the list, and the rows of the table of all. */
interface ScenarioUnit {
  item: HTMLElement;
  /** The rows; null without a page of all scenarios. */
  body: HTMLElement | null;
  place: number;
  name: string;
  file: string;
  tags: string[];
  /** The status by which it is filtered; null: each variation has its own. */
  status: string | null;
  /** What it can be sorted by, if it is known: margin, sim, wall, change. */
  numbers: Record<string, number>;
  /** The articles of a gate, or of all variations together. */
  heads: string[];
  /** The articles that count as one scenario or gate each. */
  counted: string[];
  /** The text that is searched, of the articles of runs. */
  texts: Map<string, string>;
}

interface FilterState {
  /** The statuses that are shown; empty: all. */
  status: string[];
  find: string;
  tag: string;
  /** A key of SORTS; with a hyphen before it, the order is reversed. */
  sort: string;
  group: string;
}

interface Shortcut {
  part: "Scenarios" | "Replay";
  keys: string[];
  words: string;
  /** The words below the player, if it is named there. */
  hint?: string;
  /** Returns false if this player has no use for it; undefined: always there. */
  isThere?(player: Player): boolean;
  /** Returns false if the key is not used now. */
  act(where: { scenarios: Scenarios; player: Player | null; event: KeyboardEvent }): unknown;
}

/** A signal with its values in the shown unit, which are `factor` times those in the unit `si`. */
interface Curve {
  key: string;
  name: string;
  title: string;
  unit: string;
  si: string;
  factor: number;
  /** A smaller range of values is noise and is not magnified. */
  least: number;
  times: Float64Array;
  values: Float64Array;
  /** The commanded values, drawn dashed. */
  commanded: Float64Array | null;
  /** True if the values themselves are commanded. */
  aimed: boolean;
  status: "free" | "passed" | "warned" | "inconclusive" | "not_exercised" | "failed";
  cutOff: boolean;
  decided: number | null;
  lower: number | null;
  upper: number | null;
  from: number;
  to: number;
}

/** The plot area in pixels, and the mapping of times and values to it. */
interface Chart {
  context: CanvasRenderingContext2D;
  area: { left: number; right: number; top: number; bottom: number };
  colours: Colours;
  /** The shown time in s. */
  range: { from: number; to: number };
  x(time: number): number;
}

/** The range of values of an axis in its unit. */
interface PlotAxis {
  unit: string;
  low: number;
  high: number;
}

/** One number for each run of a gate or scenario; with categories it is their index. */
interface SweepColumn {
  name: string;
  unit: string;
  categories?: string[];
  /** A margin: negative values failed. */
  signed?: boolean;
  values: (number | null)[];
}

interface SweepData {
  parameters: SweepColumn[];
  /** What the runs measured; the first one is the smallest margin. */
  series: SweepColumn[];
  statuses: string[];
  /** The id of the article of each run; null: the page has none. */
  entries: (string | null)[];
  /** The claimed share of passed runs. */
  claim: number | null;
}

interface SweepAxis {
  name: string;
  unit: string;
  categories: string[];
  signed: boolean;
  values: number[];
}

interface SweepScale {
  low: number;
  high: number;
  /** Returns the place of a value in px. */
  at(value: number): number;
}

/** A run or a cell of a heat map in the plot, with its centre and half size in px. */
interface SweepTarget {
  x: number;
  y: number;
  halfWidth: number;
  halfHeight: number;
  /** The run to open. */
  run: number;
  runs: number;
  words: string;
  node: Element;
}
