/** The forces of contacts: an arrow from the place of each contact, as long as its force. */

import { ConeGeometry, CylinderGeometry, Group, Mesh, MeshBasicMaterial, Vector3 } from "three";
import type { Layer } from "./layer";

const UP = new Vector3(0, 1, 0);
/** Of the length of an arrow. */
const HEAD = 0.25;

export class ForceLayer implements Layer {
  readonly group = new Group();
  private readonly arrows: Group[] = [];
  private readonly material: MeshBasicMaterial;
  private readonly shaft: CylinderGeometry;
  private readonly head: ConeGeometry;

  /** @param width the width of a shaft in m */
  constructor(private readonly track: PushTrack, colour: string, width: number) {
    // It is seen through the robot, which may hide a contact.
    this.material = new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true, opacity: 0.9 });
    this.shaft = new CylinderGeometry(width / 2, width / 2, 1, 8).translate(0, 0.5, 0);
    this.head = new ConeGeometry(1.6 * width, 1, 12).translate(0, 0.5, 0);
  }

  show({ time }: Moment): void {
    const pushes = this.track.at(time);
    while (this.arrows.length < pushes.length) this.arrows.push(this.arrow());
    this.arrows.forEach((arrow, i) => {
      const push = pushes[i];
      arrow.visible = push !== undefined;
      if (!push) return;
      const [from, to] = [new Vector3(...push.from), new Vector3(...push.to)];
      const along = to.sub(from), length = along.length();
      arrow.position.copy(from);
      arrow.quaternion.setFromUnitVectors(UP, along.divideScalar(length));
      const [shaft, head] = arrow.children;
      shaft.scale.y = (1 - HEAD) * length;
      head.position.y = (1 - HEAD) * length;
      head.scale.y = HEAD * length;
    });
  }

  private arrow(): Group {
    const arrow = new Group();
    arrow.add(new Mesh(this.shaft, this.material), new Mesh(this.head, this.material));
    for (const part of arrow.children) part.renderOrder = 2;
    this.group.add(arrow);
    return arrow;
  }
}
