/** The geometries of all shapes of a scene; each mesh is built once. */

import {
  BoxGeometry,
  BufferGeometry,
  CapsuleGeometry,
  CylinderGeometry,
  Float32BufferAttribute,
  Group,
  Mesh,
  MeshLambertMaterial,
  SphereGeometry,
} from "three";

/** How shapes are drawn; `colour`: in place of their own, as for a second robot. */
export interface Look {
  opacity?: number;
  colour?: string;
}

export class Solids {
  private readonly meshes = new Map<string, BufferGeometry>();
  private readonly materials = new Map<string, MeshLambertMaterial>();

  constructor(private readonly stored: Record<string, MeshData>) {}

  /** Returns all shapes of a link or body in its frame. */
  group(shapes: Shape[], look: Look = {}): Group {
    const group = new Group();
    for (const shape of shapes) group.add(this.solid(shape, look));
    return group;
  }

  private solid(shape: Shape, look: Look): Mesh {
    const solid = new Mesh(this.geometry(shape), this.material(shape, look));
    place(solid, shape.pose, 0);
    solid.castShadow = (look.opacity ?? 1) === 1;
    solid.receiveShadow = true;
    return solid;
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
    const { points, scale, triangles } = this.stored[digest];
    // Each corner of a triangle has its own point, which gives flat faces.
    const corners = new Float32Array(3 * triangles.length);
    triangles.forEach((point, i) => {
      for (let axis = 0; axis < 3; axis++) corners[3 * i + axis] = points[3 * point + axis] * scale;
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(corners, 3));
    geometry.computeVertexNormals();
    this.meshes.set(digest, geometry);
    return geometry;
  }

  private material(shape: Shape, { opacity = 1, colour }: Look): MeshLambertMaterial {
    const key = `${colour ?? shape.color.join()} ${opacity} ${shape.kind === "mesh"}`;
    let material = this.materials.get(key);
    if (!material) {
      material = new MeshLambertMaterial({ transparent: opacity < 1, opacity, side: shape.kind === "mesh" ? 2 : 0 });
      if (colour) material.color.set(colour);
      else material.color.setRGB(...muted(shape.color), "srgb");
      this.materials.set(key, material);
    }
    return material;
  }
}

/** Sets the pose of an object: seven numbers beginning at `at`. */
export function place(object: Group | Mesh, pose: ArrayLike<number>, at: number): void {
  object.position.set(pose[at], pose[at + 1], pose[at + 2]);
  object.quaternion.set(pose[at + 3], pose[at + 4], pose[at + 5], pose[at + 6]);
}

/** Returns a less saturated colour, so that marks stand out. */
function muted([red, green, blue]: [number, number, number]): [number, number, number] {
  const grey = 0.3 * red + 0.55 * green + 0.15 * blue;
  // Black is brightened, to be visible in the dark scheme.
  const mixed = (value: number) => 0.16 + 0.84 * (grey + 0.4 * (value - grey));
  return [mixed(red), mixed(green), mixed(blue)];
}
