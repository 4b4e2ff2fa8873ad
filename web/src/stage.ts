/** Ground, light and camera, scaled to the content. */

import {
  Box3,
  BufferGeometry,
  Color,
  DirectionalLight,
  Float32BufferAttribute,
  Fog,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  PerspectiveCamera,
  PlaneGeometry,
  Scene,
  Vector3,
} from "three";

export function furnish(scene: Scene, seen: Box3, colours: Colours): DirectionalLight {
  const extent = Math.max(1, seen.getSize(new Vector3()).length());
  const middle = seen.getCenter(new Vector3());
  const far = 14 * extent;
  scene.background = new Color(colours.floor);
  scene.fog = new Fog(colours.floor, 3 * extent, far);
  // The ground is drawn first and hides nothing, even objects slightly below it.
  const surface = new MeshLambertMaterial({ color: colours.floor, depthWrite: false });
  const ground = new Mesh(new PlaneGeometry(2 * far, 2 * far), surface);
  ground.position.set(middle.x, middle.y, 0);
  ground.receiveShadow = true;
  ground.renderOrder = -2;
  const lines = grid(extent, middle, colours);
  lines.renderOrder = -1;
  scene.add(ground, lines);
  scene.add(new HemisphereLight(0xffffff, colours.dark ? 0x333940 : 0xb9c0c8, colours.dark ? 1.6 : 2));
  return sun(scene, extent, middle);
}

/** Draws each cell as short lines, as some browsers omit long lines that begin behind the camera. */
function grid(extent: number, middle: Vector3, colours: Colours): LineSegments {
  const step = extent > 40 ? 10 : extent > 8 ? 1 : extent > 1 ? 0.5 : 0.1;
  const half = Math.min(40, Math.ceil((6 * extent) / step));
  const ends: number[] = [];
  for (let along = -half; along < half; along++) {
    for (let across = -half; across <= half; across++) {
      ends.push(along, across, 0, along + 1, across, 0, across, along, 0, across, along + 1, 0);
    }
  }
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(ends, 3));
  const made = new LineSegments(geometry, new LineBasicMaterial({ color: colours.line, depthWrite: false, transparent: true, opacity: colours.dark ? 0.55 : 0.9 }));
  made.scale.setScalar(step);
  made.position.set(Math.round(middle.x / step) * step, Math.round(middle.y / step) * step, 0);
  return made;
}

function sun(scene: Scene, extent: number, middle: Vector3): DirectionalLight {
  const light = new DirectionalLight(0xffffff, 1.7);
  light.position.set(middle.x - 0.6 * extent, middle.y - 0.7 * extent, middle.z + 1.8 * extent);
  light.target.position.copy(middle);
  light.castShadow = true;
  const { camera, mapSize } = light.shadow;
  camera.left = camera.bottom = -extent;
  camera.right = camera.top = extent;
  camera.near = 0.1 * extent;
  camera.far = 5 * extent;
  camera.updateProjectionMatrix();
  mapSize.set(2048, 2048);
  light.shadow.normalBias = 0.002 * extent;
  scene.add(light, light.target);
  return light;
}

/** Places the camera behind and right of a box, so that the whole box fits into the view. */
export function overview(camera: PerspectiveCamera, seen: Box3, target: Vector3): void {
  seen.getCenter(target);
  const size = seen.getSize(new Vector3());
  // Look across the longer side, so that a path is seen from the side.
  const away = (size.x >= size.y ? new Vector3(-0.42, -1, 0.7) : new Vector3(-1, -0.42, 0.7)).normalize();
  const distance = Math.max(0.3, ...corners(seen).map((corner) => needed(camera, corner.sub(target), away)));
  camera.position.copy(target).addScaledVector(away, 1.06 * distance);
  camera.near = distance / 200;
  camera.far = distance * 60;
  camera.updateProjectionMatrix();
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
