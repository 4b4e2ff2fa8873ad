/** The surfaces of links and bodies: one mesh for all opaque shapes of each, as every mesh costs a draw call. */

import {
  BoxGeometry,
  BufferGeometry,
  CapsuleGeometry,
  Color,
  CylinderGeometry,
  DoubleSide,
  Float32BufferAttribute,
  Group,
  Matrix4,
  Mesh,
  MeshLambertMaterial,
  type Object3D,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import { smooth } from "./smoothing";

/** How shapes are drawn; `colour`: in place of their own, as for a second robot. */
export interface Look {
  opacity?: number;
  colour?: string;
}

export class Solids {
  private readonly meshes = new Map<string, BufferGeometry>();
  private readonly materials = new Map<number, MeshLambertMaterial>();

  constructor(private readonly stored: Record<string, MeshData>) {}

  /** Returns all shapes of a link or body in its frame. */
  group(shapes: Shape[], look: Look = {}): Group {
    const group = new Group();
    const opacities = shapes.map((shape) => (shape.opacity ?? 1) * (look.opacity ?? 1));
    for (const opacity of new Set(opacities)) {
      if (opacity === 0) continue;
      const some = shapes.filter((_, i) => opacities[i] === opacity);
      group.add(this.solid(some.map((shape) => this.coloured(shape, look)), opacity));
    }
    return group;
  }

  /** Returns objects that never move as one, where they are now. */
  still(groups: Object3D[]): Group {
    const whole = new Group();
    const placed = new Map<number, BufferGeometry[]>();
    for (const group of groups) {
      group.updateMatrixWorld(true);
      group.traverse((one) => {
        if (!(one instanceof Mesh)) return;
        const { opacity } = one.material as MeshLambertMaterial;
        placed.set(opacity, [...(placed.get(opacity) ?? []), one.geometry.applyMatrix4(one.matrixWorld)]);
      });
    }
    for (const [opacity, geometries] of placed) whole.add(this.solid(geometries, opacity));
    return whole;
  }

  private solid(geometries: BufferGeometry[], opacity: number): Mesh {
    const solid = new Mesh(joined(geometries), this.material(opacity));
    solid.castShadow = opacity === 1;
    solid.receiveShadow = true;
    return solid;
  }

  private coloured(shape: Shape, look: Look): BufferGeometry {
    const own = this.geometry(shape);
    const geometry = own.index ? own.toNonIndexed() : own.clone();
    const [x, y, z, qx, qy, qz, qw] = shape.pose;
    geometry.applyMatrix4(new Matrix4().compose(new Vector3(x, y, z), new Quaternion(qx, qy, qz, qw), new Vector3(1, 1, 1)));
    const { r, g, b } = look.colour ? new Color(look.colour) : new Color().setRGB(...visible(shape.color), "srgb");
    const colours = new Float32Array(3 * geometry.getAttribute("position").count);
    for (let i = 0; i < colours.length; i += 3) colours.set([r, g, b], i);
    return geometry.setAttribute("color", new Float32BufferAttribute(colours, 3));
  }

  private geometry(shape: Shape): BufferGeometry {
    switch (shape.kind) {
      case "box":
        return new BoxGeometry(...shape.size);
      case "cylinder":
        // Cylinders of three.js have their axis along y.
        return new CylinderGeometry(shape.radius, shape.radius, shape.length, 32).rotateX(Math.PI / 2);
      case "ellipsoid":
        return new SphereGeometry(1, 32, 20).scale(...shape.half);
      case "capsule":
        return new CapsuleGeometry(shape.radius, shape.length, 8, 24).rotateX(Math.PI / 2);
      case "mesh":
        return this.mesh(shape.mesh);
    }
  }

  private mesh(digest: string): BufferGeometry {
    const known = this.meshes.get(digest);
    if (known) return known;
    const geometry = smooth(this.stored[digest]);
    this.meshes.set(digest, geometry);
    return geometry;
  }

  private material(opacity: number): MeshLambertMaterial {
    let material = this.materials.get(opacity);
    if (!material) {
      material = new MeshLambertMaterial({ vertexColors: true, transparent: opacity < 1, opacity, depthWrite: opacity === 1, side: DoubleSide });
      this.materials.set(opacity, material);
    }
    return material;
  }
}

/** Sets the pose of an object: seven numbers beginning at `at`. */
export function place(object: Object3D, pose: ArrayLike<number>, at: number): void {
  object.position.set(pose[at], pose[at + 1], pose[at + 2]);
  object.quaternion.set(pose[at + 3], pose[at + 4], pose[at + 5], pose[at + 6]);
}

/** Returns one geometry of several; each triangle has three points of its own. */
function joined(geometries: BufferGeometry[]): BufferGeometry {
  const whole = new BufferGeometry();
  for (const name of ["position", "normal", "color"]) {
    const parts = geometries.map((geometry) => geometry.getAttribute(name).array as Float32Array);
    const values = new Float32Array(parts.reduce((sum, part) => sum + part.length, 0));
    let at = 0;
    for (const part of parts) {
      values.set(part, at);
      at += part.length;
    }
    whole.setAttribute(name, new Float32BufferAttribute(values, 3));
  }
  return whole;
}

/** Returns a colour of the model a little less saturated, so that marks stand out. */
function visible([red, green, blue]: [number, number, number]): [number, number, number] {
  const grey = 0.3 * red + 0.55 * green + 0.15 * blue;
  // Black is brightened, to be visible in the dark scheme and to have a shape.
  const mixed = (value: number) => 0.1 + 0.88 * (grey + 0.75 * (value - grey));
  return [mixed(red), mixed(green), mixed(blue)];
}
