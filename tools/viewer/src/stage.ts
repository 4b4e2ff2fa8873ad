/** Ground and light of the scene, scaled to the content. */

import {
  Box3,
  Color,
  DirectionalLight,
  Fog,
  Group,
  HemisphereLight,
  Mesh,
  MeshLambertMaterial,
  PlaneGeometry,
  Scene,
  Vector3,
  Vector4,
} from "three";

/** The texels along a side of the shadow map. */
const SHADOW_TEXELS = 1024;

/** Returns the light whose shadows follow what is seen. */
export function furnish(scene: Scene, seen: Box3, colours: Colours, { ground: look, patches: areas = [] }: SceneData): Sun {
  const extent = extentOf(seen);
  const middle = seen.getCenter(new Vector3());
  scene.background = new Color(colours.floor);
  scene.fog = new Fog(colours.floor, 3 * extent, 14 * extent);
  scene.add(ground(extent, middle, colours, look), patches(areas, colours));
  scene.add(new HemisphereLight(0xffffff, colours.dark ? 0x3d444c : 0xa9b1ba, colours.dark ? 1.5 : 1.75));
  return new Sun(scene, extent);
}

/** Returns the diagonal of what is seen, in m, at least 1. */
export function extentOf(seen: Box3): number {
  return Math.max(1, seen.getSize(new Vector3()).length());
}

/** Areas of the ground with their own friction, a little above it and hiding nothing. */
function patches(areas: PatchData[], colours: Colours): Group {
  const group = new Group();
  const material = new MeshLambertMaterial({ color: colours.text, transparent: true, opacity: 0.1, depthWrite: false });
  for (const { x, y, size } of areas) {
    const area = new Mesh(new PlaneGeometry(...size), material);
    area.position.set(x, y, 0);
    area.receiveShadow = true;
    area.renderOrder = -1;
    group.add(area);
  }
  return group;
}

/** A plane with lines and a faint checker; both are computed for each pixel, and fade before they would flicker. */
function ground(extent: number, middle: Vector3, colours: Colours, look?: GroundData): Mesh {
  const step = extent > 40 ? 10 : extent > 8 ? 1 : extent > 1 ? 0.5 : 0.1;
  const size = 28 * extent;
  const tiling = step / (look?.square ?? step);
  // The ground is drawn first and hides nothing, even objects slightly below it.
  const material = new MeshLambertMaterial({ color: colours.floor, depthWrite: false });
  const [first, second] = squares(colours, look);
  const line = new Color(colours.line);
  const drawn = { value: new Vector4(line.r, line.g, line.b, colours.dark ? 0.8 : 1) };
  material.onBeforeCompile = (shader) => {
    shader.uniforms.ruled = drawn;
    shader.uniforms.first = { value: first };
    shader.uniforms.second = { value: second };
    shader.vertexShader = `varying vec2 cell;\n${shader.vertexShader}`.replace("#include <begin_vertex>", `#include <begin_vertex>
cell = (modelMatrix * vec4(position, 1.0)).xy / ${step.toFixed(2)};`);
    shader.fragmentShader = `varying vec2 cell;\nuniform vec4 ruled;\nuniform vec3 first;\nuniform vec3 second;\n${shader.fragmentShader}`.replace("#include <color_fragment>", `
vec2 wide = fwidth(cell) + 1e-6;
vec2 off = abs(fract(cell - 0.5) - 0.5) / wide;
float clear = 1.0 - smoothstep(0.1, 0.6, max(wide.x, wide.y));
vec2 square = cell * ${tiling.toFixed(4)};
vec2 soft = fwidth(square) + 1e-6;
vec2 dark = step(0.5, fract(0.5 * square));
float sharp = 1.0 - smoothstep(0.1, 0.6, max(soft.x, soft.y));
diffuseColor.rgb = mix(0.5 * (first + second), mix(first, second, abs(dark.x - dark.y)), sharp);
diffuseColor.rgb = mix(diffuseColor.rgb, ruled.rgb, ruled.a * clear * (1.0 - min(1.0, min(off.x, off.y))));`);
  };
  const made = new Mesh(new PlaneGeometry(size, size), material);
  made.position.set(middle.x, middle.y, 0);
  made.receiveShadow = true;
  made.renderOrder = -2;
  return made;
}

/** Returns the colours of the squares of the ground: those of the world, close to those of the page so that marks stand out. */
function squares(colours: Colours, look?: GroundData): [Color, Color] {
  const floor = new Color(colours.floor);
  if (!look) return [floor, floor.clone().multiplyScalar(0.975)];
  const page = floor.getRGB({ r: 0, g: 0, b: 0 }, "srgb");
  const mixed = (own: number, part: number) => part + 0.25 * (own - part);
  const near = ([r, g, b]: [number, number, number]) => new Color().setRGB(mixed(r, page.r), mixed(g, page.g), mixed(b, page.b), "srgb");
  return [near(look.color), near(look.checker ?? look.color)];
}

/** A light from far away; its shadow map covers what is seen, and lies on a fixed grid so that edges stay still. */
export class Sun {
  private readonly light = new DirectionalLight(0xffffff, 2);
  private readonly away = new Vector3(-0.6, -0.7, 1.8).normalize();
  private readonly right = new Vector3(0, 1, 0).cross(this.away).normalize();
  private readonly up = new Vector3().crossVectors(this.away, this.right);
  private reach = 0;

  constructor(scene: Scene, private readonly extent: number) {
    this.light.castShadow = true;
    this.light.shadow.mapSize.set(SHADOW_TEXELS, SHADOW_TEXELS);
    scene.add(this.light, this.light.target);
  }

  /**
   * Covers a ball with shadows; returns true if the map has to be drawn anew.
   * @param reach its radius in m
   */
  cover(middle: Vector3, reach: number): boolean {
    // In steps, so that the size of a texel rarely changes.
    const radius = Math.min(1.5 * this.extent, 2 ** (Math.ceil(2 * Math.log2(reach)) / 2));
    // Coarser than a texel, so that a camera that moves a little needs no new map.
    const grid = (2 * radius * 32) / SHADOW_TEXELS;
    const snapped = (axis: Vector3) => Math.round(middle.dot(axis) / grid) * grid;
    const { target, position, shadow } = this.light;
    const centre = new Vector3()
      .addScaledVector(this.right, snapped(this.right))
      .addScaledVector(this.up, snapped(this.up))
      .addScaledVector(this.away, snapped(this.away));
    if (radius === this.reach && centre.equals(target.position)) return false;
    this.reach = radius;
    const { camera } = shadow;
    camera.left = camera.bottom = -radius;
    camera.right = camera.top = radius;
    camera.near = 0.01 * radius;
    camera.far = 2 * radius + 4 * this.extent;
    camera.updateProjectionMatrix();
    // Mostly along the light, as the normals of some meshes point inwards.
    shadow.bias = (-5 * radius) / SHADOW_TEXELS / (camera.far - camera.near);
    shadow.normalBias = (1 * radius) / SHADOW_TEXELS;
    target.position.copy(centre);
    position.copy(centre).addScaledVector(this.away, radius + 2 * this.extent);
    return true;
  }
}
