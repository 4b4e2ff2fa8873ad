/** The types shared by the scripts of the page and the 3D viewer. */

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
  /** Where a contact is while it lasts, in the world; otherwise where it began. */
  place(contact: number, time: number): number[];
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
  /** The places in m of bodies that move, as far as they come near the way of the robot. */
  passages(): { body: number; place: number[] }[];
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
  /** Shows the path and the frame of a link, and its paths in repetitions as thin lines; 0: the base, with its path alone. */
  choose(link: number, repetitions: Run[]): void;
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
  /** The sentence for runs that do not part. */
  alike: string;
  /** True if it is drawn from the start. */
  shown: boolean;
  /** True if it shows the confidence of the run: its path is a thin line, and plots have bands. */
  repetition: boolean;
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
  /** The name of the expectation to which it belongs; empty for none. */
  about: string;
  /** The words for commanded values; empty if there are only measured ones. */
  kind: string;
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
  /** The lowest and highest values in several runs, this one among them. */
  band: { runs: number; low: Float64Array; high: Float64Array } | null;
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

/** A place on the screen in pixels. */
interface Box {
  left: number;
  right: number;
  top: number;
  bottom: number;
}

/** The plot area in pixels, and the mapping of times and values to it. */
interface Chart {
  context: CanvasRenderingContext2D;
  area: Box;
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

/** An axis as it is drawn, with its scale. */
interface SweepSide {
  axis: SweepAxis;
  scale: SweepScale;
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
