/** Something that is drawn in the world and depends on the moment: paths, contacts, scans, a second robot. */

import type { Object3D } from "three";

export interface Layer {
  readonly group: Object3D;
  /** Changes `group` to what is seen at a moment; it is called before each frame. */
  show(moment: Moment): void;
}
