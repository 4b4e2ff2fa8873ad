/** Another run in the view: its robot and the bodies that differ, translucent and in one colour. */

import { Box3, Group, Mesh, MeshLambertMaterial, Vector3 } from "three";
import type { Layer } from "./layer";
import { Way } from "./lines";
import { place, Solids } from "./solids";

const OPACITY = 0.5;
/** After its end the ghost stays where it was. */
const DIM = 0.2;

export class Ghost implements Layer {
  readonly group = new Group();
  private readonly links: Group[];
  private readonly bodies: Map<number, Group>;
  private readonly way: Way;
  // Where both runs are the same, the open one is seen.
  private readonly material = new MeshLambertMaterial({ transparent: true, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 });

  constructor(private readonly run: GhostRun, colour: string, clearance: number, width: number) {
    const solids = new Solids(run.scene.meshes);
    this.material.color.set(colour);
    this.links = run.scene.links.map((link) => this.plain(solids.group(link.shapes)));
    this.bodies = new Map(run.others.map((i) => [i, this.plain(solids.group(run.scene.bodies[i].shapes))]));
    this.way = new Way(run, colour, clearance, 0.6 * width);
    // Below the path of the open run.
    this.way.group.position.z = -0.002;
    this.group.add(...this.links, ...this.bodies.values(), this.way.group);
  }

  show({ time }: Moment): void {
    const moment = this.run.at(time);
    this.links.forEach((link, i) => place(link, moment.links, 7 * i));
    for (const [i, body] of this.bodies) {
      place(body, moment.bodies, 7 * i);
      body.visible = moment.here[i];
    }
    this.way.show(moment);
    this.material.opacity = time > this.run.end + 1e-6 ? DIM : OPACITY;
  }

  /** Returns the box around its path. */
  get box(): Box3 {
    const [xs, ys, zs] = this.run.base;
    const box = new Box3();
    for (let i = 0; i < this.run.count; i++) box.expandByPoint(new Vector3(xs[i], ys[i], zs[i]));
    return box;
  }

  private plain(group: Group): Group {
    group.traverse((part) => {
      if (!(part instanceof Mesh)) return;
      part.material = this.material;
      part.castShadow = part.receiveShadow = false;
      part.renderOrder = 1;
    });
    return group;
  }
}
