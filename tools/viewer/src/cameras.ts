/** The cameras of the view: a perspective one, and one from above without perspective; and their presets. */

import { Box3, MOUSE, OrthographicCamera, PerspectiveCamera, TOUCH, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { extentOf } from "./stage";

const ABOVE = new Vector3(0, 0, 1);

export class Cameras {
  readonly controls: OrbitControls;
  preset: Preset = "overview";
  private readonly perspective = new PerspectiveCamera(38, 1.6, 0.01, 1000);
  private readonly above = new OrthographicCamera();
  /** The user moved the camera since the last preset. */
  private moved = false;
  private followed: { base: Vector3; heading: number } | null = null;

  /**
   * @param seen what the presets show; another box counts from the next preset on
   * @param heading of the robot at the start, in rad
   */
  constructor(canvas: HTMLCanvasElement, public seen: Box3, private readonly heading: number) {
    for (const camera of [this.perspective, this.above]) camera.up.copy(ABOVE);
    this.controls = new OrbitControls<PerspectiveCamera | OrthographicCamera>(this.perspective, canvas);
    this.controls.enableDamping = false;
    this.controls.maxPolarAngle = 0.52 * Math.PI;
    this.controls.addEventListener("start", () => {
      this.moved = true;
    });
  }

  get camera(): PerspectiveCamera | OrthographicCamera {
    return this.preset === "top" ? this.above : this.perspective;
  }

  /** True if the camera is where the preset put it. */
  get isUnmoved(): boolean {
    return !this.moved && this.followed === null;
  }

  /** Shows everything, seen from a side. */
  choose(preset: Preset): void {
    this.preset = preset;
    this.moved = false;
    this.followed = null;
    const { controls } = this;
    const isTop = preset === "top";
    controls.object = this.camera;
    controls.enableRotate = !isTop;
    controls.mouseButtons.LEFT = isTop ? MOUSE.PAN : MOUSE.ROTATE;
    controls.touches.ONE = isTop ? TOUCH.PAN : TOUCH.ROTATE;
    this.seen.getCenter(controls.target);
    if (isTop) this.lookDown();
    else this.lookFrom(this.side(preset));
    controls.update();
  }

  resize(width: number, height: number): void {
    this.perspective.aspect = width / height;
    this.perspective.updateProjectionMatrix();
    this.above.right = (this.above.top * width) / height;
    this.above.left = -this.above.right;
    this.above.updateProjectionMatrix();
    if (this.isUnmoved) this.choose(this.preset);
  }

  /** Follows the robot, starting with a close view; from behind it also turns with the robot. */
  follow(base: Vector3, heading: number, near: number): void {
    const { camera, controls: { target }, followed } = this;
    const away = camera.position.clone().sub(target);
    const isBehind = this.preset === "behind";
    if (followed) {
      if (isBehind) away.applyAxisAngle(ABOVE, heading - followed.heading);
      target.add(base).sub(followed.base);
    } else {
      if (isBehind) away.set(-Math.cos(heading), -Math.sin(heading), 0.5);
      if (this.preset !== "top") away.setLength(isBehind ? 0.7 * near : Math.min(away.length(), near));
      target.copy(base);
    }
    camera.position.copy(target).add(away);
    this.followed = { base: base.clone(), heading };
    this.controls.update();
  }

  letGo(): void {
    this.followed = null;
  }

  /** Returns half of the height that is seen at the target, in m, and fits the depth to it. */
  reach(): number {
    const { perspective, above, controls: { target } } = this;
    if (this.camera === above) return above.top / above.zoom;
    const distance = perspective.position.distanceTo(target);
    perspective.near = distance / 200;
    perspective.far = 20 * distance + 20 * extentOf(this.seen);
    perspective.updateProjectionMatrix();
    return distance * Math.tan((perspective.fov * Math.PI) / 360);
  }

  /** Returns the size in m of a pixel of a canvas; null: it depends on the place. */
  metresPerPixel(canvas: HTMLCanvasElement): number | null {
    if (this.camera !== this.above) return null;
    return (2 * this.above.top) / this.above.zoom / canvas.clientHeight;
  }

  private lookDown(): void {
    const { above, seen, perspective: { aspect }, controls: { target } } = this;
    const size = seen.getSize(new Vector3());
    above.top = 0.58 * Math.max(0.5, size.y, size.x / aspect);
    above.bottom = -above.top;
    above.right = above.top * aspect;
    above.left = -above.right;
    above.zoom = 1;
    above.near = 0;
    above.far = 4 * extentOf(seen) + size.z;
    above.position.copy(target).setZ(seen.max.z + 2 * extentOf(seen));
    above.updateProjectionMatrix();
  }

  private side(preset: Preset): Vector3 {
    const ahead = new Vector3(Math.cos(this.heading), Math.sin(this.heading), 0);
    if (preset === "front") return ahead.setZ(0.12);
    if (preset === "side") return new Vector3(ahead.y, -ahead.x, 0.12);
    if (preset === "behind") return ahead.negate().setZ(0.5);
    const size = this.seen.getSize(new Vector3());
    // Look across the longer side, so that a path is seen from the side.
    return size.x >= size.y ? new Vector3(-0.42, -1, 0.7) : new Vector3(-1, -0.42, 0.7);
  }

  /** Places the camera in a direction from the middle, so that the whole box fits into the view. */
  private lookFrom(away: Vector3): void {
    away.normalize();
    const { perspective, seen, controls: { target } } = this;
    const distance = Math.max(0.3, ...corners(seen).map((corner) => needed(perspective, corner.sub(target), away)));
    perspective.position.copy(target).addScaledVector(away, 1.06 * distance);
  }
}

/** Returns the distance at which a camera that looks along -`away` at the origin sees a point. */
function needed(camera: PerspectiveCamera, point: Vector3, away: Vector3): number {
  const right = new Vector3().crossVectors(camera.up, away).normalize();
  const up = new Vector3().crossVectors(away, right);
  const tangent = Math.tan((camera.fov * Math.PI) / 360);
  const across = Math.max(Math.abs(point.dot(up)) / tangent, Math.abs(point.dot(right)) / (tangent * camera.aspect));
  return across + point.dot(away);
}

function corners({ min, max }: Box3): Vector3[] {
  const sides = [min, max];
  return sides.flatMap((x) => sides.flatMap((y) => sides.map((z) => new Vector3(x.x, y.y, z.z))));
}
