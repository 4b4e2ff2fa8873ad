/** The 3D view of a run; it draws only if something has changed. */

import { AxesHelper, Box3, Color, Group, Material, PCFShadowMap, Plane, Raycaster, Scene, Vector2, Vector3, WebGLRenderer } from "three";
import { Cameras } from "./cameras";
import { ForceLayer } from "./forces";
import { Ghost } from "./ghost";
import type { Layer } from "./layer";
import { mark, Touches, Trail, Way } from "./lines";
import { ScanLayer } from "./scans";
import { isDrawnByProcessor, Pace, shadeCheaply } from "./pace";
import { place, Solids } from "./solids";
import { furnish, type Sun } from "./stage";

/** The number of moments at which the space of the robot is sampled. */
const SAMPLES = 24;

class View3D implements View {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly cameras: Cameras;
  private readonly sun: Sun;
  private readonly links: Group[];
  private readonly bodies: Group[];
  /** What is drawn besides the robot, its world and the marks. */
  private readonly layers: Layer[] = [];
  private readonly axes: AxesHelper;
  private readonly scans: ScanLayer[];
  private readonly touches: Touches;
  private readonly forces: ForceLayer;
  private readonly marks: Group[];
  private readonly command: Group | null = null;
  private trail: Trail | null = null;
  /** The paths of repetitions. */
  private repeated: Layer[] = [];
  private ghost: Ghost | null = null;
  private readonly clearance: number;
  private readonly width: number;
  private readonly seen: Box3;
  private readonly base = new Vector3();
  /** The time of the frame that the shadows belong to. */
  private shaded = NaN;
  /** The place of the camera at that frame. */
  private readonly eye = new Vector3();
  private drawing = false;
  /** Null: the graphics card keeps pace with all pixels. */
  private readonly pace: Pace | null = null;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly run: Run,
    failed: ReadonlySet<number>,
    private readonly colours: Colours,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    if (isDrawnByProcessor(this.renderer.getContext())) {
      shadeCheaply();
      this.pace = new Pace(() => this.moved());
    }
    const solids = new Solids(run.scene.meshes);
    this.links = run.scene.links.map((link) => solids.group(link.shapes));
    this.bodies = run.scene.bodies.map((body) => solids.group(body.shapes));
    const robot = new Group();
    for (const link of this.links) robot.add(link);
    this.scene.add(robot);
    for (const body of this.bodies) this.scene.add(body);
    const size = this.sizeAt(run, run.start, robot);
    const marks = run.replay.marks.map((data) => {
      const missed = data.expectation !== undefined && failed.has(data.expectation);
      return mark(data, missed ? colours.bad : colours.accent);
    });
    const fixed = marks.filter((_, i) => {
      const data = run.replay.marks[i];
      return data.link === undefined && !(data.kind === "polyline" && data.is_aside);
    });
    this.seen = this.widened(this.everywhere(run, robot), fixed);
    this.sun = furnish(this.scene, this.seen, colours, run.scene);
    this.settle(solids);
    this.clearance = run.base[2][0] - size.min.z;
    this.width = 0.009 * this.seen.getSize(new Vector3()).length();
    this.add(new Way(run, colours.accent, this.clearance, this.width));
    this.touches = this.add(new Touches(run.replay.contacts, run.pushes, failed.size ? colours.bad : colours.text, touchSize(size, this.seen)));
    this.forces = this.add(new ForceLayer(run.pushes, colours.bad, 0.6 * touchSize(size, this.seen)));
    this.scans = run.scans.map((track) => this.add(new ScanLayer(track, track.colour(colours))));
    this.marks = marks;
    const points = run.replay.commanded_path ?? [];
    if (points.length) this.scene.add((this.command = mark({ kind: "polyline", points: points.map(([x, y]) => [x, y, 0]) }, colours.lines[4])));
    this.axes = frame(0.16 * size.getSize(new Vector3()).length());
    marks.forEach((drawn, i) => {
      const link = run.replay.marks[i].link;
      (link === undefined ? this.scene : this.links[link]).add(drawn);
    });
    this.cameras = new Cameras(canvas, this.seen, heading(run.at(run.start)));
    // The style sheet lets a finger scroll the page until the view was tapped.
    canvas.style.touchAction = "";
    this.cameras.controls.addEventListener("change", () => this.moved());
    this.home();
  }

  choose(link: number, repetitions: Run[]): void {
    this.axes.removeFromParent();
    for (const layer of this.trail ? [this.trail, ...this.repeated] : this.repeated) this.remove(layer);
    this.repeated = repetitions.map((run) => this.add(this.thinPath(run, link)));
    this.trail = null;
    if (link === 0) return;
    this.trail = this.add(new Trail(this.run, link, this.colours.accent));
    this.links[link].add(this.axes);
  }

  private thinPath(run: Run, link: number): Layer {
    if (link) return new Trail(run, link, this.colours.accent);
    const way = new Way(run, this.colours.accent, this.clearance, 0.2 * this.width);
    // Below the path of the open run.
    way.group.position.z = -0.001;
    return way;
  }

  showLayers(shown: ReadonlySet<string>): void {
    for (const { points, rays } of this.scans) [points.visible, rays.visible] = [shown.has("points"), shown.has("rays")];
    if (this.command) this.command.visible = shown.has("command");
    this.forces.group.visible = shown.has("forces");
    this.touches.group.visible = shown.has("contacts");
    this.run.replay.marks.forEach(({ expectation }, i) => {
      this.marks[i].visible = expectation === undefined || shown.has("expectations");
    });
  }

  compare(ghost: GhostRun | null): void {
    if (this.ghost) this.remove(this.ghost);
    this.ghost = ghost && this.add(new Ghost(ghost, this.colours.ghost, this.clearance, this.width));
    if (this.cameras.isUnmoved) this.home();
  }

  draw(moment: Moment, follow: boolean): void {
    // A camera that follows fires a change event, but its frame is drawn already.
    if (this.drawing) return;
    this.drawing = true;
    this.pose(moment);
    for (const layer of this.layers) layer.show(moment);
    this.base.set(moment.links[0], moment.links[1], moment.links[2]);
    if (follow) this.cameras.follow(this.base, heading(moment), this.near);
    else this.cameras.letGo();
    const { camera, controls } = this.cameras;
    this.setPixels(this.pace?.share(moment.time !== this.shaded || !camera.position.equals(this.eye)) ?? 1);
    this.eye.copy(camera.position);
    const isCovered = !this.sun.cover(controls.target, 2.2 * this.cameras.reach());
    this.renderer.shadowMap.needsUpdate = !isCovered || moment.time !== this.shaded;
    this.shaded = moment.time;
    this.renderer.render(this.scene, camera);
    this.drawing = false;
  }

  home(): void {
    this.from(this.cameras.preset);
  }

  from(preset: Preset): void {
    this.cameras.seen = this.ghost ? this.seen.clone().union(this.ghost.box) : this.seen;
    this.cameras.choose(preset);
  }

  metresPerPixel(): number | null {
    return this.cameras.metresPerPixel(this.canvas);
  }

  under(x: number, y: number): [number, number] | null {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.cameras.camera);
    const met = ray.ray.intersectPlane(new Plane(new Vector3(0, 0, 1)), new Vector3());
    return met && [met.x, met.y];
  }

  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.cameras.resize(width, height);
  }

  dispose(): void {
    this.pace?.dispose();
    this.cameras.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Has the page draw the view anew. */
  private moved(): void {
    this.canvas.dispatchEvent(new CustomEvent("viewmoved"));
  }

  /** @param share of the pixels of the screen along a side */
  private setPixels(share: number): void {
    const ratio = share * Math.min(2, devicePixelRatio || 1);
    if (ratio !== this.renderer.getPixelRatio()) this.renderer.setPixelRatio(ratio);
  }

  /** Draws a layer from now on. */
  private add<Added extends Layer>(layer: Added): Added {
    this.layers.push(layer);
    this.scene.add(layer.group);
    return layer;
  }

  private remove(layer: Layer): void {
    this.layers.splice(this.layers.indexOf(layer), 1);
    layer.group.removeFromParent();
  }

  private pose(moment: Moment): void {
    this.links.forEach((link, i) => place(link, moment.links, 7 * i));
    this.bodies.forEach((body, i) => {
      place(body, moment.bodies, 7 * i);
      body.visible = moment.here[i];
    });
  }

  /** Returns the bounding box of the robot at a time. */
  private sizeAt(run: Run, time: number, robot: Group): Box3 {
    this.pose(run.at(time));
    robot.updateMatrixWorld(true);
    const box = new Box3().setFromObject(robot);
    if (!box.isEmpty()) return box;
    // A robot without shapes is where its links are.
    return box.setFromPoints(this.links.map((link) => link.position)).expandByScalar(0.05);
  }

  /** Returns the bounding box of the robot over the whole run. */
  private everywhere(run: Run, robot: Group): Box3 {
    const all = new Box3();
    for (let i = 0; i <= SAMPLES; i++) {
      all.union(this.sizeAt(run, run.start + ((run.end - run.start) * i) / SAMPLES, robot));
    }
    return all;
  }

  /** Returns the distance in m from which the whole robot is visible. */
  private get near(): number {
    const size = new Box3();
    for (const link of this.links) size.expandByObject(link);
    return Math.max(0.3, 4 * size.getSize(new Vector3()).length());
  }

  /** Joins the bodies that never move, as a world may have thousands. */
  private settle(solids: Solids): void {
    const still = this.run.scene.bodies.map(({ track, appears }) => track === undefined && appears === undefined);
    const some = this.bodies.filter((_, i) => still[i]);
    for (const body of some) body.removeFromParent();
    this.scene.add(solids.still(some));
  }

  /** Extends the view to goals and bodies near the path, but not to far or large ones. */
  private widened(places: Box3, marks: Group[]): Box3 {
    const length = places.getSize(new Vector3()).length();
    const near = places.clone().expandByScalar(0.15 * length);
    const all = places.clone();
    for (const group of [...this.bodies, ...marks]) {
      const box = new Box3().setFromObject(group);
      const isGoal = marks.includes(group) && box.getSize(new Vector3()).length() < 1.5 * length;
      if (isGoal) all.union(box);
      else if (!box.isEmpty() && near.intersectsBox(box)) all.union(box.intersect(near));
    }
    const sizes = this.bodies.map((body) => new Box3().setFromObject(body).getSize(new Vector3()));
    for (const { body, place } of this.run.passages()) all.union(new Box3().setFromCenterAndSize(new Vector3().fromArray(place), sizes[body]));
    return all;
  }
}

/** Returns the three axes of a frame, x red, y green, z blue, visible through solids. */
function frame(length: number): AxesHelper {
  const axes = new AxesHelper(length);
  axes.setColors(new Color(0xd83a3a), new Color(0x2f9e44), new Color(0x2f6fde));
  (axes.material as Material).depthTest = false;
  axes.renderOrder = 3;
  return axes;
}

/** Returns the direction in which the base of the robot points, in rad. */
function heading({ links }: Moment): number {
  const [x, y, z, w] = links.subarray(3, 7);
  return Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
}

/** Returns the size in m of a mark that is visible on the robot and from afar. */
function touchSize(robot: Box3, seen: Box3): number {
  const length = (box: Box3) => box.getSize(new Vector3()).length();
  return Math.max(0.028 * length(robot), 0.0075 * length(seen));
}

globalThis.simActionView3D = (canvas, run, failed, colours) => new View3D(canvas, run, failed, colours);
